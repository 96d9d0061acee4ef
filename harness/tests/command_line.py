# SPDX-License-Identifier: Apache-2.0
"""The command line in tests: in this process, or in a separate one if that matters."""

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

from slambed.commands.main import run_command


def slambed(*arguments: str, cwd: Path | None = None, **environment: str) -> tuple[int, str, str]:
    """Returns exit code, standard output and standard error of a command, without the seconds
    that a new process takes to import everything."""
    out, err = io.StringIO(), io.StringIO()
    with (
        patch.dict(os.environ, environment),
        patch.object(sys, "argv", ["slambed", *arguments]),
        contextlib.chdir(cwd or Path.cwd()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        code = run_command(list(arguments))
    return int(code), out.getvalue(), err.getvalue()


def slambed_process(
    *arguments: str, cwd: Path | None = None, **environment: str
) -> tuple[int, str, str]:
    """Runs it as a separate process, like users do."""
    done = subprocess.run(
        [sys.executable, "-c", "from slambed.commands.main import main; main()", *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=os.environ | environment,
        check=False,
        timeout=400,
    )
    return done.returncode, done.stdout, done.stderr


def refused(code: int, *arguments: str, cwd: Path | None = None, **environment: str) -> str:
    """Returns the single error line of a refused command."""
    found, _, stderr = slambed(*arguments, cwd=cwd, **environment)
    lines = stderr.strip().splitlines()
    assert found == code, stderr
    assert len(lines) == 1 and lines[0].startswith("error: "), stderr
    return lines[0]
