# SPDX-License-Identifier: Apache-2.0
"""A pool of worker processes that make virtual runs: one line of JSON each way per run.

A run is a subprocess anyway, but reading its log and computing its metrics takes Python as long:
threads alone would wait for each other.
"""

import json
import queue
import select
import shutil
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from slambed.campaign.makers import Played
from slambed.engines.result import InterruptedRunError
from slambed.engines.virtual import die_with_parent
from slambed.errors import ExitCode, SlambedError
from slambed.spec.matrix import RunSpec

LOOK_EVERY_S = 0.1
STOP_TIMEOUT_S = 10.0
ATTEMPTS = 2
"""A worker may be killed by somebody else (memory, an administrator): once is not our bug."""


class WorkerDiedError(Exception):
    """The process ended without an answer."""


class Worker:
    """One `python -m slambed.campaign.worker`."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "slambed.campaign.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C reaches the harness alone; and nothing outlives it.
            start_new_session=True,
            preexec_fn=die_with_parent,
        )

    def ask(self, task: dict[str, Any], stop: threading.Event) -> dict[str, Any]:
        """The worker's answer."""
        assert self.process.stdin is not None and self.process.stdout is not None
        try:
            self.process.stdin.write(json.dumps(task).encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            raise WorkerDiedError from None
        while not select.select([self.process.stdout], [], [], LOOK_EVERY_S)[0]:
            if stop.is_set():
                raise InterruptedRunError
        line = self.process.stdout.readline()
        if not line.endswith(b"\n"):
            raise WorkerDiedError
        answer: dict[str, Any] = json.loads(line)
        return answer

    def end(self) -> None:
        """SIGTERM: it ends its run at once."""
        self.process.terminate()
        try:
            self.process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None and not stream.closed:
                stream.close()


@dataclass
class WorkerPool:
    """Makes virtual runs in `jobs` processes of this host."""

    played: Played
    program: Path
    features: Path | None
    jobs: int
    _idle: "queue.SimpleQueue[Worker]" = field(default_factory=queue.SimpleQueue)

    def make(self, spec: RunSpec, raw: Path, stop: threading.Event) -> dict[str, Any]:
        """Hands the run to an idle worker and waits for it."""
        sequence, played_s = self.played[spec.dataset]
        task = {
            "spec": spec.model_dump(mode="json"),
            "raw": str(raw.resolve()),
            "sequence": str(sequence.resolve()),
            "played_s": played_s,
            "program": str(self.program.resolve()),
            "features": str(self.features.resolve()) if self.features else None,
            "command": sys.argv,
        }
        for _ in range(ATTEMPTS):
            worker = self._take()
            try:
                answer = worker.ask(task, stop)
            except WorkerDiedError:
                worker.end()
                _empty(raw)
                continue
            except BaseException:
                worker.end()
                raise
            self._idle.put(worker)
            if (error := answer.get("error")) is not None:
                raise SlambedError(error, ExitCode(answer["code"]))
            summary: dict[str, Any] = answer["summary"]
            return summary
        raise SlambedError(
            f"a worker process died twice in run {spec.run_key}; is there enough memory?",
            ExitCode.ENVIRONMENT,
        )

    def close(self) -> None:
        """Ends the workers."""
        while True:
            try:
                self._idle.get_nowait().end()
            except queue.Empty:
                return

    def _take(self) -> Worker:
        try:
            return self._idle.get_nowait()
        except queue.Empty:
            return Worker()


def _empty(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
