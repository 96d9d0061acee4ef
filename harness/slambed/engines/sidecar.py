# SPDX-License-Identifier: Apache-2.0
"""The sidecar of the nodes of a run: caps their threads, samples them, runs the metronome.

Run as `python -m slambed.engines.sidecar`. It answers the messages of `sidecar_messages`, one per
line, and ends with its input.
"""

import contextlib
import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TextIO

from slambed.engines.sidecar_messages import (
    FIRST,
    REQUESTS,
    TICKING,
    Follow,
    Following,
    MonitoredNode,
    OpenSidecar,
    SidecarOpened,
    Stopped,
)
from slambed.engines.thread_caps import ThreadCaps
from slambed.errors import environment_error
from slambed.process.cpus import own_cpus
from slambed.process.line_protocol import LineReader, Start, Started, last_answer, message_in, send
from slambed.sampling.cgroup import CgroupReader, GroupProcesses, paths_of
from slambed.sampling.cpu_group import leave_cpu_group
from slambed.sampling.record import SidecarUse, ThreadCap
from slambed.sampling.sampler import NodeWatch, Sampler
from slambed.sampling.tasks import Pressure, RunQueueDelay
from slambed.sampling.tcp_info import TcpWatch

SAMPLES_PER_S = 10.0
SCAN_BEFORE_START_S = 0.005
"""Scan period while nodes start: a new thread must not run uncapped for long."""
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
        with contextlib.suppress(EOFError):
            line = LineReader(self._process.stdout.fileno()).next(METRONOME_TIMEOUT_S)
            if line is not None:
                self.real_time = message_in(line, TICKING, "metronome").real_time

    def stop(self) -> float:
        """Ends it; returns its CPU time."""
        if self._process is None:
            return 0.0
        process, self._process = self._process, None
        assert process.stdin is not None and process.stdout is not None
        process.stdin.close()
        process.wait()
        process.stdout.close()
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime


class SidecarServer:
    """Caps and samples the running nodes."""

    def __init__(self, asked: OpenSidecar, out: TextIO) -> None:
        if asked.cpus:
            os.sched_setaffinity(0, asked.cpus)
        self._caps: dict[str, ThreadCaps] = {}
        self._whole_groups = asked.whole_groups
        self._watches = [self._watch(name, node) for name, node in asked.nodes.items()]
        self._sampler = Sampler(self._watches, out)
        self._metronome = Metronome(asked.pace, asked.metronome_cpus)
        self._began_s = time.monotonic()
        self._t0_ns: int | None = None
        self._started: tuple[float, float] | None = None

    def _watch(self, name: str, node: MonitoredNode) -> NodeWatch:
        paths = paths_of(node.pid)
        group = GroupProcesses(paths) if self._whole_groups else None
        watch = NodeWatch(
            name, CgroupReader(paths), RunQueueDelay(node.pid, group), Pressure(paths.unified)
        )
        if node.namespace is not None:
            watch.tcp = TcpWatch(Path(node.namespace))
        if node.thread_cores is not None:
            caps = ThreadCaps(node.pid, paths, node.thread_cores, node.period_ms, group=group)
            self._caps[name] = caps
            watch.below = caps.read_throttling
        return watch

    def serve(self, requests: LineReader, answers: TextIO) -> None:
        """Serves requests until the input ends or a stop request arrives."""
        send(answers, SidecarOpened(real_time_metronome=self._metronome.real_time))
        next_sample_s = time.monotonic()
        with contextlib.suppress(EOFError):
            while True:
                self._scan()
                now_s = time.monotonic()
                if self._t0_ns is not None and now_s >= next_sample_s:
                    self._sampler.sample(self._t0_ns)
                    # After a late sample the following ones keep their distance.
                    next_sample_s = max(next_sample_s + 1 / SAMPLES_PER_S, now_s)
                wait_s = SCAN_BEFORE_START_S
                if self._t0_ns is not None:
                    # From now on each sample also scans for threads: one wake-up for both.
                    wait_s = max(0.0, next_sample_s - time.monotonic())
                if (line := requests.next(wait_s)) is None:
                    continue
                request = message_in(line, REQUESTS, "harness")
                if isinstance(request, Start):
                    self._start(request.t0_ns)
                    next_sample_s = time.monotonic()
                    send(answers, Started())
                elif isinstance(request, Follow):
                    self._follow(request.node, request.pid)
                    send(answers, Following())
                else:
                    send(answers, self._finish())
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
        """A restarted node has other threads, and perhaps another cgroup."""
        for watch in self._watches:
            if watch.name == name:
                watch.follow(pid)
        if (caps := self._caps.get(name)) is not None:
            caps.pid = pid
            caps.scan()
            caps.read_names()

    def _finish(self) -> Stopped:
        percent: float | None = None
        if self._started is not None and self._t0_ns is not None:
            self._sampler.sample(self._t0_ns)
            wall_s = time.monotonic() - self._started[0]
            percent = 100 * (time.process_time() - self._started[1]) / wall_s
        used_s = self._metronome.stop()
        own = SidecarUse(
            samples=self._sampler.samples,
            sampler_cpu_percent=percent,
            cpus=own_cpus(),
            metronome_cpu_percent=100 * used_s / (time.monotonic() - self._began_s),
            metronome_real_time=self._metronome.real_time,
        )
        return Stopped(usage=self._sampler.last(), threads=self._threads(), own=own)

    def _threads(self) -> dict[str, list[ThreadCap]]:
        """Returns the granted caps, in the order of the threads' start."""
        return {
            name: [
                ThreadCap(
                    name=thread.name,
                    cores=thread.cores,
                    period_ms=thread.period_ms,
                    throttled_s=thread.throttled_s,
                    throttled_periods=thread.throttled_periods,
                )
                for _, thread in sorted(caps.threads.items())
            ]
            for name, caps in self._caps.items()
        }

    def close(self) -> None:
        """Removes all cgroups and processes."""
        self._metronome.stop()
        for caps in self._caps.values():
            caps.release()
        for watch in self._watches:
            watch.reader.close()
            watch.run_queue.close()
            watch.pressure.close()
            if watch.tcp is not None:
                watch.tcp.close()


def main() -> None:
    """Runs the sidecar; an error becomes its last answer."""
    requests = LineReader(sys.stdin.fileno())
    with last_answer(partial(send, sys.stdout)), _what_cannot_be_monitored():
        first = requests.next(None)
        assert first is not None
        asked = message_in(first, FIRST, "harness")
        with Path(asked.samples).open("w", encoding="utf-8", buffering=1 << 16) as out:
            if asked.helper:
                leave_cpu_group()
            sidecar = SidecarServer(asked, out)
            try:
                sidecar.serve(requests, sys.stdout)
            finally:
                sidecar.close()


@contextlib.contextmanager
def _what_cannot_be_monitored() -> Iterator[None]:
    """A file of the kernel or of the samples that refuses is a failure of the machine."""
    try:
        yield
    except OSError as error:
        line = f"cannot monitor the nodes: {error.strerror}, {error.filename or 'sampler'}"
        raise environment_error(line) from None


if __name__ == "__main__":
    main()
