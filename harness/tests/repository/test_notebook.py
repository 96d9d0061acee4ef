# SPDX-License-Identifier: Apache-2.0
"""`import slambed`: what a notebook does with results."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from data_samples import write_prepared
from results_factory import quickstart_like

import slambed
from slambed.campaign.runner import CampaignOutcome
from slambed.errors import SlambedError
from slambed.metrics.collect import EVENTS, SOME_EVENTS, write_some_events
from slambed.report.load import load


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> "slambed.Results":
    return slambed.Results(quickstart_like(tmp_path_factory.mktemp("results"), 2, 6.0))


def test_runs_and_cells_are_tables(results: "slambed.Results") -> None:
    assert len(results.runs) == 8 and {"label", "ate_rmse_m", "params.n_orb"} <= set(results.runs)
    assert list(results.cells["runs"]) == [2, 2, 2, 2]
    cell = results.cells.index[0]
    own = results.valid_runs[results.valid_runs["cell"] == cell]["ate_rmse_m"].astype(float)
    assert results.cells.loc[cell, "ate_rmse_m"] == pytest.approx(own.median())


def test_what_ended_a_campaign_early_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = CampaignOutcome(done=1, valid=1, interrupted=True, folder=Path("results/x"))
    monkeypatch.setattr("slambed.campaign.run_experiment.run_experiment", lambda *_: ended)
    with pytest.raises(KeyboardInterrupt):
        slambed.run("quickstart")
    ended.interrupted, ended.given_up = False, {"a1": "no device"}
    with pytest.raises(SlambedError, match=r"1 runs have no result: no device; .*results/x"):
        slambed.run("quickstart")


def test_events_of_all_runs_are_one_table(results: "slambed.Results") -> None:
    frames = results.events("frame_tracked")
    assert set(frames["type"]) == {"frame_tracked"} and frames["run_key"].nunique() == 8
    per_cell = frames.groupby("cell")["track_ms"].median()
    assert per_cell.between(20, 60).all() and "bytes" not in frames
    assert len(results.events()) > len(frames)
    # Whether a queue dropped a message is known also where none did.
    assert not results.events("message")["dropped"].any()


def test_events_of_the_kept_types_are_read(results: "slambed.Results", tmp_path: Path) -> None:
    """Like runs of `slambed results pack --events frame_tracked`."""
    folder = Path(shutil.copytree(results.folder, tmp_path / results.folder.name))
    for run in (folder / "runs").iterdir():
        write_some_events(run / EVENTS, ["frame_tracked"], run / SOME_EVENTS)
        (run / EVENTS).unlink()
    packed = slambed.Results(folder)
    frames = packed.events("frame_tracked")
    whole = results.events("frame_tracked")
    pd.testing.assert_frame_equal(frames, whole, check_dtype=False)  # whole numbers stay so
    assert not [line for line in packed.problems if "without events" in line]
    assert packed.events("message").empty and packed.events().empty
    assert packed.events("frame_tracked", "message").empty
    assert [line for line in packed.problems if "without events" in line] == [
        "8 of 8 runs are without events of message",
        "8 of 8 runs are without events",
        "8 of 8 runs are without events of frame_tracked, message",
    ]
    results.events(), results.events("message")
    assert not [line for line in results.problems if "without events" in line]


def test_samples_link_and_paths(results: "slambed.Results") -> None:
    assert {"mobile", "edge"} == set(results.samples()["node"])
    assert "probe_rtt_ms" in set(results.link()["series"])
    key = results.runs["run_key"].iloc[0]
    path = results.trajectory(key)
    assert list(path.columns) == ["t_s", "x", "y", "z", "qx", "qy", "qz", "qw"] and len(path) > 40
    assert len(results.groundtruth("room_walk")) > len(path)
    assert not results.trajectory(key, "live").equals(path)


def test_what_is_not_there_is_reported(results: "slambed.Results", tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="is not a folder"):
        slambed.Results(tmp_path / "nowhere")
    with pytest.raises(SlambedError, match="has no readable run"):
        slambed.Results(tmp_path)
    with pytest.raises(SlambedError, match="no trajectory 'best'"):
        results.trajectory(results.runs["run_key"].iloc[0], "best")
    with pytest.raises(SlambedError, match="has no trajectory"):
        results.trajectory("no_such_run")


def test_the_import_alone_loads_nothing() -> None:
    code = "import slambed, sys; sys.exit('pandas' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_an_experiment_from_python_is_checked_as_a_file_is(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="unknown system 'edgslam'"):
        slambed.run(
            {
                "id": "mine",
                "title": "mine",
                "systems": [{"system": "edgslam"}],
                "datasets": ["synthetic_room"],
            },
            engine="virtual",
            results=tmp_path,
        )


def test_results_say_what_they_are(results: "slambed.Results", tmp_path: Path) -> None:
    folder = results.folder
    labels = results.runs["label"].nunique()
    message = f"Results('{folder}', experiment='{folder.name}', systems={labels}, runs=8, valid=8)"
    assert str(results) == repr(results) == message
    # The repr of the underlying results has no tables either.
    assert repr(load(folder)) == message
    empty = tmp_path / "none"
    (empty / "runs").mkdir(parents=True)
    (empty / "experiment.json").write_text("{}")
    assert repr(load(empty)).endswith("experiment='none', systems=0, runs=0, valid=0)")
    path = load(folder).trajectory(results.runs["run_key"].iloc[0])
    assert re.fullmatch(r"Trajectory\(poses=\d+, seconds=\d+\.\d\)", repr(path))
    sequence = write_prepared(tmp_path / "here")
    assert repr(sequence) == f"PreparedSequence('{sequence.path}', 'tiny', sensor='rgbd', frames=4)"


def test_files_that_an_experiment_from_python_names_are_seen_from_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = {"id": "mine", "title": "mine", "systems": [{"system": "orbslam2"}]}
    with pytest.raises(SlambedError, match=f"there is no dataset file {tmp_path}/my/walk.yaml"):
        slambed.run(asked | {"datasets": ["./my/walk.yaml"]}, engine="virtual", results="out")
    asked |= {"systems": [{"system": "./my/system.yaml"}], "datasets": ["synthetic_room"]}
    with pytest.raises(SlambedError, match=f"no {tmp_path}/my/system.yaml"):
        slambed.run(asked, engine="local", results="out")
