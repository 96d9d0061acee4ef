# SPDX-License-Identifier: Apache-2.0
"""What a command says of whatever ended it: one line and a documented exit code."""

import errno
import os
import traceback
from pathlib import Path

import typer

from slambed.errors import ExitCode, SlambedError, no_space

INTERRUPTED = 130
"""128 + SIGINT, as shells have it."""


def line_and_code(error: BaseException) -> tuple[str, int]:
    """Without its `error: `; with SLAMBED_DEBUG what is no known failure leaves its traceback."""
    if isinstance(error, SlambedError):
        return str(error), int(error.code)
    if isinstance(error, KeyboardInterrupt | typer.Abort):
        return "interrupted", INTERRUPTED
    if isinstance(error, typer.TyperException):
        told = error.format_message() or "a subcommand is missing"
        stop = "" if told.endswith((".", "?")) else "."
        return f"{told}{stop} See 'slambed --help'", int(ExitCode.BAD_INPUT)
    if (full := _full_disk(error)) is not None:
        refused = no_space(full.filename or "the results")
        return str(refused), int(refused.code)
    if isinstance(error, PermissionError):
        # Whoever owns it: a file that we may not touch is no bug of ours.
        line = f"{error.filename}: {error.strerror}; change its rights, or be who may"
        return line, int(ExitCode.ENVIRONMENT)
    if os.environ.get("SLAMBED_DEBUG"):
        traceback.print_exception(error)
    where = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{Path(where.filename).name}:{where.lineno}"
    line = f"a bug of slambed, {place}: {type(error).__name__}: {error}"
    return f"{line}; set SLAMBED_DEBUG=1 for details", int(ExitCode.INTERNAL)


def _full_disk(error: BaseException | None) -> OSError | None:
    """The refusal of a full disk behind an error; a library that closes its half-written file may
    fail once more over it, in another way."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return error
        error = error.__cause__ or error.__context__
    return None
