# SPDX-License-Identifier: Apache-2.0
"""What the scripts of pages compute, in a JavaScript engine without a browser."""

import json
import math
from typing import Any

import pytest
import quickjs

from slambed.report.page import script_of


@pytest.fixture(scope="module")
def engine() -> quickjs.Context:
    context = quickjs.Context()
    context.eval(script_of("view_math.js").replace("const viewMath", "var viewMath"))
    return context


def call(engine: quickjs.Context, name: str, *arguments: Any) -> Any:
    given = ", ".join(json.dumps(a) for a in arguments)
    text = engine.eval(f"JSON.stringify(viewMath.{name}({given}))")
    return None if text is None else json.loads(text)


@pytest.mark.parametrize(
    ("window", "at", "factor", "expected"),
    [
        ([0, 10], 5, 2, [2.5, 7.5]),
        ([0, 10], 0, 2, [0, 5]),
        ([0, 10], 10, 2, [5, 10]),
        ([4, 6], 5, 0.5, [3, 7]),
        ([4, 6], 5, 0.01, [0, 10]),  # never more than the whole
        ([0, 1], 0.5, 0.5, [0, 2]),  # moved inside at an end
        ([4, 5], 4.5, 100, [4.25, 4.75]),  # never less than the smallest span
    ],
)
def test_zoom_keeps_the_place_it_is_about(
    engine: quickjs.Context, window: list[float], at: float, factor: float, expected: list[float]
) -> None:
    assert call(engine, "zoomed", window, at, factor, [0, 10], 0.5) == pytest.approx(expected)


def test_a_window_moves_as_far_as_there_is_something(engine: quickjs.Context) -> None:
    assert call(engine, "shifted", [2, 4], 3, [0, 10]) == [5, 7]
    assert call(engine, "shifted", [2, 4], 30, [0, 10]) == [8, 10]
    assert call(engine, "shifted", [2, 4], -30, [0, 10]) == [0, 2]


@pytest.mark.parametrize(
    ("low", "high", "count"), [(0, 15, 8), (-0.3, 0.2, 5), (1e-4, 3e-4, 4), (999, 1001, 10)]
)
def test_ticks_are_round_rising_and_inside(
    engine: quickjs.Context, low: float, high: float, count: int
) -> None:
    ticks = call(engine, "ticks", low, high, count)
    assert 2 <= len(ticks) <= count + 1
    assert all(low - 1e-9 <= t <= high + 1e-9 for t in ticks) and ticks == sorted(ticks)
    step = ticks[1] - ticks[0]
    first_digit = float(f"{step:.0e}".split("e")[0])
    assert first_digit in (1, 2, 5)
    texts = [call(engine, "written", t, step) for t in ticks]
    assert len(set(texts)) == len(texts)
    assert [float(text) for text in texts] == pytest.approx(ticks, abs=step / 100)


def test_no_ticks_where_there_is_no_span(engine: quickjs.Context) -> None:
    assert call(engine, "ticks", 1, 1, 5) == [] == call(engine, "ticks", 0, 1, 0)


def test_numbers_for_people(engine: quickjs.Context) -> None:
    assert call(engine, "short", 12.34567) == "12.35"
    assert call(engine, "short", 85) == "85"
    assert call(engine, "short", None) == "-"


def test_times_for_people(engine: quickjs.Context) -> None:
    asked = (12.345, 0, -1e-9, -0.004, -0.5, 100)
    reported = [call(engine, "seconds", t) for t in asked]
    assert reported == ["12.35", "0.00", "0.00", "0.00", "-0.50", "100.00"]


def test_the_last_time_not_after_another(engine: quickjs.Context) -> None:
    times = [0.5, 1.0, 1.0, 2.0]
    asked = (0.0, 0.5, 0.7, 1.0, 1.5, 9.0)
    assert [call(engine, "lastBefore", times, t) for t in asked] == [0, 0, 0, 2, 2, 3]
    assert call(engine, "lastBefore", [], 1.0) == -1


def test_the_nearest_point_within_reach(engine: quickjs.Context) -> None:
    xs, ys = [0, 10, 20], [0, 0, 5]
    assert call(engine, "nearest", xs, ys, 9, 1, 5) == 1
    assert call(engine, "nearest", xs, ys, 19, 4, 5) == 2
    assert call(engine, "nearest", xs, ys, 100, 100, 5) == -1


def test_turning_keeps_lengths_and_begins_straight(engine: quickjs.Context) -> None:
    assert call(engine, "seen", [1, 2, 3], 0, 0) == pytest.approx([1, 3, -2])
    for yaw, pitch in ((0.3, 0.7), (-2.0, 1.5), (5.0, -1.0)):
        seen = call(engine, "seen", [1, 2, 3], yaw, pitch)
        assert math.hypot(*seen) == pytest.approx(math.sqrt(14))
    # Seen from above, x points right and y up.
    assert call(engine, "seen", [1, 0, 9], 0, math.pi / 2)[:2] == pytest.approx([1, 0], abs=1e-9)
    assert call(engine, "seen", [0, 1, 9], 0, math.pi / 2)[:2] == pytest.approx([0, 1], abs=1e-9)


def test_a_ball_holds_all_points(engine: quickjs.Context) -> None:
    ball = call(engine, "ballAround", [[0, 0, 0], [2, 4, 4]])
    assert ball["middle"] == [1, 2, 2] and ball["radius"] == pytest.approx(3)
    assert call(engine, "ballAround", []) == {"middle": [0, 0, 0], "radius": 1}
    assert call(engine, "ballAround", [[5, 5, 5]])["radius"] == 1


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_place_and_value_are_each_others_way_back(engine: quickjs.Context, scale: str) -> None:
    for value in (0.1, 1.0, 30.0, 99.0):
        place = call(engine, "placeOf", value, [0.1, 100.0], scale)
        assert 0 <= place <= 1
        assert call(engine, "valueAt", place, [0.1, 100.0], scale) == pytest.approx(value)
    # An axis may run downwards, as in lists of cells.
    assert call(engine, "placeOf", 0, [2.6, -0.6], "linear") == pytest.approx(2.6 / 3.2)
