# SPDX-License-Identifier: Apache-2.0
"""Recomputed numbers equal fresh ones, and are never mixed with old ones."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import slambed
from data_samples import write_prepared
from kept_summary import COMMAND, KEPT, summary_today
from path_files import write_path
from results_factory import RawRun, room_walk, spec_of, write_experiment

from slambed.data import places
from slambed.data.catalog import Catalog
from slambed.data.trajectory import Trajectory
from slambed.metrics import catalog, run_data
from slambed.metrics.catalog import METRICS_VERSION
from slambed.metrics.digest import digest
from slambed.report import recompute as again
from slambed.report.load import load
from slambed.report.recompute import prepared_truth, recompute, recompute_refused

RUNS = [
    (
        spec_of(system, variant, "ramp_85", repetition),
        RawRun(edge=system != "orbslam2", seed=number, lost_at_s=((4.0, 5.0),)),
    )
    for number, (system, variant, repetition) in enumerate(
        [("orbslam2", "default", 0), ("edgeslam", "static", 0), ("dynnetslam", "wh_wsz", 0)]
    )
]


def nothing(dataset: str, checksums: set[str]) -> Path | None:
    """Returns None: none of these datasets is on this machine."""
    return None


def summaries(experiment: Path) -> list[dict[str, Any]]:
    return [json.loads(p.read_text()) for p in sorted(experiment.glob("runs/*/summary.json"))]


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    return write_experiment(tmp_path / "stored", RUNS)


def changed_metric(monkeypatch: pytest.MonkeyPatch) -> None:
    """Changes the RPE and raises the metrics version."""
    monkeypatch.setattr(run_data, "RPE_DELTA_S", 2.0)
    monkeypatch.setattr(catalog, "METRICS_VERSION", METRICS_VERSION + 1)


def test_the_same_metrics_give_the_same_numbers(stored: Path) -> None:
    before = summaries(stored)
    done = recompute(stored, nothing)
    assert (done.runs, done.changed, done.problems) == (3, {}, [])
    assert summaries(stored) == before
    for folder in (stored / "runs").iterdir():
        manifest = json.loads((folder / "manifest.json").read_text())
        assert manifest["results_sha256"] == digest(folder)


def test_a_changed_metric_computed_again_equals_a_fresh_campaign(
    stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = summaries(stored)
    changed_metric(monkeypatch)
    fresh = summaries(write_experiment(tmp_path / "fresh", RUNS))
    assert [s["rpe_trans_m"] for s in fresh] != [s["rpe_trans_m"] for s in old]
    done = recompute(stored, nothing)
    assert summaries(stored) == fresh
    assert done.changed == {"metrics_version": 3, "rpe_trans_m": 3, "rpe_rot_deg": 3}
    assert "changed: metrics_version (3), rpe_trans_m (3), rpe_rot_deg (3)" in done.lines()[0]


def test_versions_are_not_mixed(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changed_metric(monkeypatch)
    whole = load(stored)
    assert len(whole.valid_runs) == 3
    assert any(f"all numbers are of metrics version {METRICS_VERSION}" in p for p in whole.problems)
    again.recompute_run(stored / "runs" / f"{0:016x}", None)
    mixed = load(stored)
    assert list(mixed.valid_runs["run_key"]) == [f"{0:016x}"]
    assert any("2 of 3 runs are left out" in line and "--again" in line for line in mixed.problems)
    done = recompute_refused(stored)
    assert done is not None and done.runs == 2
    assert len(load(stored).valid_runs) == 3
    assert recompute_refused(stored) is None


def test_a_system_with_other_own_metrics_is_of_another_version(stored: Path) -> None:
    """Versions may differ between systems, but not within one."""
    versions = {s["system"]: s["metrics_version"] for s in summaries(stored)}
    assert versions["orbslam2"] == versions["edgeslam"] == str(METRICS_VERSION)
    assert versions["dynnetslam"].startswith(f"{METRICS_VERSION}+")
    assert load(stored).refused == []


def test_a_corrected_ground_truth_changes_the_error(stored: Path, tmp_path: Path) -> None:
    before = summaries(stored)
    walk = room_walk(12.0)
    bent = walk.positions_m + np.outer(np.sin(walk.stamps_s), [0.1, 0.0, 0.0])
    corrected = tmp_path / "corrected.txt"
    write_path(corrected, Trajectory(walk.stamps_s, bent, walk.quaternions_xyzw))
    done = recompute(stored, lambda *_: corrected)
    assert done.truths == ["room_walk"]
    assert done.lines()[0] == "the ground truth of room_walk has changed"
    for old, new in zip(before, summaries(stored), strict=True):
        assert new["groundtruth"] != old["groundtruth"]
        assert new["ate_rmse_m"] > 2 * old["ate_rmse_m"]
    assert (stored / "groundtruth" / "room_walk.txt").read_bytes() == corrected.read_bytes()
    assert recompute(stored, lambda *_: corrected).changed == {}


def test_runs_judged_by_another_truth_are_left_out_until_then(stored: Path) -> None:
    kept = stored / "groundtruth" / "room_walk.txt"
    kept.write_text(kept.read_text() + "# corrected\n")
    found = load(stored)
    assert len(found.refused) == 3
    assert any("judged by another ground truth" in line for line in found.problems)
    recompute(stored, nothing)
    assert load(stored).refused == []


@pytest.mark.parametrize(
    ("old", "outcome", "valid", "why"),
    [
        ({"outcome": "mobile_died", "invalid_reason": "signal 11"}, "died", True, "signal 11"),
        ({"outcome": "timeout"}, "timed_out", True, None),
        ({"outcome": "completed", "invalid_reason": "half the quota"}, "completed", False, None),
        ({"outcome": "link_died", "invalid_reason": "relay"}, "completed", False, None),
    ],
)
def test_an_old_run_keeps_its_validity(
    stored: Path, old: dict[str, Any], outcome: str, valid: bool, why: str | None
) -> None:
    """Recomputing numbers does not make an invalid run valid."""
    path = stored / "runs" / f"{0:016x}" / "manifest.json"
    manifest = json.loads(path.read_text())
    for key in ("invalid_reasons", "outcome_reason"):
        manifest.pop(key, None)
    path.write_text(json.dumps(manifest | old))
    recompute(stored, nothing)
    found = summaries(stored)[0]
    assert (found["outcome"], found["valid"], found["outcome_reason"]) == (outcome, valid, why)


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda run: (run / "events.parquet").unlink(), "without events.parquet"),
        (lambda run: (run / "events.parquet").write_bytes(b"PAR1"), "events.parquet: unreadable"),
        (lambda run: (run / "manifest.json").write_text("{"), "without a whole manifest"),
    ],
)
def test_a_run_without_its_files_keeps_its_numbers_and_is_reported(
    stored: Path, spoil: Any, why: str
) -> None:
    run = stored / "runs" / f"{1:016x}"
    before = (run / "summary.json").read_bytes()
    spoil(run)
    done = recompute(stored, nothing)
    assert done.runs == 2
    assert len(done.problems) == 1 and why in done.problems[0]
    assert (run / "summary.json").read_bytes() == before


def test_one_camera_stays_up_to_its_scale_when_its_sequence_is_gone(tmp_path: Path) -> None:
    experiment = write_experiment(tmp_path, RUNS[:1])
    path = experiment / "runs" / f"{0:016x}" / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"ate_alignment": "sim3"}))
    recompute(experiment, nothing)
    assert json.loads(path.read_text())["ate_alignment"] == "sim3"


def test_the_command(stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changed_metric(monkeypatch)
    code, out, err = slambed("report", str(stored), "--again", "--no-figures")
    assert code == 0, err
    assert "numbers of 3 runs computed again" in out
    assert {s["metrics_version"].partition("+")[0] for s in summaries(stored)} == {
        str(METRICS_VERSION + 1)
    }


def same(found: object, kept: object) -> bool:
    """Returns whether two values are equal within the differences of linear algebra libraries."""
    if isinstance(found, float) and isinstance(kept, float):
        return found == pytest.approx(kept, rel=1e-9)
    return found == kept


def test_whoever_changes_a_metric_counts_its_version_up(tmp_path: Path) -> None:
    kept = json.loads(KEPT.read_text())
    found = summary_today(tmp_path)
    changed = [
        key
        for key, value in found.items()
        if not same(value, kept["summary"].get(key)) or key not in kept["summary"]
    ]
    if kept["version"] == METRICS_VERSION:
        assert changed == [], f"other values: count METRICS_VERSION up, then {COMMAND}"
    assert kept["version"] == METRICS_VERSION, f"a new version: {COMMAND}"
    assert list(found) == list(kept["summary"])


def test_the_truth_of_other_frames_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A dataset may be prepared again from another source, with the path of another camera."""
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path))
    recipe = Catalog.load().resolve("synthetic_room")
    made = write_prepared(places.prepared_folder() / f"{recipe.id}-0123456789ab")
    header = made.path / "sequence.json"
    content = json.loads(header.read_text())
    header.write_text(json.dumps(content | {"source": {"recipe": recipe.content_key()}}))
    assert prepared_truth("synthetic_room", {made.checksum, "other"}) == made.groundtruth_file
    assert prepared_truth("synthetic_room", {"other"}) is None
    assert prepared_truth("nobody_knows_it", {made.checksum}) is None
