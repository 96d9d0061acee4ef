# SPDX-License-Identifier: Apache-2.0
"""Asked against applied against measured RTT, and one verdict.

An echo sent at run time t should take up(t') + down(t''), with t' = t + what it waited for the rate
on its way up and t'' likewise on its way down, plus the path's base: its RTT measured on the same
link, before the run, while the link adds nothing. The error is measured - asked - base; echoes
whose way touches an outage (gap) and lost ones are left out of the error and counted apart.
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
Measured = Annotated[
    float,
    BeforeValidator(lambda value: math.nan if value is None else value),
    PlainSerializer(lambda value: value if math.isfinite(value) else None),
]
"""A number that could not be measured is NaN here, and null in a file."""


@dataclass(frozen=True)
class LinkTolerance:
    """When a link counts as the one that was asked for."""

    median_ms: float = 1.0
    """Of |error|."""
    p99_ms: float | None = None
    answered_share_min: float = 0.8
    """Echoes with an answer, of those due by the probe's rate (asked losses allowed for)."""


@dataclass(frozen=True)
class LinkProof:
    """How well the link did what was asked."""

    valid: bool
    """Whether it is within the tolerances."""
    reason: str
    """Why not valid, in one line; empty when it is."""
    echoes: int
    """That count: sent during the run, early enough to come back."""
    answered_share: float
    """Of those due by the probe's rate."""
    base_ms: float
    """RTT of the path before anything was added to it."""
    asked_ms_mean: Measured
    """Of the profile, where it was measured."""
    measured_ms_mean: Measured
    """Base included."""
    error_ms_median: Measured
    """Of |measured - asked - base|."""
    error_ms_p99: Measured
    """Its 99th percentile."""
    error_ms_max: Measured
    """The largest one."""
    bias_ms: Measured
    """Median of measured - asked - base, with its sign."""
    late_ms_median: float | None = None
    """Applied against asked, all packets: time beyond due; null without a packet log."""
    late_ms_p99: float | None = None
    """Its 99th percentile."""


@dataclass(frozen=True)
class ExtraDelays:
    """What the model added to the profile's delay of each echo (rate, jitter, gaps), one way each
    [ms]; zeros where unknown."""

    up_ms: Values
    down_ms: Values

    @staticmethod
    def none(count: int) -> "ExtraDelays":
        """Nothing but the profile's delay."""
        return ExtraDelays(np.zeros(count), np.zeros(count))


def expected_rtt_ms(profile: Profile, sent_s: Values, extra: ExtraDelays) -> Values:
    """RTT of an echo sent at `sent_s` run time: each way at the time it really begins."""
    leaves_up_s = sent_s + extra.up_ms / 1e3
    up_ms = profile.up_ms(leaves_up_s)
    turned_s = leaves_up_s + up_ms / 1e3
    leaves_down_s = turned_s + extra.down_ms / 1e3
    total: Values = extra.up_ms + up_ms + extra.down_ms + profile.down_ms(leaves_down_s)
    return total


def touches_gap(profile: Profile, sent_s: Values, rtt_ms: Values) -> NDArray[np.bool_]:
    """Echoes under way during a gap (or that would have been)."""
    touched = np.zeros(len(sent_s), dtype=bool)
    if not profile.gaps or not len(sent_s):
        return touched
    back_s = sent_s + np.nan_to_num(rtt_ms, nan=0.0) / 1e3
    for gap in profile.gaps:
        for start, end in gap.within(float(sent_s.max()) + 1.0):
            touched |= (back_s >= start) & (sent_s <= end)
    return touched


def dropping_s(profile: Profile, end_s: float) -> float:
    """How long nothing could come back because a gap drops what is under way."""
    if profile.gap_mode != "drop":
        return 0.0
    total_s = 0.0
    for gap in profile.gaps:
        for start, end in gap.within(end_s):
            # What was sent a round trip before meets the gap too.
            total_s += min(end, end_s) - max(0.0, start - profile.rtt_ms(start) / 1e3)
    return total_s


@dataclass(frozen=True)
class Comparison:
    """Echoes of one run against what was asked."""

    sent_s: Values
    """Run time of every echo that counts."""
    measured_ms: Values
    """NaN for an unanswered echo."""
    asked_ms: Values
    usable: NDArray[np.bool_]
    """Answered and not under way during a gap."""
    error_ms: Values
    """measured - asked - base of the usable ones."""


def compare(
    profile: Profile, echoes: Echoes, t0_ns: int, end_ns: int, base_ms: float, extra: ExtraDelays
) -> Comparison:
    """Every echo sent from t0 on that could come back before the end."""
    sent_s = (echoes.sent_ns - t0_ns) / 1e9
    during = (sent_s >= 0) & (sent_s <= last_chance_s(echoes, t0_ns, end_ns))
    sent_s, measured = sent_s[during], echoes.rtt_ms[during]
    asked = expected_rtt_ms(
        profile, sent_s, ExtraDelays(extra.up_ms[during], extra.down_ms[during])
    )
    usable = np.isfinite(measured) & ~touches_gap(profile, sent_s, measured)
    return Comparison(sent_s, measured, asked, usable, (measured - asked - base_ms)[usable])


def last_chance_s(echoes: Echoes, t0_ns: int, end_ns: int) -> float:
    """An echo sent later had no chance to come back before the end."""
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
    """The verdict over the echoes sent from t0 to the end."""
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
        return "no RTT was measured"
    if median > tolerance.median_ms:
        return f"median RTT error {median:.2f} ms is above {tolerance.median_ms:g} ms"
    if tolerance.p99_ms is not None and p99 > tolerance.p99_ms:
        return f"p99 of the RTT error {p99:.2f} ms is above {tolerance.p99_ms:g} ms"
    return ""
