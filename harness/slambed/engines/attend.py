# SPDX-License-Identifier: Apache-2.0
"""The process beside the nodes of a run: caps their threads, samples them, keeps the metronome.

Run as `python -m slambed.engines.attend`. It reads lines of JSON: first what to attend to, then
`{"start": t0_ns}`, `{"follow": node, "pid": n}` and `{"stop": true}`, and answers each with a line.
It ends with its input.
"""

import contextlib
import json
import os
import resource
import select
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from slambed.engines.cpu_group import leave_cpu_group
from slambed.engines.thread_caps import ThreadCaps
from slambed.errors import ExitCode, SlambedError
from slambed.line_process import error_answer
from slambed.sampling.cgroup import CgroupReader, GroupProcesses, paths_of
from slambed.sampling.sampler import NodeWatch, Sampler
from slambed.sampling.tasks import Pressure, RunQueueDelay
from slambed.sampling.tcp_info import TcpWatch

SAMPLES_PER_S = 10.0
SCAN_BEFORE_START_S = 0.005
"""Threads appear while a node starts; none shall run free for long."""
METRONOME_TIMEOUT_S = 5.0


class Metronome:
    """A running `slambed-pace tick`; does nothing without CPUs."""

    def __init__(self, program: str | None, cpus: list[int]) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.real_time: bool | None = None
        if program is None or not cpus:
            return
        self._process = subprocess.Popen(
            [program, "tick", "--cpus", ",".join(map(str, cpus))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._process.stdout is not None
        if select.select([self._process.stdout], [], [], METRONOME_TIMEOUT_S)[0]:
            with contextlib.suppress(ValueError):
                self.real_time = json.loads(self._process.stdout.readline())["real_time"]

    def stop(self) -> float:
        """Ends it; returns the CPU time it took."""
        if self._process is None:
            return 0.0
        process, self._process = self._process, None
        assert process.stdin is not None and process.stdout is not None
        process.stdin.close()
        process.wait()
        process.stdout.close()
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime


class Attendant:
    """Everything that is done beside the nodes while they run."""

    def __init__(self, config: dict[str, Any], out: TextIO) -> None:
        if config["cpus"]:
            os.sched_setaffinity(0, config["cpus"])
        self._caps: dict[str, ThreadCaps] = {}
        self._whole_groups = bool(config["whole_groups"])
        self._watches = [self._watch(name, node) for name, node in config["nodes"].items()]
        self._sampler = Sampler(self._watches, out)
        self._metronome = Metronome(config["pace"], config["metronome_cpus"])
        self._began_s = time.monotonic()
        self._t0_ns: int | None = None
        self._started: tuple[float, float] | None = None

    def _watch(self, name: str, node: dict[str, Any]) -> NodeWatch:
        paths = paths_of(node["pid"])
        group = GroupProcesses(paths) if self._whole_groups else None
        watch = NodeWatch(
            name, CgroupReader(paths), RunQueueDelay(node["pid"], group), Pressure(paths.unified)
        )
        if node["namespace"] is not None:
            watch.tcp = TcpWatch(Path(node["namespace"]))
        if node["thread_cores"] is not None:
            caps = ThreadCaps(
                node["pid"], paths, node["thread_cores"], node["period_ms"], group=group
            )
            self._caps[name] = caps
            watch.below = caps.read_throttling
        return watch

    def serve(self, commands: int, answers: TextIO) -> None:
        """Until the input ends or says stop."""
        _tell(answers, {"ready": True, "real_time_metronome": self._metronome.real_time})
        buffer = b""
        next_sample_s = time.monotonic()
        while True:
            self._scan()
            now_s = time.monotonic()
            if self._t0_ns is not None and now_s >= next_sample_s:
                self._sampler.sample(self._t0_ns)
                # A late sample does not pull the following ones closer together.
                next_sample_s = max(next_sample_s + 1 / SAMPLES_PER_S, now_s)
            wait_s = SCAN_BEFORE_START_S
            if self._t0_ns is not None:
                # From now on threads are looked for with each sample: one wake-up for both.
                wait_s = max(0.0, next_sample_s - time.monotonic())
            if not select.select([commands], [], [], wait_s)[0]:
                continue
            chunk = os.read(commands, 65536)
            buffer += chunk
            while b"\n" in buffer:
                line, _, buffer = buffer.partition(b"\n")
                request = json.loads(line)
                if "start" in request:
                    self._start(int(request["start"]))
                    next_sample_s = time.monotonic()
                    _tell(answers, {"started": True, "threads": self._threads()})
                if "follow" in request:
                    self._follow(request["follow"], int(request["pid"]))
                    _tell(answers, {"following": True})
                if "stop" in request:
                    _tell(answers, self._finish())
                    return
            if not chunk:
                return

    def _scan(self) -> None:
        for caps in self._caps.values():
            caps.scan()

    def _start(self, t0_ns: int) -> None:
        for caps in self._caps.values():
            caps.read_names()
        self._t0_ns = t0_ns
        self._started = (time.monotonic(), time.process_time())

    def _follow(self, name: str, pid: int) -> None:
        """A node was started again: other threads, perhaps another group."""
        for watch in self._watches:
            if watch.name == name:
                watch.follow(pid)
        if (caps := self._caps.get(name)) is not None:
            caps.pid = pid
            caps.scan()
            caps.read_names()

    def _finish(self) -> dict[str, Any]:
        own: dict[str, Any] = {"samples": self._sampler.samples}
        if self._started is not None and self._t0_ns is not None:
            self._sampler.sample(self._t0_ns)
            wall_s = time.monotonic() - self._started[0]
            own["sampler_cpu_percent"] = 100 * (time.process_time() - self._started[1]) / wall_s
        own["cpus"] = sorted(os.sched_getaffinity(0))
        used_s = self._metronome.stop()
        own["metronome_cpu_percent"] = 100 * used_s / (time.monotonic() - self._began_s)
        own["metronome_real_time"] = self._metronome.real_time
        usage = {name: asdict(last) for name, last in self._sampler.last().items()}
        threads = self._threads()
        return {"stopped": True, "usage": usage, "threads": threads, "own": own}

    def _threads(self) -> dict[str, Any]:
        """What each thread was granted, in the order in which the threads began."""
        return {
            name: [
                {
                    "name": thread.name,
                    "cores": thread.cores,
                    "period_ms": thread.period_ms,
                    "throttled_s": thread.throttled_s,
                    "throttled_periods": thread.throttled_periods,
                }
                for _, thread in sorted(caps.threads.items())
            ]
            for name, caps in self._caps.items()
        }

    def close(self) -> None:
        """Leaves no group and no process behind."""
        self._metronome.stop()
        for caps in self._caps.values():
            caps.release()
        for watch in self._watches:
            watch.reader.close()
            watch.run_queue.close()
            watch.pressure.close()
            if watch.tcp is not None:
                watch.tcp.close()


def _tell(answers: TextIO, answer: dict[str, Any]) -> None:
    print(json.dumps(answer), file=answers, flush=True)


def main() -> None:
    """Errors become one answer."""
    # Unbuffered: what follows the first line is for select() to see.
    with open(sys.stdin.fileno(), "rb", buffering=0, closefd=False) as commands:
        config = json.loads(commands.readline())
    try:
        with Path(config["samples"]).open("w", encoding="utf-8", buffering=1 << 16) as out:
            if config["helper"]:
                leave_cpu_group()
            attendant = Attendant(config, out)
            try:
                attendant.serve(sys.stdin.fileno(), sys.stdout)
            finally:
                attendant.close()
    except SlambedError as error:
        _tell(sys.stdout, error_answer(error))
    except OSError as error:
        told = f"{error.strerror}, {error.filename or 'sampler'}"
        _tell(sys.stdout, {"error": f"cannot attend to the nodes: {told}", "code": 3})
        sys.exit(ExitCode.ENVIRONMENT)


if __name__ == "__main__":
    main()
