# SPDX-License-Identifier: Apache-2.0
"""Each loss gets the cause that its events show, and a sentence with its numbers."""

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import refused, slambed
from results_factory import RawRun, spec_of, write_experiment
from wall_walk import write_walk

from slambed.errors import ExitCode
from slambed.metrics.events import EventLog
from slambed.metrics.losses import Cause, losses_of, sentence
from slambed.report.loss_table import LostRun, all_by_cause, by_cause


def frame(t_s: float, state: str = "ok", **more: Any) -> dict[str, Any]:
    return {
        "t_ns": int(t_s * 1e9), "type": "frame_tracked", "node": "mobile", "seq_s": t_s,
        "frame": round(30 * t_s), "state": state, "inliers": 200, "features": 1000, **more,
    }  # fmt: skip


def event(t_s: float, kind: str, **more: Any) -> dict[str, Any]:
    return {"t_ns": int(t_s * 1e9), "type": kind, "node": "mobile", **more}


def log_of(*events: dict[str, Any]) -> EventLog:
    return EventLog(sorted(events, key=lambda e: e["t_ns"]))


def walk(until_s: float) -> list[dict[str, Any]]:
    return [frame(k / 10) for k in range(round(10 * until_s))]


def test_a_standstill_names_the_missing_frames_and_the_update() -> None:
    lost = frame(
        2.6,
        "lost",
        inliers=0,
        motion_matches=4,
        word_matches=9,
        reference_matches=11,
        missing_frames=6,
    )
    update = event(2.58, "update_applied", gap_keyframes=3, pause_ms=581.0)
    (loss,) = losses_of(log_of(*walk(2.0), update, lost))
    assert loss.cause is Cause.STANDSTILL
    assert (loss.missing_frames, loss.gap_keyframes, loss.last_frame, loss.frame) == (6, 3, 57, 78)
    assert sentence(loss) == (
        "tracking stood still and 6 frames are missing, a map update came 0.02 s before after "
        "holding tracking for 581 ms; the motion model found 4 points (20 wanted), words matched 9 "
        "of the reference keyframe (15 wanted), descriptors alone 11"
    )


def test_the_standstill_may_be_one_frame_back() -> None:
    rescued, lost = frame(2.6, missing_frames=5), frame(2.7, "lost", inliers=15)
    (loss,) = losses_of(log_of(*walk(2.0), rescued, lost))
    assert loss.cause is Cause.STANDSTILL
    assert loss.missing_frames == 5
    assert "the local map agreed with 15 (30 wanted)" in sentence(loss)


def test_events_of_older_runs_report_missing_frames_by_their_drops() -> None:
    drops = [event(2.0 + k / 10, "frame_dropped") for k in range(4)]
    (loss,) = losses_of(log_of(*walk(2.0), *drops, frame(2.5, "lost")))
    assert (loss.cause, loss.missing_frames) == (Cause.STANDSTILL, 4)


@pytest.mark.parametrize(
    ("gap", "before_s", "cause"), [(3, 0.3, Cause.GAP), (0, 0.3, Cause.VIEW), (3, 0.7, Cause.VIEW)]
)
def test_a_gap_is_what_an_update_took_right_before(gap: int, before_s: float, cause: Cause) -> None:
    update = event(2.0 - before_s, "update_applied", gap_keyframes=gap, pause_ms=2.0)
    (loss,) = losses_of(log_of(*walk(2.0), update, frame(2.0, "lost")))
    assert loss.cause is cause
    assert ("took 3 of the newest keyframes away" in sentence(loss)) == (cause is Cause.GAP)


def test_a_camera_just_found_is_lost_for_want_of_fifty_inliers() -> None:
    events = [*walk(2.0), frame(2.0, "lost"), event(2.3, "relocalized"), frame(2.3)]
    first, again = losses_of(log_of(*events, frame(2.4, "lost", inliers=41)))
    assert (first.cause, again.cause) == (Cause.VIEW, Cause.JUST_FOUND)
    assert "lost again 0.10 s after" in sentence(again)
    assert "50 inliers are asked for and 41 agree" in sentence(again)


def test_a_covered_lens_shows_little() -> None:
    (loss,) = losses_of(log_of(*walk(2.0), frame(2.0, "lost", features=30, inliers=0)))
    assert loss.cause is Cause.VIEW
    assert sentence(loss) == "the picture shows little (3% of the usual features)"


def test_who_was_never_found_loses_nothing() -> None:
    assert losses_of(log_of(frame(0.0, "not_initialized"), frame(0.1, "lost"))) == []
    assert losses_of(EventLog()) == []


def test_every_loss_of_a_run_is_sorted_not_the_first_alone() -> None:
    update = event(3.4, "update_applied", gap_keyframes=2, pause_ms=2.0)
    events = [*walk(2.0), frame(2.0, "lost"), event(2.3, "relocalized"), frame(2.3), frame(3.3)]
    events += [update, frame(3.5, "lost"), event(5.0, "relocalized"), frame(5.0)]
    run = LostRun("edge", "key", 0, losses_of(log_of(*events, frame(5.4, "lost", inliers=41))))
    quiet = LostRun("edge", "other", 1, [])
    (first,), (every,) = by_cause([run, quiet]).rows, all_by_cause([run, quiet]).rows
    named = dict(zip(all_by_cause([run]).headings, every, strict=True))
    assert first[1] == "1/2"
    assert named["losses"] == "3" and named["per run"] == "1.5 (0 to 3)"
    causes = [named.get(str(cause), "") for cause in Cause]
    assert causes == ["1", "", "1", "1"]
    # The last loss came 0.4 s after a recovery without an update since, so it does not count.
    assert named["behind an update"] == "1" and named["relocalized"] == "1"


def test_an_update_before_the_recovery_took_nothing_of_it_away() -> None:
    update = event(2.2, "update_applied", gap_keyframes=2, pause_ms=2.0)
    events = [*walk(2.0), frame(2.0, "lost"), update, event(2.3, "relocalized"), frame(2.3)]
    losses = losses_of(log_of(*events, frame(2.5, "lost")))
    (row,) = all_by_cause([LostRun("edge", "key", 0, losses)]).rows
    assert row[-2:] == ["1", "0"]


def test_the_command_counts_losses_by_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lost = RawRun(duration_s=8, lost_at_s=((3.0, 3.6), (6.0, 6.4)), seed=3)
    folder = write_experiment(
        tmp_path,
        [
            (spec_of("edgeslam", "static", "none", 0), lost),
            (spec_of("orbslam2", "default", None, 0), RawRun(duration_s=8, edge=False)),
        ],
    )
    table = tmp_path / "losses.csv"
    code, out, err = slambed(
        "report", folder.name, "--losses", "--results", str(folder.parent), "-o", str(table)
    )
    assert code == ExitCode.OK, err
    assert "1/1" in out and "0/1" in out and "2 (2 to 2)" in out
    assert "view change" in out and "standstill" not in out
    rows = table.read_text().splitlines()
    assert rows[0].startswith("cell,run,repetition,number,seq_s,cause,missing_frames,found_s")
    assert len(rows) == 3
    code, out, err = slambed("losses", folder.name, "--json", "--results", str(folder.parent))
    assert code == ExitCode.OK and "'slambed report --losses' now" in err
    found = json.loads(out)
    assert found["experiment"] == folder.name
    reported = {run["cell"]: run["losses"] for run in found["runs"]}
    assert {cell: len(losses) for cell, losses in reported.items()} == {
        rows[1].split(",")[0]: 2,
        "orbslam2/room_walk": 0,
    }
    assert {loss["cause"] for losses in reported.values() for loss in losses} == {"view change"}
    assert "--json goes with --losses" in refused(ExitCode.BAD_INPUT, "report", "x", "--json")
    line = refused(ExitCode.BAD_INPUT, "report", "none", "--losses", "--results", str(tmp_path))
    assert "no results in" in line
    other = ("-o", str(tmp_path / "losses.txt"))
    line = refused(ExitCode.BAD_INPUT, "report", str(folder), "--losses", *other)
    assert "known: .csv, .md" in line
    assert "--again writes into" in refused(ExitCode.BAD_INPUT, "report", "x", "--again", *other)
    for more in ("--again", "--all", "--no-figures"):
        line = refused(ExitCode.BAD_INPUT, "report", str(folder), "--losses", more)
        assert "--losses writes no report; leave out" in line and more in line
    assert "name it" in refused(
        ExitCode.BAD_INPUT, "report", "--losses", "--results", str(folder.parent)
    )


def test_explain_says_why_and_shows_both_sides(tmp_path: Path) -> None:
    lost = RawRun(duration_s=4, lost_at_s=((2.0, 2.6),), seed=3)
    folder = write_experiment(tmp_path, [(spec_of("edgeslam", "static", "none", 0), lost)])
    (run,) = (folder / "runs").iterdir()
    target = tmp_path / "line.png"
    asked = ("explain", str(run), "--around", "loss", "-o", str(target))
    cache = {"SLAMBED_CACHE": str(tmp_path / "cache")}
    code, out, err = slambed(*asked, **cache)
    assert code == ExitCode.OK, err
    assert "why it was lost at 2.0" in out and "(view change): the view changed" in out
    assert "no pictures: the sequence is not prepared here" in out
    pictures = target.with_stem("line_loss")
    assert target.is_file() and not pictures.exists()

    walk = write_walk(tmp_path / "cache" / "prepared" / "walk", frames=40)
    manifest = json.loads((run / "manifest.json").read_text())
    (run / "manifest.json").write_text(json.dumps(manifest | {"sequence_checksum": walk.checksum}))
    code, out, err = slambed(*asked, **cache)
    assert code == ExitCode.OK, err
    assert f"pictures on both sides of the loss: {pictures}" in out
    assert pictures.read_bytes().startswith(b"\x89PNG")
