# SPDX-License-Identifier: Apache-2.0
"""The harness side of the segmenter of a live run: a process next to the edge node, started
differently by each engine (docs/explanation/masks.md)."""

import contextlib
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from slambed.engines.base import last_line
from slambed.errors import ExitCode, KilledError, PassingError, SlambedError
from slambed.process.endings import ended_from_outside, ending
from slambed.records.run_config import Segmenter

FOLDER, SOCKET, LOG = "segmenter", "socket", "log.txt"
"""The folder is in the run's folder; it holds the log and the socket."""
MODULE = "slambed.segment.server"
TIME_LIMIT_S = 2.0
"""Time limit per picture: several times what our network needs on a slow core."""
READY_TIMEOUT_S = 60.0
"""Time to load Python, OpenCV and the network from disk under the edge's limits."""
END_TIMEOUT_S = 5.0
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONDONTWRITEBYTECODE": "1",
    "PYTHONPATH": str(Path(__file__).resolve().parents[2]),
}


def config(output: str) -> Segmenter:
    """Returns the configuration for the edge node; `output` is the run's folder as the edge sees
    it."""
    return Segmenter(socket=f"{output}/{FOLDER}/{SOCKET}", time_limit_s=TIME_LIMIT_S)


def make_folder(run_dir: Path) -> Path:
    """Creates the socket's folder. Other users may pass through it but not write."""
    folder = run_dir.resolve() / FOLDER
    folder.mkdir(exist_ok=True)
    folder.chmod(0o711)
    return folder


class SegmenterProcess:
    """Implements SegmenterSidecar."""

    def __init__(
        self, process: subprocess.Popen[bytes], log: Path, clear: Callable[[], None] = lambda: None
    ) -> None:
        """`clear`: removes leftovers that do not end with the process."""
        self._process = process
        self._log = log
        self._clear = clear
        self._output = b""

    def await_ready(self, stopped: Callable[[], bool]) -> None:
        """Waits for its `ready` line."""
        deadline = time.monotonic() + READY_TIMEOUT_S
        while not stopped():
            if b"ready\n" in self._output:
                return
            if not self._read(0.05):
                raise self._refused()
            if time.monotonic() > deadline:
                raise PassingError(f"the segmenter was not ready within {READY_TIMEOUT_S:.0f} s")

    def ended(self) -> str | None:
        """For a container, this is the end of its docker client process."""
        code = self._process.poll()
        return None if code is None else ending(code)

    def is_ready(self) -> bool:
        """Checks for its `ready` line without waiting."""
        if b"ready\n" not in self._output:
            self._read(0.0)
        return b"ready\n" in self._output

    def _read(self, patience_s: float) -> bool:
        """Reads output; returns False at its end."""
        assert self._process.stdout is not None
        if not select.select([self._process.stdout], [], [], patience_s)[0]:
            return True
        piece = os.read(self._process.stdout.fileno(), 4096)
        self._output += piece
        return bool(piece)

    def _refused(self) -> SlambedError:
        code = self._process.wait(END_TIMEOUT_S)
        line = "the segmenter ended before it was ready"
        if ended_from_outside(code):
            return KilledError(f"{line}: it was killed ({ending(code)})")
        last_words = last_line(self._log).removeprefix("error: ")
        known = code in (ExitCode.BAD_INPUT, ExitCode.ENVIRONMENT)
        return SlambedError(
            f"{line}: {last_words}", ExitCode(code) if known else ExitCode.ENVIRONMENT
        )

    def close(self) -> float | None:
        """Ends it with SIGTERM, then SIGKILL."""
        if self._process.stdout is None or self._process.stdout.closed:
            return None
        if self._process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + END_TIMEOUT_S
        while time.monotonic() < deadline and self._read(0.05):
            pass
        if self._process.poll() is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(max(0.0, deadline - time.monotonic()))
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._clear()
        cpu_lines = [
            line for line in self._output.decode().splitlines() if line.startswith("cpu_s ")
        ]
        return float(cpu_lines[-1].split()[1]) if cpu_lines else None


def command(socket: str, network: str, *options: str) -> list[str]:
    """Returns the command of the segmenter."""
    # It runs in another working directory.
    named = str(Path(network).resolve()) if network.endswith(".yaml") else network
    return [sys.executable, "-m", MODULE, socket, named, *options]
