# SPDX-License-Identifier: Apache-2.0
"""Loss and jitter statistics of real packets compared with the profile, in standard errors."""

import math
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slambed.errors import ExitCode, SlambedError
from slambed.link.backend import open_link
from slambed.link.packets import PACKET_LOG, UDP, read_packets
from slambed.link.profile import parse_profile
from slambed.link.scratch import two_namespaces
from slambed.link.session import EDGE_ADDRESS
from slambed.link.traffic import one_way

Values = NDArray[np.float64]

BACKEND = "relay"
"""Backend netem is excluded: its loss and jitter are not reproducible."""
LOSS_HZ = 1000.0
JITTER_HZ = 100.0
"""Spacing at which packets almost never wait behind a late predecessor."""
ONE_WAY_MS = 20.0
"""Large enough that negative jitter does not clip the delay at 0."""
LIMIT = 3.0
"""In standard errors; by chance one seed in thirty has one of the eleven figures outside."""
HELD_UP_MS = 1.0
"""A packet delivered this much later than the relay intended was delayed by the host."""
MOST_HELD_UP = 0.02

SHARE, TO_BAD, TO_GOOD = 0.02, 0.01, 0.25
SD_MS, CORRELATION = 1.0, 0.8
PARETO_MEAN_MS, PARETO_TAIL = 1.0, 5.0


@dataclass(frozen=True)
class Figure:
    """One property of a sample."""

    name: str
    asked: float
    found: float
    error: float
    """Standard error of a sample of that size."""

    @property
    def sigmas(self) -> float:
        """Returns the distance from the commanded value in standard errors."""
        return (self.found - self.asked) / self.error


Judge = Callable[[Values], list[Figure]]


@dataclass(frozen=True)
class Case:
    """An impairment, its packet rate, and the check of its statistics."""

    name: str
    impairment: dict[str, Any]
    rate_hz: float
    judge: Judge


@dataclass(frozen=True)
class Found:
    """Result of a case."""

    case: str
    packets: int
    held_up: int
    """Packets excluded from the jitter figures because the host delivered them late."""
    figures: list[Figure]
    repeated: bool | None
    """For losses: whether the same seed lost the same packets again."""

    @property
    def good(self) -> bool:
        """Whether all figures are within the limit, repeatable, and measured on a host that was
        not overloaded."""
        within = all(abs(figure.sigmas) <= LIMIT for figure in self.figures)
        calm = self.held_up <= MOST_HELD_UP * self.packets
        return within and calm and self.repeated is not False


def random_loss(extra_ms: Values) -> list[Figure]:
    """Evaluates extra delays, NaN where a packet was lost."""
    lost = np.isnan(extra_ms)
    error = math.sqrt(SHARE * (1 - SHARE) / len(lost))
    return [Figure("share lost", SHARE, float(lost.mean()), error)]


def bursty_loss(extra_ms: Values) -> list[Figure]:
    """Two-state chain: share of lost packets and mean burst length."""
    lost = np.isnan(extra_ms)
    share = TO_BAD / (TO_BAD + TO_GOOD)
    memory = 1 - TO_BAD - TO_GOOD
    error = math.sqrt(share * (1 - share) / len(lost) * (1 + memory) / (1 - memory))
    bursts = int(lost[0]) + int(np.count_nonzero(lost[1:] & ~lost[:-1]))
    length = float(lost.sum()) / max(bursts, 1)
    # Standard deviation of the mean of geometric burst lengths.
    spread = math.sqrt(1 - TO_GOOD) / TO_GOOD / math.sqrt(max(bursts, 1))
    return [
        Figure("share lost", share, float(lost.mean()), error),
        Figure("burst length", 1 / TO_GOOD, length, spread),
    ]


def normal_jitter(correlation: float) -> Judge:
    """Mean, standard deviation and lag-1 correlation; correlated values count as fewer samples."""

    def judge(extra_ms: Values) -> list[Figure]:
        values = extra_ms[np.isfinite(extra_ms)]
        count, r = len(values), correlation
        for_mean = count * (1 - r) / (1 + r)
        for_deviation = count * (1 - r * r) / (1 + r * r)
        error_of_deviation = SD_MS / math.sqrt(2 * for_deviation)
        lag1 = float(np.corrcoef(values[:-1], values[1:])[0, 1])
        return [
            Figure("mean ms", 0.0, float(values.mean()), SD_MS / math.sqrt(for_mean)),
            Figure("deviation ms", SD_MS, float(values.std()), error_of_deviation),
            Figure("correlation", r, lag1, math.sqrt((1 - r * r) / count)),
        ]

    return judge


def pareto_jitter(extra_ms: Values) -> list[Figure]:
    """Lomax distribution: mean and median; the standard deviation of a heavy tail converges too
    slowly."""
    values = extra_ms[np.isfinite(extra_ms)]
    a, root = PARETO_TAIL, math.sqrt(len(values))
    scale = PARETO_MEAN_MS * (a - 1)
    median = scale * (2 ** (1 / a) - 1)
    density = a / scale * (1 + median / scale) ** -(a + 1)
    deviation = PARETO_MEAN_MS * math.sqrt(a / (a - 2))
    return [
        Figure("mean ms", PARETO_MEAN_MS, float(values.mean()), deviation / root),
        Figure("median ms", median, float(np.median(values)), 1 / (2 * density * root)),
    ]


CASES = (
    Case("random loss", {"loss": {"random": SHARE}}, LOSS_HZ, random_loss),
    Case(
        "Gilbert-Elliott loss",
        {"loss": {"gilbert_elliott": {"to_bad": TO_BAD, "to_good": TO_GOOD}}},
        LOSS_HZ,
        bursty_loss,
    ),
    Case("normal jitter", {"jitter": {"sd_ms": SD_MS}}, JITTER_HZ, normal_jitter(0.0)),
    Case(
        "correlated jitter",
        {"jitter": {"sd_ms": SD_MS, "correlation": CORRELATION}},
        JITTER_HZ,
        normal_jitter(CORRELATION),
    ),
    Case(
        "Pareto jitter",
        {"jitter": {"shape": "pareto", "mean_ms": PARETO_MEAN_MS, "tail": PARETO_TAIL}},
        JITTER_HZ,
        pareto_jitter,
    ),
)


def check(case: Case, seconds: float, seed: int) -> Found:
    """Sends the packets of a case; for losses twice with the same seed."""
    extra_ms, held_up = _send(case, seconds, seed)
    if "loss" not in case.impairment:
        figures = case.judge(extra_ms[~held_up])
        return Found(case.name, len(extra_ms), int(held_up.sum()), figures, None)
    again, _ = _send(case, seconds, seed)
    repeated = bool(np.array_equal(np.isnan(extra_ms), np.isnan(again)))
    return Found(case.name, len(extra_ms), 0, case.judge(extra_ms), repeated)


def _send(case: Case, seconds: float, seed: int) -> tuple[Values, NDArray[np.bool_]]:
    """Returns each packet's delay beyond profile and base from kernel timestamps, NaN when lost,
    and which packets the host delivered late."""
    asked = {"name": "statistics", "rtt_ms": 2 * ONE_WAY_MS, "up": case.impairment}
    with ExitStack() as stack:
        log_dir = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        mobile, edge = stack.enter_context(two_namespaces())
        profile = parse_profile(asked, "statistics")
        link = stack.enter_context(
            open_link(BACKEND, mobile, edge, profile, seed, log_dir, probe_hz=0)
        )
        link.start(time.monotonic_ns())
        samples = one_way(mobile, edge, EDGE_ADDRESS, case.rate_hz, seconds)
        link.stop()
        packets = read_packets(log_dir / PACKET_LOG)
    took_ms = samples.delay_ms - link.base_ms / 2
    # In sending order, including lost packets.
    own = packets[(packets["direction"] == 0) & (packets["protocol"] == UDP)]
    meant_ms = (own["due_ns"] - own["in_ns"]).to_numpy() / 1e6
    if len(meant_ms) != len(took_ms):
        raise SlambedError(
            f"{len(took_ms)} packets were sent and {len(meant_ms)} came to the relay",
            ExitCode.NOT_ALL_GOOD,
        )
    held_up = took_ms - meant_ms > HELD_UP_MS
    return np.asarray(took_ms - ONE_WAY_MS, dtype=np.float64), held_up
