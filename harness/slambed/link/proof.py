# SPDX-License-Identifier: Apache-2.0
"""Compares asked, applied and measured RTT, and decides whether the link is valid.

An echo sent at run time t should take up(t') + down(t''), where t' = t + the queueing delay on the
way up and t'' likewise on the way down. The path's base is added: its RTT measured on the same link
before the run, without added delay. The error is measured - asked - base. Lost echoes and
echoes that meet an outage (gap) are excluded from the error and counted separately.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, PlainSerializer

from slambed.link.probe import Echoes
from slambed.link.profile import Profile

Values = NDArray[np.float64]
NOT_MEASURED = "no RTT was measured"
Measured = Annotated[
    float,
    BeforeValidator(lambda value: math.nan if value is None else value),
    PlainSerializer(lambda value: value if math.isfinite(value) else None),
]
"""A value that could not be measured is NaN here and null in a file."""


@dataclass(frozen=True)
class LinkTolerance:
    """Tolerances within which a link counts as valid."""

    median_ms: float = 1.0
    """Median of |error|."""
    p99_ms: float | None = None
    answered_share_min: float = 0.8
    """Minimum share of echoes with a reply, relative to the probe's rate; the profile's losses
    are deducted."""


@dataclass(frozen=True)
class LinkProof:
    """How accurately the link followed its profile."""

    valid: bool
    """Whether the link is within the tolerances."""
    reason: str
    """Why the link is not valid, in one line; empty when it is."""
    echoes: int
    """Number of evaluated echoes: sent during the run, early enough to return."""
    answered_share: float
    """Share of echoes with a reply, relative to the probe's rate."""
    base_ms: float
    """RTT of the path before any delay was added."""
    asked_ms_mean: Measured
    """Mean expected RTT of the compared echoes, without the base: that of the profile; over the
    relay also the jitter and the wait for the rate of each echo."""
    measured_ms_mean: Measured
    """Mean measured RTT, including the base."""
    error_ms_median: Measured
    """Median of |measured - asked - base|."""
    error_ms_p99: Measured
    """99th percentile of |measured - asked - base|."""
    error_ms_max: Measured
    """Maximum of |measured - asked - base|."""
    bias_ms: Measured
    """Median of the signed error measured - asked - base."""
    late_ms_median: float | None = None
    """Median delivery time beyond the due time, over all packets; null without a packet log."""
    late_ms_p99: float | None = None
    """99th percentile of the same lateness."""


@dataclass(frozen=True)
class ExtraDelays:
    """Delay of each echo beyond the profile's (rate, jitter, gaps), per direction [ms]; zero if
    unknown."""

    up_ms: Values
    down_ms: Values

    @staticmethod
    def none(count: int) -> "ExtraDelays":
        """Returns zeros."""
        return ExtraDelays(np.zeros(count), np.zeros(count))


def expected_rtt_ms(profile: Profile, sent_s: Values, extra: ExtraDelays) -> Values:
    """Returns the expected RTT of echoes sent at `sent_s`; each way uses the time at which it
    begins."""
    leaves_up_s = sent_s + extra.up_ms / 1e3
    up_ms = profile.up_ms(leaves_up_s)
    turned_s = leaves_up_s + up_ms / 1e3
    leaves_down_s = turned_s + extra.down_ms / 1e3
    total: Values = extra.up_ms + up_ms + extra.down_ms + profile.down_ms(leaves_down_s)
    return total


def touches_gap(profile: Profile, sent_s: Values, rtt_ms: Values) -> NDArray[np.bool_]:
    """Returns which echoes were in flight during a gap (or would have been)."""
    touched = np.zeros(len(sent_s), dtype=bool)
    if not profile.gaps or not len(sent_s):
        return touched
    back_s = sent_s + np.nan_to_num(rtt_ms, nan=0.0) / 1e3
    for gap in profile.gaps:
        for start, end in gap.within(float(sent_s.max()) + 1.0):
            touched |= (back_s >= start) & (sent_s <= end)
    return touched


def dropping_s(profile: Profile, end_s: float) -> float:
    """Returns the total time in which echoes could not return because gaps drop packets in
    flight."""
    if profile.gap_mode != "drop":
        return 0.0
    total_s = 0.0
    for gap in profile.gaps:
        for start, end in gap.within(end_s):
            # Packets sent up to one RTT before the gap are also dropped.
            total_s += min(end, end_s) - max(0.0, start - profile.rtt_ms(start) / 1e3)
    return total_s


@dataclass(frozen=True)
class Comparison:
    """Echoes of one run compared with the profile."""

    sent_s: Values
    """Run times of the evaluated echoes."""
    measured_ms: Values
    """NaN for a lost echo."""
    asked_ms: Values
    usable: NDArray[np.bool_]
    """Echoes with a reply that were not in flight during a gap."""
    error_ms: Values
    """measured - asked - base of the usable echoes."""


def compare(
    profile: Profile, echoes: Echoes, t0_ns: int, end_ns: int, base_ms: float, extra: ExtraDelays
) -> Comparison:
    """Evaluates every echo sent after t0 that could return before the end."""
    sent_s = (echoes.sent_ns - t0_ns) / 1e9
    during = (sent_s >= 0) & (sent_s <= last_chance_s(echoes, t0_ns, end_ns))
    sent_s, measured = sent_s[during], echoes.rtt_ms[during]
    asked = expected_rtt_ms(
        profile, sent_s, ExtraDelays(extra.up_ms[during], extra.down_ms[during])
    )
    usable = np.isfinite(measured) & ~touches_gap(profile, sent_s, measured)
    return Comparison(sent_s, measured, asked, usable, (measured - asked - base_ms)[usable])


def last_chance_s(echoes: Echoes, t0_ns: int, end_ns: int) -> float:
    """Returns the run time after which an echo could not return before the end."""
    longest_ms = float(np.nanmax(echoes.rtt_ms, initial=0.0))
    return (end_ns - t0_ns) / 1e9 - longest_ms / 1e3


def judge(
    profile: Profile,
    echoes: Echoes,
    t0_ns: int,
    end_ns: int,
    base_ms: float,
    rate_hz: float,
    tolerance: LinkTolerance,
    extra: ExtraDelays | None = None,
    late_ms: Values | None = None,
    died: str | None = None,
) -> LinkProof:
    """Returns the verdict over the echoes sent from t0 to the end."""
    extra = extra or ExtraDelays.none(len(echoes))
    seen = compare(profile, echoes, t0_ns, end_ns, base_ms, extra)
    chance_s = last_chance_s(echoes, t0_ns, end_ns)
    due = max(1.0, (chance_s - dropping_s(profile, chance_s)) * rate_hz)
    answered = float(np.isfinite(seen.measured_ms).sum()) / due
    error, size = seen.error_ms, np.abs(seen.error_ms)
    late = late_ms if late_ms is not None and len(late_ms) else None
    median = float(np.median(size)) if len(size) else float("nan")
    p99 = float(np.percentile(size, 99)) if len(size) else float("nan")
    reason = _reason(profile, tolerance, median, p99, min(answered, 1.0), died)
    return LinkProof(
        valid=not reason,
        reason=reason,
        echoes=len(seen.sent_s),
        answered_share=min(answered, 1.0),
        base_ms=base_ms,
        asked_ms_mean=float(seen.asked_ms[seen.usable].mean()) if len(error) else float("nan"),
        measured_ms_mean=float(seen.measured_ms[seen.usable].mean())
        if len(error)
        else float("nan"),
        error_ms_median=median,
        error_ms_p99=p99,
        error_ms_max=float(size.max()) if len(size) else float("nan"),
        bias_ms=float(np.median(error)) if len(error) else float("nan"),
        late_ms_median=None if late is None else float(np.median(late)),
        late_ms_p99=None if late is None else float(np.percentile(late, 99)),
    )


def _reason(
    profile: Profile,
    tolerance: LinkTolerance,
    median: float,
    p99: float,
    answered: float,
    died: str | None,
) -> str:
    if died:
        return f"the link went away: {died}"
    losses = [side.loss.mean() if side.loss else 0.0 for side in (profile.up, profile.down)]
    wanted = tolerance.answered_share_min * (1 - losses[0]) * (1 - losses[1])
    if answered < wanted:
        return f"only {answered:.0%} of the RTT probes came back (at least {wanted:.0%} wanted)"
    if not np.isfinite(median):
        return NOT_MEASURED
    if median > tolerance.median_ms:
        return f"median RTT error {median:.2f} ms is above {tolerance.median_ms:g} ms"
    if tolerance.p99_ms is not None and p99 > tolerance.p99_ms:
        return f"p99 of the RTT error {p99:.2f} ms is above {tolerance.p99_ms:g} ms"
    return ""
