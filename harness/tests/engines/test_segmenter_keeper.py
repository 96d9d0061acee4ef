# SPDX-License-Identifier: Apache-2.0
"""A segmenter that dies in a live run is restarted after a pause, and every step is logged."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from slambed.engines import segmenter_keeper
from slambed.engines.segmenter_keeper import RESTART_PERIOD_S, SegmenterKeeper
from slambed.errors import SlambedError


class Invented:
    """A configurable fake segmenter."""

    def __init__(self) -> None:
        self.how: str | None = None
        self.ready, self.closed = False, 0
        self.cpu_s: float | None = 1.5

    def await_ready(self, stopped: Callable[[], bool]) -> None:
        self.ready = True

    def ended(self) -> str | None:
        return self.how

    def is_ready(self) -> bool:
        return self.ready

    def close(self) -> float | None:
        self.closed += 1
        return self.cpu_s


class Stage:
    """A keeper with simulated time, its started segmenters and its events."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 100.0
        monkeypatch.setattr(segmenter_keeper.time, "monotonic", lambda: self.now_s)
        self.started: list[Invented] = []
        self.reported: list[tuple[str, dict[str, Any]]] = []
        self.refuses = False
        self.keeper = SegmenterKeeper(self._start)
        self.keeper.await_ready(lambda: False)

    def _start(self) -> Invented:
        if self.refuses:
            raise SlambedError("no room for a segmenter, here, make some")
        self.started.append(Invented())
        return self.started[-1]

    def after(self, seconds: float, edge_lives: bool = True) -> list[str]:
        """Advances the time and returns the resulting events."""
        self.now_s += seconds
        before = len(self.reported)
        self.keeper.act(lambda kind, **more: self.reported.append((kind, more)), edge_lives)
        return [kind for kind, _ in self.reported[before:]]

    def die(self) -> None:
        self.started[-1].how, self.started[-1].cpu_s = "signal 9", None


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Stage:
    return Stage(monkeypatch)


def test_one_that_lives_is_left_alone(stage: Stage) -> None:
    assert stage.after(1) == stage.after(60) == []
    assert (len(stage.started), stage.keeper.restarts) == (1, 0)
    assert stage.keeper.close() == stage.keeper.close() == 1.5
    assert stage.started[0].closed == 1


def test_one_that_died_is_started_again_and_counted(stage: Stage) -> None:
    stage.after(60)
    stage.die()
    assert stage.after(0.02) == ["segmenter_ended"]
    assert stage.reported[-1][1] == {"how": "signal 9"}
    assert len(stage.started) == 2
    assert stage.after(0.5) == []
    stage.started[-1].ready = True
    assert stage.after(0.02) == ["segmenter_restarted"]
    assert stage.reported[-1][1] == {"restarts": 1}
    assert stage.after(60) == []
    # The CPU time of the first segmenter died with it.
    assert (stage.keeper.restarts, stage.keeper.close()) == (1, None)
    assert [process.closed for process in stage.started] == [1, 1]


def test_one_that_dies_at_once_is_started_no_more_often_than_that(stage: Stage) -> None:
    starts = []
    for _ in range(100):
        stage.die()
        stage.after(RESTART_PERIOD_S / 10)
        starts.append(len(stage.started))
    assert starts[-1] == pytest.approx(11, abs=1)
    assert max(later - earlier for earlier, later in pairwise(starts)) == 1


def test_without_an_edge_there_is_nobody_to_start_it_for(stage: Stage) -> None:
    stage.die()
    assert stage.after(60, edge_lives=False) == ["segmenter_ended"]
    assert len(stage.started) == 1
    stage.after(0.02)
    assert len(stage.started) == 2


def test_one_that_cannot_be_started_is_tried_again(stage: Stage) -> None:
    stage.after(60)
    stage.die()
    stage.refuses = True
    assert stage.after(0.02) == ["segmenter_ended", "segmenter_not_started"]
    assert "no room" in stage.reported[-1][1]["reason"]
    stage.refuses = False
    assert stage.after(RESTART_PERIOD_S / 2) == []
    stage.after(RESTART_PERIOD_S)
    assert (len(stage.started), stage.keeper.restarts) == (2, 2)
