# SPDX-License-Identifier: Apache-2.0
"""Turns the exception that ended a command into one line and a documented exit code."""

import errno
import os
import traceback
from pathlib import Path

import typer

from slambed.errors import ExitCode, SlambedError, environment_error, no_space

INTERRUPTED = 130
"""128 + SIGINT, as in shells."""
REMEDIES = {
    errno.EDQUOT: "free some of your quota and give the same command again",
    errno.EFBIG: "raise the limit on the size of a file ('ulimit -f') and give the same command "
    "again",
    errno.EMFILE: "raise the limit on open files ('ulimit -n') and give the same command again",
    errno.EIO: "look at the disk ('dmesg') and give the same command again",
    errno.EROFS: "choose a place that can be written to, or mount it so",
    errno.ENAMETOOLONG: "choose a shorter path",
    errno.ESTALE: "mount the file server's folder again and give the same command again",
}
"""Maps the errno of a failed write, other than a full disk, to a remedy."""


def line_and_code(error: BaseException) -> tuple[str, int]:
    """Returns the line without `error: ` and the exit code. With SLAMBED_DEBUG, an unknown failure
    also prints its traceback."""
    if isinstance(error, SlambedError):
        return str(error), int(error.code)
    if isinstance(error, KeyboardInterrupt | typer.Abort):
        return "interrupted", INTERRUPTED
    if isinstance(error, typer.TyperException):
        message = error.format_message() or "a subcommand is missing"
        stop = "" if message.endswith((".", "?")) else "."
        return f"{message}{stop} See 'slambed --help'", int(ExitCode.BAD_INPUT)
    if (refused := refused_write(error)) is not None:
        return str(refused), int(refused.code)
    if isinstance(error, PermissionError):
        # A file without permission is no bug of ours, whoever owns it.
        remedy = "change its permissions, or run as a user who has them"
        return f"{error.filename}: {error.strerror}; {remedy}", int(ExitCode.ENVIRONMENT)
    if os.environ.get("SLAMBED_DEBUG"):
        traceback.print_exception(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{Path(where.filename).name}:{where.lineno}"
    line = f"a bug of slambed, {place}: {type(error).__name__}: {error}"
    return f"{line}; set SLAMBED_DEBUG=1 for details", int(ExitCode.INTERNAL)


def refused_write(error: BaseException | None) -> SlambedError | None:
    """Returns the refused write behind an error, or None. It searches the whole chain, because a
    library that closes a half-written file may fail again with another error."""
    while error is not None:
        if isinstance(error, OSError):
            # For a copy, the second name is the target.
            place = error.filename2 or error.filename or _written(error) or "the results"
            if error.errno == errno.ENOSPC:
                return no_space(place)
            if (remedy := REMEDIES.get(error.errno or 0)) is not None:
                line = f"{place}: {error.strerror}; {remedy}, what is finished stays"
                return environment_error(line)
        error = error.__cause__ or error.__context__
    return None


def _written(error: OSError) -> Path | None:
    """Returns the path being written: an OSError of an open file has no name, but the frame of the
    writing Path method does."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        if isinstance(path := frame.f_locals.get("self"), Path):
            return path
    return None
