# SPDX-License-Identifier: Apache-2.0
"""Reasons of the slowest frames: computing, limits, the host, earlier frames."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from command_line import refused, slambed
from results_factory import STALLED_FRAME, RawRun, write_raw

from slambed.errors import ExitCode, SlambedError
from slambed.explain.run_log import RunLog, RunStatus, read_run
from slambed.explain.slowest import SlowFrame, line_of, report_lines, slowest

FRAMES = 30
EVERY_S = 0.1
USUAL_MS = 20.0


def stage(end_s: float, name: str, worker: str, wall_ms: float, cpu_ms: float) -> dict[str, Any]:
    return {
        "t_s": end_s, "type": "stage", "node": "mobile", "name": name, "worker": worker,
        "wall_ms": wall_ms, "cpu_ms": cpu_ms,
    }  # fmt: skip


# Half of it overlaps frame 7, which takes from 0.70 to 0.78 s.
BUNDLE = [stage(0.74, "bundle", "mapping", 80.0, 80.0)]


def run_of(
    slow: int,
    wall_ms: float,
    cpu_ms: float,
    *,
    wait_ms: float = 0.0,
    untimed_ms: float = 0.0,
    throttled_s: float = 0.0,
    run_delay_s: float = 0.0,
    virtual: bool = False,
    further: list[dict[str, Any]] | None = None,
) -> RunLog:
    """Returns frames of 20 ms of CPU time, except one; the counters grow while that one is
    tracked."""
    events: list[dict[str, Any]] = list(further or [])
    for frame in range(FRAMES):
        timed_ms, used_ms = (wall_ms, cpu_ms) if frame == slow else (USUAL_MS, USUAL_MS)
        track_ms = timed_ms + (untimed_ms if frame == slow else 0.0)
        waited_ms = wait_ms if frame == slow else 0.0
        end_s = EVERY_S * frame + (waited_ms + track_ms) / 1e3

        def part(t_s: float, name: str, share: float) -> dict[str, Any]:
            return stage(t_s, name, "tracking", share * timed_ms, share * used_ms)  # noqa: B023

        events += [
            part(end_s - 0.4 * timed_ms / 1e3, "extract", 0.6),
            part(end_s, "track", 0.4),
            {
                "t_s": end_s,
                "type": "frame_tracked",
                "node": "mobile",
                "frame": 3 * frame,
                "state": "ok",
                "track_ms": track_ms,
                "wait_ms": waited_ms,
            },
        ]
    begin_s = EVERY_S * slow
    samples = [
        {
            "t_s": t,
            "node": "mobile",
            "throttled_s": throttled_s * (t > begin_s + 0.01),
            "run_delay_s": run_delay_s * (t > begin_s + 0.01),
        }
        for t in (EVERY_S * i for i in range(FRAMES + 5))
    ]
    log = pd.DataFrame(events).sort_values("t_s", kind="stable")
    return RunLog(
        Path("run"), "a run", log, None, RunStatus(virtual=virtual), pd.DataFrame(samples)
    )


def test_a_system_without_stages_may_have_computed_all_the_time() -> None:
    run = run_of(7, wall_ms=80.0, cpu_ms=80.0)
    silent = replace(run, events=run.events[run.events["type"] != "stage"])
    found = the_slowest(silent)
    assert found.cause == "unknown" and found.waiting_ms == 0
    assert "waiting" not in line_of(found)


def the_slowest(run: RunLog) -> SlowFrame:
    (found,) = slowest(run, 1)
    return found


@pytest.mark.parametrize(
    ("cause", "given"),
    [
        ("computing", {"wall_ms": 80.0, "cpu_ms": 80.0}),
        ("throttled", {"wall_ms": 80.0, "cpu_ms": 20.0, "throttled_s": 0.058, "run_delay_s": 0.06}),
        ("stalled", {"wall_ms": 80.0, "cpu_ms": 20.0, "throttled_s": 0.002, "run_delay_s": 0.06}),
        ("shared", {"wall_ms": 80.0, "cpu_ms": 20.0, "run_delay_s": 0.06, "further": BUNDLE}),
        ("waiting", {"wall_ms": 80.0, "cpu_ms": 20.0}),
        ("waiting", {"wall_ms": 20.0, "cpu_ms": 20.0, "untimed_ms": 60.0}),
        ("queued", {"wall_ms": 30.0, "cpu_ms": 30.0, "wait_ms": 50.0}),
        ("shared", {"wall_ms": 80.0, "cpu_ms": 20.0, "virtual": True}),
    ],
)
def test_each_cause_is_reported(cause: str, given: dict[str, Any]) -> None:
    found = the_slowest(run_of(7, **given))
    assert (found.frame, found.cause) == (21, cause)
    assert found.total_ms == pytest.approx(80.0)
    assert found.offered_s == pytest.approx(0.7)
    whole = found.throttled_ms + found.stalled_ms + found.waiting_ms + (found.cpu_ms or 0.0)
    assert whole == pytest.approx(found.wall_ms)


def test_no_part_is_more_than_its_counter_grew() -> None:
    found = the_slowest(run_of(7, wall_ms=80.0, cpu_ms=20.0, throttled_s=0.010, run_delay_s=0.015))
    assert found.throttled_ms == pytest.approx(10.0)
    assert found.stalled_ms == pytest.approx(5.0)
    assert found.waiting_ms == pytest.approx(45.0)


def test_no_part_is_more_than_is_missing() -> None:
    # Counters cover all threads: mapping was throttled far longer than tracking.
    found = the_slowest(run_of(7, wall_ms=80.0, cpu_ms=60.0, throttled_s=0.3, run_delay_s=0.4))
    assert found.throttled_ms == pytest.approx(15.0)
    assert found.stalled_ms == pytest.approx(5.0)
    assert found.waiting_ms == pytest.approx(0.0)


def test_stages_and_what_ran_beside_are_reported() -> None:
    found = the_slowest(run_of(7, wall_ms=80.0, cpu_ms=80.0, further=BUNDLE))
    assert found.stages == {"extract": pytest.approx(48.0), "track": pytest.approx(32.0)}
    assert found.concurrent == {"bundle": pytest.approx(40.0)}


def test_the_longest_come_first() -> None:
    found = slowest(run_of(7, wall_ms=80.0, cpu_ms=80.0), 4)
    assert found[0].frame == 21 and len(found) == 4
    assert [f.total_ms for f in found] == sorted((f.total_ms for f in found), reverse=True)
    assert len(slowest(run_of(7, wall_ms=80.0, cpu_ms=80.0), 1000)) == FRAMES


def test_lines_say_cause_and_numbers() -> None:
    run = run_of(7, wall_ms=80.0, cpu_ms=20.0, throttled_s=0.058, run_delay_s=0.06)
    head, line = report_lines(run, slowest(run, 1))
    assert head == "the slowest 1 of 30 frames (median 20.0 ms): 1 throttled by its limits"
    assert line == (
        "frame 21 at 0.70 s: 80.0 ms; tracking 80.0 ms, 20.0 ms of it CPU (extract 48.0, track "
        "32.0); throttled 58.0 ms; stalled 2.0 ms -> throttled by its limits"
    )


def test_a_stalled_frame_of_a_run_is_found(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(stall_ms=400.0))
    run = read_run(raw)
    assert run.longest_stall() is not None
    frames = run.of("frame_tracked")
    longest = frames.loc[frames["track_ms"].idxmax()]
    assert the_slowest(run).frame == longest["frame"]
    assert STALLED_FRAME in set(frames["frame"])


def test_a_system_that_reports_no_times_is_refused() -> None:
    run = run_of(7, wall_ms=80.0, cpu_ms=80.0)
    events = run.events.drop(columns=["track_ms"])
    with pytest.raises(SlambedError, match="does not report how long"):
        slowest(RunLog(run.folder, run.title, events, None), 3)


def test_the_command_reports_lines_and_draws_nothing(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun())
    code, out, err = slambed("explain", str(raw), "--slowest", "3", cwd=tmp_path)
    assert (code, err) == (ExitCode.OK, "")
    head, *lines = out.splitlines()
    assert head.startswith("the slowest 3 of ") and len(lines) == 3
    assert [p.name for p in tmp_path.iterdir()] == ["raw"]
    both = ("explain", str(raw), "--slowest", "3", "--around", "loss")
    assert "give it alone" in refused(ExitCode.BAD_INPUT, *both)
    assert "--slowest" in refused(ExitCode.BAD_INPUT, "explain", str(raw), "--slowest", "0")
