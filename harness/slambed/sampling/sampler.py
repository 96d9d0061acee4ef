# SPDX-License-Identifier: Apache-2.0
"""Samples the control groups of the nodes at a fixed rate, on the run clock."""

import json
import threading
import time
from pathlib import Path
from typing import TextIO

from slambed.sampling.cgroup import CgroupReader, Usage

SAMPLES_PER_S = 10.0
NS_PER_S = 1_000_000_000


class Sampler:
    """Writes `samples.jsonl` (docs/formats.md) from `start` to `stop`."""

    def __init__(self, readers: dict[str, CgroupReader], path: Path) -> None:
        self._readers = readers
        self._path = path
        self._last: dict[str, tuple[int, Usage]] = {}
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, t0_ns: int) -> None:
        """Begins to sample; run time = CLOCK_MONOTONIC - t0_ns."""
        self._thread = threading.Thread(
            target=self._run, args=(t0_ns,), name="sampler", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Ends after one last sample; calling it twice is harmless."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def last(self) -> dict[str, Usage]:
        """The newest counters of each node."""
        return {node: usage for node, (_, usage) in self._last.items()}

    def _run(self, t0_ns: int) -> None:
        step_ns = int(NS_PER_S / SAMPLES_PER_S)
        due_ns = time.monotonic_ns()
        with self._path.open("w", encoding="utf-8") as out:
            while True:
                last = self._stop.is_set()
                for node, reader in self._readers.items():
                    self._sample(node, reader, t0_ns, out)
                if last:
                    return
                # A late sample does not pull the following ones closer together.
                due_ns = max(due_ns + step_ns, time.monotonic_ns())
                self._stop.wait((due_ns - time.monotonic_ns()) / NS_PER_S)

    def _sample(self, node: str, reader: CgroupReader, t0_ns: int, out: TextIO) -> None:
        try:
            now_ns = time.monotonic_ns()
            usage = reader.usage()
        except OSError:
            return  # The node ended and its group went with it.
        before = self._last.get(node)
        percent: float | None = None
        if before is not None and now_ns > before[0]:
            percent = 100 * (usage.cpu_s - before[1].cpu_s) / ((now_ns - before[0]) / NS_PER_S)
        self._last[node] = (now_ns, usage)
        row = {
            "t_s": (now_ns - t0_ns) / NS_PER_S,
            "node": node,
            "cpu_s": usage.cpu_s,
            "cpu_percent": percent,
            "memory_mb": usage.memory_bytes / 2**20,
            "throttled_s": usage.throttled_s,
            "throttled_periods": usage.throttled_periods,
        }
        out.write(json.dumps(row) + "\n")
