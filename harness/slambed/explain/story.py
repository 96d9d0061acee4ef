# SPDX-License-Identifier: Apache-2.0
"""Tells in lines what happened in a run: busy workers, updates, and what preceded each loss."""

from collections.abc import Hashable
from typing import Any

from slambed.explain.messages import dropped_lines
from slambed.explain.run_log import RunLog
from slambed.explain.updates import rest_lines, staged_update_lines
from slambed.metrics.validity import NOTABLE_STEAL_PERCENT

MOST_LOSSES = 5
MOST_CHANGES = 12
MOST_OUTAGES = 5
BEFORE_LOSS_S = 2.0
NOTABLE_STALL_MS = 20.0
"""Shorter stalls occur on any busy host."""
WORDS = {"kill": "killed", "freeze": "frozen", "cut": "cut"}


def story(run: RunLog) -> list[str]:
    """Returns one line per fact."""
    return [
        _frames(run), *_status(run), *_faults(run), *_outages(run), *_busy(run), *_updates(run),
        *staged_update_lines(run, MOST_CHANGES), *_requests(run), *rest_lines(run, MOST_LOSSES),
        *dropped_lines(run), *_stalls(run),
        *_states(run), *_losses(run),
    ]  # fmt: skip


def _frames(run: RunLog) -> str:
    tracked, dropped = run.of("frame_tracked"), run.of("frame_dropped")
    good = int((tracked["state"] == "ok").sum())
    return (
        f"{len(tracked) + len(dropped)} frames in {run.end_s:.1f} s: {good} with a pose, "
        f"{len(dropped)} dropped, {_count(len(run.of('track_lost')), 'track loss', 'es')}; "
        f"{_count(len(run.of('keyframe_created')), 'keyframe')} created"
    )


def _status(run: RunLog) -> list[str]:
    """Returns how the system ended, whether the run is valid, and how the host disturbed it."""
    status, lines = run.status, []
    if status.outcome != "completed":
        why = f": {status.outcome_reason}" if status.outcome_reason else ""
        lines.append(f"the system {status.outcome.replace('_', ' ')}{why}")
    if not status.valid:
        lines.append(f"invalid: {status.invalid_reason or 'no reason was kept'}")
    if status.attempts > 1:
        lines.append(
            f"attempt {status.attempts}, the earlier ones were invalid or were run again on request"
        )
    if (steal := status.steal_percent) is not None and steal >= NOTABLE_STEAL_PERCENT:
        lines.append(f"steal: neighbors took {steal:.1f} % of this host's CPU time")
    if (stall := run.longest_stall()) is not None and stall[1] >= NOTABLE_STALL_MS:
        lines.append(
            f"the host stalled the mobile node for {stall[1]:.0f} ms at {stall[0]:.2f} s"
            + _stolen(run, stall[0])
        )
    return lines


def _stolen(run: RunLog, t_s: float) -> str:
    """Returns the steal time around this time, if it is notable."""
    steal = run.steal_percent(t_s - BEFORE_LOSS_S / 2, t_s + BEFORE_LOSS_S / 2)
    if steal is None or steal < NOTABLE_STEAL_PERCENT:
        return ""
    return f", while neighbors had {steal:.0f} % of a processor (steal)"


def _faults(run: RunLog) -> list[str]:
    lines = []
    for span in run.faults():
        until = "the end" if span.end_s is None else f"{span.end_s:.2f} s"
        lines.append(f"{span.target} {WORDS[span.fault]} from {span.begin_s:.2f} s to {until}")
    return lines


def _outages(run: RunLog) -> list[str]:
    lines = [
        f"outage of the link from {begin_s:.2f} s to {end_s:.2f} s"
        for begin_s, end_s in run.outages_s[:MOST_OUTAGES]
    ]
    if (more := len(run.outages_s) - MOST_OUTAGES) > 0:
        lines.append(f"and {_count(more, 'more outage')} of the link")
    return lines


def _count(number: int, what: str, plural: str = "s") -> str:
    return f"{number} {what}{'' if number == 1 else plural}"


def _busy(run: RunLog) -> list[str]:
    stages = run.of("stage")
    if stages.empty or run.end_s <= 0:
        return []
    lines = []
    for (node, worker), own in stages.groupby(["node", "worker"], sort=True):
        by_name = own.groupby("name")["wall_ms"].sum().sort_values(ascending=False)
        most = ", ".join(f"{name} {total / 1e3:.1f} s" for name, total in by_name.head(3).items())
        share = 100 * float(own["wall_ms"].sum()) / 1e3 / run.end_s
        lines.append(f"{node} {worker}: busy {share:.0f} % of the time ({most})")
    return lines


def _updates(run: RunLog) -> list[str]:
    applied = run.of("update_applied")
    lines = []
    if len(applied):
        gaps = applied["gap_keyframes"].dropna()
        alone = len(applied) == 1
        newer = _count(int(gaps.sum()), "newer keyframe")
        gap = f", {newer} missing from {'it' if alone else 'them'}" if len(gaps) else ""
        taken = applied["t_mu_ms"].dropna()
        t_mu = f", T_MU {taken.mean():.0f} ms" if len(taken) else ""
        sent = int(applied["relocalization"].eq(True).sum())
        among = f" ({'' if alone else f'{sent} of them '}for a relocalization)" if sent else ""
        updates = _count(len(applied), "map update")
        lines.append(f"{updates} applied{among}{t_mu}{gap}")
    for kind, what in (("update_declined", "map update"), ("keyframe_declined", "keyframe")):
        declined = run.of(kind)
        for reason, count in declined["reason"].value_counts().items():
            lines.append(f"{_count(int(count), what)} declined: {reason}")
    return lines


def _stalls(run: RunLog) -> list[str]:
    """Returns the first stalls (bytes in flight, none acknowledged) and how many more there are."""
    events = run.of("link")
    stall_events = events[events["event"] == "stalled"] if len(events) else events
    lines = []
    for stall in stall_events.head(MOST_LOSSES).to_dict("records"):
        ends = events[
            (events["event"] == "flowing")
            & (events["node"] == stall["node"])
            & (events["channel"] == stall["channel"])
            & (events["t_s"] > stall["t_s"])
        ]
        until = f"until {ends.iloc[0]['t_s']:.2f} s" if len(ends) else "to the end"
        lines.append(
            f"{stall['channel']} stalled at the {stall['node']} node: {stall['detail']} at "
            f"{stall['t_s']:.2f} s, {until}"
        )
    if len(stall_events) > MOST_LOSSES:
        lines.append(f"and {_count(len(stall_events) - MOST_LOSSES, 'more stall')} of the link")
    return lines


def _requests(run: RunLog) -> list[str]:
    """Returns a line about lost frames sent to the edge."""
    asked = run.of("reloc_request")
    if asked.empty:
        return []
    replies = run.of("reloc_reply")
    used = int(replies["reason"].isna().sum())  # replies that were not used have a reason
    reasons = replies["reason"].value_counts()
    others = "".join(f", {reason} {count}" for reason, count in reasons.items())
    return [f"{_count(len(asked), 'lost frame')} sent to the edge: {used} found and used{others}"]


def _states(run: RunLog) -> list[str]:
    """Returns each state change of the system, or counts of them if there are many."""
    changes = run.of("state_changed")
    if len(changes) <= MOST_CHANGES:
        return [_change(change) for change in changes.to_dict("records")]
    ways = (changes["from"].astype(str) + " to " + changes["to"].astype(str)).value_counts()
    ways = ways[~ways.index.str.startswith("start to ")]
    often = ", ".join(f"{way} {count}" for way, count in ways.items())
    first, second, *_, last = (_change(change) for change in changes.to_dict("records"))
    return [first, second, f"... {len(changes) - 3} more state changes; of all: {often}", last]


def _change(change: dict[Hashable, Any]) -> str:
    rtt_ms = change.get("rtt_ms")
    rtt = "no RTT known" if rtt_ms is None or rtt_ms != rtt_ms else f"RTT {rtt_ms:.0f} ms"
    begun = change["from"] == "start"
    what = f"state {change['to']}" if begun else f"state {change['from']} to {change['to']}"
    return f"{what} at {change['t_s']:.2f} s: {rtt}"


def _losses(run: RunLog) -> list[str]:
    lines = []
    losses = run.of("track_lost")
    for _, loss in losses.head(MOST_LOSSES).iterrows():
        t_s = float(loss["t_s"])
        recent = run.events[run.events["t_s"].between(t_s - BEFORE_LOSS_S, t_s)]
        facts = []
        inliers = recent.loc[recent["type"] == "frame_tracked", "inliers"].dropna()
        if len(inliers):
            facts.append("inliers " + " ".join(f"{int(value)}" for value in inliers.tail(6)))
        if dropped := int((recent["type"] == "frame_dropped").sum()):
            facts.append(f"{_count(dropped, 'frame')} dropped")
        steal = run.steal_percent(t_s - BEFORE_LOSS_S, t_s)
        if steal is not None and steal >= NOTABLE_STEAL_PERCENT:
            facts.append(f"neighbors had {steal:.0f} % of a processor (steal)")
        updates = run.of("update_applied")
        earlier = updates[updates["t_s"] <= t_s]
        if len(earlier):
            last = earlier.iloc[-1]
            facts.append(f"last map update {t_s - float(last['t_s']):.2f} s before")
        states = run.of("state_changed")
        states = states[states["t_s"] <= t_s]
        if len(states):
            facts.append(f"state {states.iloc[-1]['to']}")
        lines.append(f"track lost at {t_s:.2f} s: " + "; ".join(facts))
    if len(losses) > MOST_LOSSES:
        lines.append(f"and {_count(len(losses) - MOST_LOSSES, 'more track loss', 'es')}")
    return lines
