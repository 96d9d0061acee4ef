# SPDX-License-Identifier: Apache-2.0
"""Staged updates and suspensions of updates in the timeline and the story of a run."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pyarrow as pa
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex

from slambed.explain.picture import LANE_IN, MORE_LANE, REST_COLOR, Window, figure_of
from slambed.explain.run_log import RunLog
from slambed.explain.story import story
from slambed.explain.updates import Rest, rests, staged_updates
from slambed.metrics.event_columns import EVENT_COLUMNS, frame_of

STAGED_LANES = ["updates begun", "updates ready"]


def event(t_s: float, kind: str, **fields: Any) -> dict[str, Any]:
    return {"t_s": t_s, "node": "mobile", "type": kind, **fields}


FRAMES = [event(t, "frame_tracked", state="ok", inliers=90) for t in (0.0, 5.0, 10.0)]
STAGE = event(0.5, "stage", worker="tracking", name="track", wall_ms=20.0)
DECLINED = event(0.9, "update_declined", update=1, reason="few keyframes")
TWICE = [  # one swapped at once, one after a suspension
    event(1.0, "update_begun", update=2),
    event(1.25, "update_ready", update=2),
    event(1.2585, "update_applied", update=2, pause_ms=0.6, t_mu_ms=250.0),
    event(2.0, "update_begun", update=3),
    event(2.004, "update_ready", update=3),
    event(2.01, "suspended"),
    event(2.01, "track_lost"),
    event(3.5, "resumed"),
    event(3.524, "update_applied", update=3, pause_ms=2.0, t_mu_ms=90.0),
]
RESTARTED = [  # a restarted edge numbers from the start; update 4 was lost
    event(4.0, "update_begun", update=4),
    event(5.0, "update_declined", update=2, reason="fast motion"),
    event(6.0, "update_begun", update=2),
    event(6.5, "update_ready", update=2),
    event(6.51, "update_declined", update=2, reason="older than the map"),
    event(7.0, "update_begun", update=3),
    event(7.15, "update_ready", update=3),
    event(8.0, "suspended"),
    event(8.0, "track_lost"),
]


def log_of(*events: dict[str, Any]) -> RunLog:
    rows = [*FRAMES, STAGE, DECLINED, *events]
    table = frame_of(rows, EVENT_COLUMNS | {"t_s": pa.float64()})
    table = table.sort_values("t_s", kind="stable").reset_index(drop=True)
    return RunLog(Path("run"), "run", table, link=None)


@pytest.fixture
def run() -> RunLog:
    return log_of(*TWICE, *RESTARTED)


@pytest.fixture
def states(run: RunLog) -> Iterator[Axes]:
    figure = figure_of(run, Window(0.0, run.end_s))
    yield figure.axes[0]
    plt.close(figure)


def names(axes: Axes) -> list[str]:
    return [tick.get_text() for tick in axes.get_yticklabels()]


def lane(axes: Axes, name: str, kind: type) -> list[np.ndarray]:
    """Returns the x of each mark in this lane."""
    place = names(axes).index(name)
    return [
        path.vertices[:, 0]
        for marks in axes.collections
        if isinstance(marks, kind)
        for path in marks.get_paths()
        if abs(path.vertices[:, 1].min() + path.vertices[:, 1].max() - 2 * place) < 0.5
    ]


def test_the_story_reports_each_staged_update(run: RunLog) -> None:
    lines = story(run)
    first = next(n for n, line in enumerate(lines) if line.startswith("staged updates: "))
    assert lines[first : first + 6] == [
        "staged updates: 5 begun, 4 ready after 226 ms (mean; 500 ms at most), "
        "2 swapped after another 764 ms (mean; 1520 ms at most)",
        "update 2 begun at 1.00 s: ready after 250 ms, swapped 8.5 ms later (0.6 ms pause)",
        "update 3 begun at 2.00 s: ready after 4.0 ms, swapped 1520 ms later (2.0 ms pause); "
        "updates rested meanwhile",
        "update 4 begun at 4.00 s: never ready",
        "update 2 begun at 6.00 s: ready after 500 ms, declined 10 ms later: older than the map",
        "update 3 begun at 7.00 s: ready after 150 ms, never swapped; updates rested meanwhile",
    ]


def test_an_update_that_was_declined_before_it_began_is_not_a_staged_one(run: RunLog) -> None:
    assert [update.update for update in staged_updates(run)] == [2, 3, 4, 2, 3]
    assert "1 map update declined: few keyframes" in story(run)


def test_the_story_reports_rests_without_a_request(run: RunLog) -> None:
    assert rests(run) == [Rest(2.01, 3.5), Rest(8.0, None)]
    assert run.of("reloc_request").empty
    lines = story(run)
    assert "updates rested from 2.01 s to 3.50 s (1.49 s)" in lines
    assert "updates rested from 8.00 s to the end (2.00 s)" in lines


def test_the_story_of_many_says_how_many_it_leaves_out() -> None:
    events = []
    for n in range(14):
        t_s = 0.5 * n
        events += [event(t_s, "update_begun", update=n), event(t_s, "update_ready", update=n)]
        events += [event(t_s + 0.1, "suspended"), event(t_s + 0.2, "resumed")]
    lines = story(log_of(*events))
    assert sum(line.startswith("update ") for line in lines) == 12
    assert "and 2 more staged updates" in lines
    assert sum(line.startswith("updates rested from") for line in lines) == 5
    assert "and 9 more rests of updates" in lines


def test_begun_and_ready_have_ticks_where_they_happened(run: RunLog, states: Axes) -> None:
    assert names(states) == [
        "tracking", "updates at rest", *STAGED_LANES, "updates applied", "declined"
    ]  # fmt: skip
    for name, kind in zip(
        [*STAGED_LANES, "updates applied"],
        ["update_begun", "update_ready", "update_applied"],
        strict=True,
    ):
        ticks = lane(states, name, LineCollection)
        assert [tick[0] for tick in ticks] == list(run.of(kind)["t_s"]), name


def test_rests_are_a_strip_from_loss_to_recovery(states: Axes) -> None:
    bars = lane(states, "updates at rest", PolyCollection)
    assert [(bar.min(), bar.max()) for bar in bars] == [(2.01, 3.5), (8.0, 10.0)]
    (strip,) = [
        marks
        for marks in states.collections
        if isinstance(marks, PolyCollection) and len(marks.get_paths()) == 2
    ]
    assert to_hex(strip.get_facecolor()[0]) == REST_COLOR


def test_the_lanes_of_staged_updates_come_with_their_room(run: RunLog) -> None:
    swapped = event(3.0, "update_applied", update=2, pause_ms=9.0, t_mu_ms=90.0)
    plain, staged = (figure_of(log, Window(0.0, 10.0)) for log in (log_of(swapped), run))
    assert names(plain.axes[0]) == ["tracking", "updates applied", "declined"]
    more_in = staged.get_figheight() - plain.get_figheight()
    assert more_in == pytest.approx(3 * MORE_LANE * LANE_IN)
    plt.close(plain)
    plt.close(staged)


def test_other_systems_have_neither_in_their_story() -> None:
    swapped = event(3.0, "update_applied", update=2, pause_ms=9.0, t_mu_ms=90.0)
    lines = story(log_of(swapped))
    assert "1 map update applied, T_MU 90 ms" in lines
    assert not [line for line in lines if "staged" in line or "rested" in line or "begun" in line]


def test_updates_without_a_number_are_not_staged() -> None:
    assert staged_updates(log_of(event(3.0, "update_applied"))) == []
