# SPDX-License-Identifier: Apache-2.0
"""What happened, in one picture per dataset: the median run of each cell, on one time axis."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from slambed.link.impairments import outages_within
from slambed.metrics.catalog import metric
from slambed.metrics.network import series
from slambed.report.cells import number, text
from slambed.report.conditions import median_run
from slambed.report.kept_events import from_part, with_events
from slambed.report.load import Results
from slambed.report.time_lanes import TimeLanes
from slambed.report.timeline import FAULTS, largest, rtt_of, state_lane

MOST_STRIPS = 8
"""Most runs in a picture: about what a screen shows."""
MOST_PICTURES = 6
RTT_HEIGHT, STATE_HEIGHT, TRACKING_HEIGHT = 34, 12, 24
GAP = 6
LONGEST_NAME = 50
"""Characters that fit on a line of a narrow screen."""
ROOM = 1.08
"""A scale ends above its largest value, so that a constant line is not its edge."""
LEAST_RTT_MS = 1.0
"""A link that never delays more gets no lane."""


@dataclass(frozen=True)
class Overview:
    """The picture of one dataset."""

    dataset: str
    svg: str
    shown: list[str]
    """Keys of its runs."""
    left_out: int
    """Cells that are not in the picture."""
    tracking_ms: str
    """End of the scale of tracking times; empty without any."""
    part: str = ""
    """From which share of the runs its strips were chosen, if not from all."""


@dataclass(frozen=True)
class Strip:
    """The run that stands for a cell."""

    key: str
    label: str
    row: pd.Series
    events: pd.DataFrame
    runs: int
    """Number of runs that it was chosen from."""


def anchor(run_key: str) -> str:
    """Returns the id of a run's timeline on the report's page."""
    return f"t-{run_key}"


def to_timeline(run_key: str) -> str:
    """Returns the address of a run's timeline on the report's page."""
    return f"#{anchor(run_key)}"


def overviews(results: Results, address: Callable[[str], str] = to_timeline) -> list[Overview]:
    """Returns a picture per dataset, in the order of the cells; without runs that have no events.
    `address`: where the marks of a run lead, by its key.

    A dataset with too many cells shows those links on which most runs lost track.
    """
    found = []
    for dataset, runs in results.valid_runs.groupby("dataset", sort=False, dropna=False):
        links = [(text(profile), rows) for profile, rows in _links(runs)]
        made = _overview(results, text(dataset), links, address)
        if made is not None:
            found.append(made)
        if len(found) == MOST_PICTURES:
            break
    return found


def _links(runs: pd.DataFrame) -> Iterator[tuple[object, pd.DataFrame]]:
    """Yields the links with their runs: as many as fit, those with most losses first, and then all
    in the order of the experiment."""
    groups = list(runs.groupby("profile", sort=False, dropna=False))
    shares = [-float(rows["lost"].eq(True).mean()) for _, rows in groups]
    kept: list[int] = []
    room = MOST_STRIPS
    for index in np.argsort(shares, kind="stable"):
        cells = groups[index][1]["cell"].nunique()
        if cells <= room or not kept:
            kept.append(int(index))
            room -= cells
    for index in sorted(kept):
        yield groups[index]


def _overview(
    results: Results,
    dataset: str,
    links: list[tuple[str, pd.DataFrame]],
    address: Callable[[str], str],
) -> Overview | None:
    strips: list[tuple[str, list[Strip]]] = []
    for profile, rows in links:
        own = [s for _, cell in rows.groupby("cell", sort=False) if (s := _strip(results, cell))]
        strips.append((profile, own[:MOST_STRIPS]))
    drawn = [strip for _, own in strips for strip in own]
    if not drawn:
        return None
    lanes = TimeLanes(max(float(strip.events["t_ns"].max()) / 1e9 for strip in drawn))
    tracking = [strip.events["track_ms"].dropna() for strip in drawn]
    most_ms = largest(pd.concat(tracking)) if any(map(len, tracking)) else 0.0
    for profile, own in strips:
        _rtt(lanes, results, profile, own)
        for strip in own:
            _draw(lanes, results, strip, profile, most_ms, address(strip.key))
    runs = results.valid_runs[results.valid_runs["dataset"].map(text) == dataset]
    says = f"median runs on {dataset}: round-trip time, tracking state and map updates over time"
    return Overview(
        dataset,
        lanes.svg(says, "overview"),
        [s.key for s in drawn],
        runs["cell"].nunique() - len(drawn),
        shown(most_ms) if most_ms else "",
        from_part(with_events(results, runs), runs),
    )


def _strip(results: Results, cell: pd.DataFrame) -> Strip | None:
    cell = with_events(results, cell)
    key = median_run(cell)
    events = results.table(key, "events") if key is not None else None
    if key is None or events is None or "frame_tracked" not in set(events["type"]):
        return None
    row = cell[cell["run_key"] == key].iloc[0]
    return Strip(key, str(row["label"]), row, events, len(cell))


def _rtt(lanes: TimeLanes, results: Results, profile: str, strips: list[Strip]) -> None:
    """Draws the round-trip time of a link: as asked, and as known in the first run that has it; and
    its outages."""
    outages = outages_within(results.links.get(profile, {}), lanes.end_s)
    for strip in strips:
        link = results.table(strip.key, "link")
        if link is None:
            continue
        asked = series(link, "asked_rtt_ms")
        source, known = rtt_of(link, strip.events)
        both = pd.concat([part for part in (asked, known) if len(part)] or [asked])
        if not len(both) or (both["value"].max() < LEAST_RTT_MS and not outages):
            continue
        most = ROOM * max(largest(both["value"]), LEAST_RTT_MS)
        name = f"RTT asked (line), {source} (dots)" if len(known) else "RTT asked"
        name += ", outages shaded" if outages else ""
        lanes.name(f"{profile}: {name}", right=f"0 to {shown(most)} ms")
        lanes.outages(outages, RTT_HEIGHT)
        if len(asked):
            lanes.curve(asked, RTT_HEIGHT, most, f"RTT of {profile}, asked", "ms")
        lanes.dots(known, RTT_HEIGHT, most, f"RTT {source}:")
        lanes.base(RTT_HEIGHT)
        lanes.gap(GAP)
        return


def _draw(
    lanes: TimeLanes, results: Results, strip: Strip, profile: str, most_ms: float, link: str
) -> None:
    where = f", {profile}" if profile else ""
    named, numbers = f"{strip.label}{where}", _in_words(strip.row)
    if strip.runs == 2:
        numbers = f"worse of 2: {numbers}"
    if len(named) + len(numbers) <= LONGEST_NAME:
        lanes.name(f"{named}: {numbers}", link)
    else:
        lanes.name(named, link)
        lanes.name(numbers)
    faults_from = lanes.y
    state_lane(lanes, strip.events, STATE_HEIGHT, link)
    frames = strip.events[strip.events["type"] == "frame_tracked"]
    took = pd.DataFrame({"t_s": frames["t_ns"] / 1e9, "value": frames["track_ms"]}).dropna()
    if len(took) and most_ms > 0:
        lanes.curve(took, TRACKING_HEIGHT, most_ms, f"{strip.label}{where}, tracking", "ms")
        lanes.base(TRACKING_HEIGHT)
    log = results.events(strip.key, FAULTS)
    lanes.faults(log.events if log is not None else [], faults_from, link)
    lanes.gap(GAP)


def shown(end: float) -> str:
    """Returns the end of a scale: whole numbers, unless it is small."""
    return f"{end:.0f}" if end >= 10 else f"{end:.1f}"


def _in_words(row: pd.Series) -> str:
    """Returns the numbers of a run that its strip shows."""
    parts = []
    if (coverage := number(row["coverage"])) is not None:
        parts.append(f"{metric('coverage').show(coverage)} % tracked")
    if (losses := number(row["track_losses"])) is not None:
        parts.append(f"{losses:.0f} loss{'' if losses == 1 else 'es'}")
    if (ate := number(row["ate_rmse_m"])) is not None:
        parts.append(f"ATE {metric('ate_rmse_m').show(ate)} cm")
    return ", ".join(parts) or "no numbers"


CAPTION = (
    "The median run of each combination: the middle one of the valid runs, sorted by coverage and "
    "then by ATE RMSE, of an even number the worse of the two in the middle; of 2 runs the worse "
    "one. "
    "Strip: green tracked, orange lost, gray not initialized; cross: track lost; tick under it: "
    "map update applied (dark), or received and not used (pink)."
)
