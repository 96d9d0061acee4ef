# SPDX-License-Identifier: Apache-2.0
"""The error of stored runs against a reference run: unaligned, of live poses, in one sequence."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from path_files import write_path
from results_factory import quickstart_like

from slambed.data.trajectory import Trajectory, read_tum
from slambed.papers.lookup import pool_of
from slambed.papers.measured import measure
from slambed.papers.published import Paper
from slambed.papers.reference_runs import live_path, reference_errors
from slambed.report.load import Results, load


def shifted(path: Trajectory, by_m: float) -> Trajectory:
    moved = path.positions_m + np.array([0.0, 0.0, by_m])
    return Trajectory(path.stamps_s, moved, path.quaternions_xyzw)


@pytest.fixture
def stored(tmp_path: Path) -> Results:
    return load(quickstart_like(tmp_path, repetitions=1, duration_s=3.0))


def split(stored: Results) -> tuple[pd.DataFrame, pd.DataFrame]:
    runs = stored.valid_runs.assign(experiment_folder=stored.name)
    alone = runs["system"].eq("orbslam2")
    return runs[~alone], runs[alone]


def rewrite(stored: Results, key: str, path: Trajectory) -> None:
    write_path(stored.folder / "runs" / key / "trajectory_live.txt", path)


def test_drift_stays_and_a_reference_gone_astray_is_not_taken(stored: Results) -> None:
    own, references = split(stored)
    extra = references.iloc[[0]].assign(run_key="extra")
    references = pd.concat([references, extra], ignore_index=True)
    first = read_tum(stored.folder / "runs" / references["run_key"][0] / "trajectory_live.txt")
    (stored.folder / "runs" / "extra").mkdir()
    for key, offset in zip(references["run_key"], (0.0, 0.1, 50.0), strict=True):
        rewrite(stored, key, shifted(first, offset))
    for key in own["run_key"]:
        rewrite(stored, key, shifted(first, 3.1))
    found = reference_errors({stored.name: stored}, own, references)
    assert list(found.index) == list(own.index)
    assert found.to_numpy() == pytest.approx(3.0)  # against the one at 0.1 m, never that at 50 m


def test_what_has_no_path_has_no_error(stored: Results) -> None:
    own, references = split(stored)
    results = {stored.name: stored}
    first, second = own["run_key"]
    (stored.folder / "runs" / first / "trajectory_live.txt").unlink()
    (stored.folder / "runs" / second / "trajectory_live.txt").write_text("no path\n")
    assert live_path(results, stored.name, first) is None
    assert reference_errors(results, own, references).isna().all()
    assert reference_errors(results, own, references.iloc[:0]).isna().all()
    elsewhere = references.assign(dataset="another_room")
    assert reference_errors(results, own, elsewhere).isna().all()


@pytest.fixture
def paper() -> Paper:
    """Returns a paper that judges Edge-SLAM by ORB-SLAM2's path, as CloudSLAM does for itself."""
    return Paper.model_validate(
        {
            "id": "p",
            "kind": "paper",
            "paper": {"title": "t", "authors": ["a"], "venue": "v", "year": 2020},
            "systems": {
                "orb": {"label": "ORB-SLAM2", "match": {"system": "orbslam2"}},
                "edge": {"label": "Edge-SLAM", "match": {"system": "edgeslam"}},
                "other": {"label": "another", "match": {"system": "cloudslam"}},
            },
            "datasets": {"room": {"label": "room", "match": ["room_walk"]}},
            "conditions": {"link": {"ramp": {"profile": "ramp_85"}}},
            "metrics": {
                "rmse": {
                    "key": "rmse_vs_reference_live_m",
                    "reference": "orb",
                    "statistic": "mean",
                    "scale": 100,
                    "better": "lower",
                }
            },
        }
    )


def test_a_published_error_against_a_system_is_measured_against_its_run(
    stored: Results, paper: Paper
) -> None:
    own, references = split(stored)
    first = read_tum(stored.folder / "runs" / references["run_key"].iloc[0] / "trajectory_live.txt")
    for key in references["run_key"]:
        rewrite(stored, key, first)
    for key in own["run_key"]:
        rewrite(stored, key, shifted(first, 2.0))
    conditions = {"dataset": "room", "link": "ramp"}
    found = measure(paper, pool_of([stored]), "rmse", "edge", conditions)
    assert found.values == pytest.approx([200.0])  # in the paper's centimeters
    without = stored.runs[~stored.runs["system"].eq("orbslam2")]
    stored.runs = without
    reported = measure(paper, pool_of([stored]), "rmse", "edge", conditions)
    assert not reported.there
    assert reported.found.reason == "ORB-SLAM2: no valid run yet"


def with_cores(paper: Paper) -> Paper:
    cores = {1: {"device_mobile": "half_core"}, 4: {"device_mobile": "host"}}
    period = {"column": "params.period_s"}
    return paper.model_copy(
        update={"conditions": paper.conditions | {"cores": cores, "period_s": period}}
    )


def both_devices(stored: Results) -> None:
    """Adds each run once more on another device; the reference there is 5 m off."""
    own, references = split(stored)
    first = read_tum(stored.folder / "runs" / references["run_key"].iloc[0] / "trajectory_live.txt")
    copies = []
    for runs, offset in ((own, 2.0), (references, 0.0)):
        for key in runs["run_key"]:
            other = f"{key}_on_host"
            (stored.folder / "runs" / other).mkdir()
            rewrite(stored, key, shifted(first, offset))
            rewrite(stored, other, shifted(first, 5.0 if offset == 0.0 else offset))
        copy = stored.runs[stored.runs["run_key"].isin(runs["run_key"])]
        copies.append(copy.assign(run_key=copy["run_key"] + "_on_host", device_mobile="host"))
    stored.runs = pd.concat([stored.runs, *copies], ignore_index=True)
    # Only the offloading system has this parameter.
    period = np.where(stored.runs["system"].eq("orbslam2"), np.nan, 0.5)
    stored.runs["params.period_s"] = period


def test_the_reference_was_run_under_the_conditions_of_the_number(
    stored: Results, paper: Paper
) -> None:
    both_devices(stored)
    conditions = {"dataset": "room", "link": "ramp", "period_s": 0.5}
    for cores, error_cm in ((1, 200.0), (4, 300.0)):
        asked = conditions | {"cores": cores}
        found = measure(with_cores(paper), pool_of([stored]), "rmse", "edge", asked)
        assert found.values == pytest.approx([error_cm])


def test_no_reference_of_other_conditions_is_taken_instead(stored: Results, paper: Paper) -> None:
    both_devices(stored)
    elsewhere = stored.runs["system"].eq("orbslam2") & stored.runs["device_mobile"].eq("host")
    stored.runs = stored.runs[~elsewhere]
    asked = {"dataset": "room", "link": "ramp", "cores": 4}
    found = measure(with_cores(paper), pool_of([stored]), "rmse", "edge", asked)
    assert not found.there
    assert found.found.reason == "ORB-SLAM2: no run with cores = 4"


def test_the_reference_is_sought_on_the_sequence_of_the_runs(stored: Results, paper: Paper) -> None:
    both_devices(stored)
    room = paper.datasets["room"].model_copy(update={"match": [], "stand_in": ["hall", "room_*"]})
    paper = with_cores(paper).model_copy(update={"datasets": {"room": room}})
    hall = stored.runs[stored.runs["system"].eq("orbslam2")]
    extra = hall.assign(run_key=hall["run_key"] + "_hall", dataset="hall")
    stored.runs = pd.concat([stored.runs, extra], ignore_index=True)
    asked = {"dataset": "room", "link": "ramp", "cores": 1}
    found = measure(paper, pool_of([stored]), "rmse", "edge", asked)
    assert found.values == pytest.approx([200.0])
