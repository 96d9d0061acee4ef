# SPDX-License-Identifier: Apache-2.0
"""Staged map updates from begin to swap, and suspensions of updates after losses."""

from dataclasses import dataclass, replace
from math import fsum

from slambed.explain.run_log import RunLog


@dataclass(frozen=True)
class StagedUpdate:
    """One update that was prepared in parallel to tracking. Times in s of run time; None if not
    reached."""

    update: int
    begun_s: float
    ready_s: float | None = None
    ended_s: float | None = None
    """End of the swap, or time of the refusal."""
    declined: str | None = None
    pause_ms: float | None = None
    """How long tracking paused, which is part of the time from ready to the end of the swap."""

    @property
    def ready_ms(self) -> float | None:
        return None if self.ready_s is None else 1e3 * (self.ready_s - self.begun_s)

    @property
    def swap_ms(self) -> float | None:
        """Returns the time from ready to the end of the swap; None without a swap."""
        if self.ready_s is None or self.ended_s is None or self.declined is not None:
            return None
        return 1e3 * (self.ended_s - self.ready_s)


@dataclass(frozen=True)
class Rest:
    """A suspension of updates from a loss to its recovery, in s of run time: no update is sent or
    applied."""

    begin_s: float
    end_s: float | None
    """None if the loss lasted to the end."""


def staged_updates(run: RunLog) -> list[StagedUpdate]:
    """Returns staged updates in order of their begin; empty if the system does not stage
    updates."""
    found: list[StagedUpdate] = []
    under_way: dict[int, int] = {}  # a restarted edge reuses numbers
    events = run.of("update_begun", "update_ready", "update_applied", "update_declined")
    # A system that does not number its updates stages none.
    for event in events.dropna(subset=["update"]).to_dict("records"):
        number, t_s = int(event["update"]), float(event["t_s"])
        if event["type"] == "update_begun":
            under_way[number] = len(found)
            found.append(StagedUpdate(number, t_s))
            continue
        place = under_way.get(number)
        if place is None:
            continue  # declined before it began
        if event["type"] == "update_ready":
            found[place] = replace(found[place], ready_s=t_s)
            continue
        del under_way[number]
        if event["type"] == "update_declined":
            found[place] = replace(found[place], ended_s=t_s, declined=str(event["reason"]))
        else:
            pause_ms = float(event["pause_ms"])
            found[place] = replace(found[place], ended_s=t_s, pause_ms=pause_ms)
    return found


def rests(run: RunLog) -> list[Rest]:
    """Returns suspensions in order of time."""
    found: list[Rest] = []
    begin_s: float | None = None
    for event in run.of("suspended", "resumed").to_dict("records"):
        if event["type"] == "suspended":
            begin_s = float(event["t_s"])
        elif begin_s is not None:
            found.append(Rest(begin_s, float(event["t_s"])))
            begin_s = None
    return found if begin_s is None else [*found, Rest(begin_s, None)]


def staged_update_lines(run: RunLog, most: int) -> list[str]:
    """Returns a line about all updates, and one for each of the first `most`."""
    staged = staged_updates(run)
    if not staged:
        return []
    ready = [u.ready_ms for u in staged if u.ready_ms is not None]
    swap = [u.swap_ms for u in staged if u.swap_ms is not None]
    parts = [f"{len(staged)} begun"]
    for times, what in ((ready, "ready after"), (swap, "swapped after another")):
        if times:
            mean = fsum(times) / len(times)
            parts.append(f"{len(times)} {what} {_ms(mean)} (mean; {_ms(max(times))} at most)")
        else:
            parts.append(f"none {what.split()[0]}")
    pauses = rests(run)
    lines = ["staged updates: " + ", ".join(parts)]
    lines += [_line(update, pauses, run.end_s) for update in staged[:most]]
    if (more := len(staged) - most) > 0:
        lines.append(f"and {more} more staged update{'' if more == 1 else 's'}")
    return lines


def _line(update: StagedUpdate, pauses: list[Rest], end_s: float) -> str:
    begun = f"update {update.update} begun at {update.begun_s:.2f} s"
    # An edge restart or the end of playback leaves some updates unfinished.
    since_s = update.begun_s if update.ready_s is None else update.ready_s
    until_s = end_s if update.ended_s is None else update.ended_s
    after = _ms(1e3 * (until_s - since_s))
    was_ready = "" if update.ready_ms is None else f"ready after {_ms(update.ready_ms)}, "
    if update.declined is not None:
        message = f"{was_ready}declined {after} later: {update.declined}"
    elif update.ready_ms is None:
        message = "never ready"
    elif update.ended_s is None:
        message = f"{was_ready}never swapped"
    else:
        message = f"{was_ready}swapped {after} later ({_ms(update.pause_ms or 0.0)} pause)"
    rested = update.ready_s is not None and any(
        pause.begin_s < until_s and (pause.end_s is None or pause.end_s > since_s)
        for pause in pauses
    )
    return f"{begun}: {message}" + ("; updates rested meanwhile" if rested else "")


def rest_lines(run: RunLog, most: int) -> list[str]:
    """Returns a line for each of the first `most` suspensions."""
    found, lines = rests(run), []
    for rest in found[:most]:
        end_s = run.end_s if rest.end_s is None else rest.end_s
        until = "the end" if rest.end_s is None else f"{end_s:.2f} s"
        lines.append(
            f"updates rested from {rest.begin_s:.2f} s to {until} ({end_s - rest.begin_s:.2f} s)"
        )
    if (more := len(found) - most) > 0:
        lines.append(f"and {more} more rest{'' if more == 1 else 's'} of updates")
    return lines


def _ms(value: float) -> str:
    return f"{value:.1f} ms" if value < 9.95 else f"{value:.0f} ms"
