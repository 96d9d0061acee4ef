# SPDX-License-Identifier: Apache-2.0
"""The one exception a user may see, and the exit codes (docs/reference/exit-codes.md)."""

from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of every slambed command."""

    OK = 0
    NOT_ALL_GOOD = 1
    BAD_INPUT = 2
    ENVIRONMENT = 3
    PEER = 4
    INTERNAL = 70


class SlambedError(Exception):
    """A failure reported in one line: what, where, what to do."""

    def __init__(self, line: str, code: ExitCode = ExitCode.BAD_INPUT) -> None:
        super().__init__(line)
        self.code = code


class PassingError(SlambedError):
    """A failure of the environment that may be gone on the next try, such as a daemon that restarts
    or a process that was killed."""

    def __init__(self, line: str, code: ExitCode = ExitCode.ENVIRONMENT) -> None:
        super().__init__(line, code)


class KilledError(PassingError):
    """A process of a run was killed, by a user or because memory ran out."""


class MissingDataError(SlambedError):
    """A known dataset whose source is not on this machine."""


def no_space(where: object) -> SlambedError:
    """Returns the error for a full disk. Files are written atomically, so the same command can
    resume."""
    return environment_error(
        f"no space left on the disk of {where}; free some and give the same command again, "
        "what is finished stays"
    )


def environment_error(line: str) -> SlambedError:
    """Returns the error for a missing privilege, device, port or disk, which is not the user's
    input."""
    return SlambedError(line, ExitCode.ENVIRONMENT)
