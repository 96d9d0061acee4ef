# SPDX-License-Identifier: Apache-2.0
"""The sidecar of a run on a board: the usual one for the edge, the agent's samples of the mobile
node, and the clocks of both machines."""

import json
from pathlib import Path

from slambed.engines.base import Node, Sidecar
from slambed.engines.board.connection import BoardConnection
from slambed.engines.board.messages import (
    BoardSample,
    Sampled,
    Sampling,
    StartSampling,
    StopSampling,
)
from slambed.engines.sidecar_messages import Stopped
from slambed.link.clocks import Clocks
from slambed.sampling.cgroup import Usage
from slambed.sampling.record import Sample
from slambed.spec.system import Role

NS_PER_S = 1e9
SAMPLES_S = 120.0
"""Timeout for the samples of a long run, which take megabytes."""


class BoardSidecar:
    """Active from the start barrier of the nodes to their end."""

    def __init__(self, here: Sidecar, connection: BoardConnection, run_dir: Path) -> None:
        """`here`: the sidecar of the edge."""
        self._here = here
        self._connection = connection
        self._samples = run_dir / "samples.jsonl"
        self._t0_ns = 0
        self._seen: Stopped | None = None
        self.clocks: Clocks | None = None
        self.sampler_cpu_percent: float | None = None

    def start(self, t0_ns: int) -> None:
        """Compares the clocks, then starts sampling both nodes."""
        self._t0_ns = t0_ns
        self.clocks = Clocks(t0_ns=t0_ns, before=self._connection.compare_clocks())
        self._here.start(t0_ns)
        self._connection.ask(StartSampling(), Sampling)

    def follow(self, role: Role, node: Node) -> None:
        """Switches to the restarted edge."""
        self._here.follow(role, node)

    def stop(self) -> Stopped:
        """Compares the clocks again, and appends the board's samples to the edge's."""
        if self._seen is None:
            assert self.clocks is not None
            after = self._connection.compare_clocks()
            self.clocks = self.clocks.model_copy(update={"after": after})
            sampled = self._connection.ask(StopSampling(), Sampled, SAMPLES_S)
            self.sampler_cpu_percent = sampled.sampler_cpu_percent
            seen = self._here.stop()
            self._append(sampled.samples, self.clocks)
            usage = dict(seen.usage)
            if sampled.samples:
                usage["mobile"] = _usage(sampled.samples[-1])
            self._seen = seen.model_copy(update={"usage": usage})
        return self._seen

    def close(self) -> None:
        """Closes the edge's sidecar; the agent's sampling ends with the next run or the
        connection."""
        self._here.close()

    def _append(self, samples: list[BoardSample], clocks: Clocks) -> None:
        """Appends samples with their times converted to the run clock."""
        lines, before = [], None
        for sample in samples:
            row = _row(sample, before, (clocks.here_ns(sample.at_ns) - self._t0_ns) / NS_PER_S)
            lines.append(json.dumps(vars(row)) + "\n")
            before = sample
        with self._samples.open("a", encoding="utf-8") as out:
            out.writelines(lines)


def _row(sample: BoardSample, before: BoardSample | None, t_s: float) -> Sample:
    percent: float | None = None
    if before is not None and sample.at_ns > before.at_ns:
        span_s = (sample.at_ns - before.at_ns) / NS_PER_S
        percent = 100 * (sample.cpu_s - before.cpu_s) / span_s
    return Sample(
        t_s=t_s,
        node="mobile",
        cpu_percent=percent,
        **sample.model_dump(exclude={"at_ns", "periods"}),
    )


def _usage(last: BoardSample) -> Usage:
    return Usage(
        cpu_s=last.cpu_s,
        memory_bytes=round(last.memory_mb * 2**20),
        throttled_s=last.throttled_s,
        throttled_periods=last.throttled_periods,
        periods=last.periods,
    )
