# SPDX-License-Identifier: Apache-2.0
"""The one exception a user may see, and the exit codes (docs/reference/exit-codes.md)."""

import re
from enum import IntEnum

_LONGEST_LINE = 1200
_LONG_WORD = re.compile(r"\S{200,}")


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
        super().__init__(printable(line))
        self.code = code


def printable(line: str) -> str:
    """Whatever a file has, what is shown of it is short and does nothing to a terminal."""
    if not line.isprintable():
        line = "".join(letter if letter.isprintable() else _escaped(letter) for letter in line)
    if len(line) > _LONGEST_LINE:
        line = _LONG_WORD.sub(lambda word: f"{word[0][:80]}...{word[0][-40:]}", line)
    if len(line) > _LONGEST_LINE:
        line = f"{line[: _LONGEST_LINE // 2]} ... {line[-_LONGEST_LINE // 3 :]}"
    return line


def _escaped(letter: str) -> str:
    if letter in "\n\r\t":
        return " "
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")


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
