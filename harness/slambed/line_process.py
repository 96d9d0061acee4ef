# SPDX-License-Identifier: Apache-2.0
"""A child process that answers lines of JSON: it ends with its standard input, however we die."""

import contextlib
import json
import os
import select
import subprocess
import time
from pathlib import Path
from typing import Any

from slambed.errors import ExitCode, PassingError, SlambedError

STOP_TIMEOUT_S = 10.0


def error_answer(error: SlambedError) -> dict[str, Any]:
    """What a child answers when it fails: a failure that passes stays one."""
    passes = isinstance(error, PassingError)
    return {"error": str(error), "code": int(error.code), "passes": passes}


class LineProcess:
    """One request at a time; an answer `{"error": line, "code": n}` is raised."""

    def __init__(self, command: list[str], name: str, errors: Path) -> None:
        self._name = name
        self._errors = errors
        with errors.open("wb") as log:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                # Ctrl-C reaches the harness alone; it ends its children in its own order.
                start_new_session=True,
            )
        self._buffer = b""

    def ask(self, request: dict[str, Any], timeout_s: float) -> dict[str, Any]:
        """The answer. PassingError when there is none in time, SlambedError when it is an error."""
        self.say(request)
        return self.hear(timeout_s)

    def say(self, request: dict[str, Any]) -> None:
        """Sends a request whose answer is not awaited yet."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            raise self._failure("ended") from None

    def hear(self, timeout_s: float) -> dict[str, Any]:
        """The next answer."""
        assert self._process.stdout is not None
        deadline = time.monotonic() + timeout_s
        while b"\n" not in self._buffer:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self._process.stdout], [], [], left)[0]:
                raise self._failure(f"did not answer within {timeout_s:.0f} s")
            chunk = os.read(self._process.stdout.fileno(), 65536)
            if not chunk:
                raise self._failure("ended")
            self._buffer += chunk
        line, _, self._buffer = self._buffer.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            kind = PassingError if answer.get("passes") else SlambedError
            raise kind(str(answer["error"]), ExitCode(int(answer["code"])))
        return answer

    def alive(self) -> bool:
        """False once it has ended."""
        return self._process.poll() is None

    def close(self) -> None:
        """Ends it; calling it twice is harmless."""
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        try:
            self._process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _failure(self, what: str) -> PassingError:
        lines = self._errors.read_text(errors="replace").strip().splitlines()
        told = f": {lines[-1].removeprefix('error: ')}" if lines else ""
        return PassingError(f"the {self._name} {what}{told}")
