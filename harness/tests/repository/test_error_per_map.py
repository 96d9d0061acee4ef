# SPDX-License-Identifier: Apache-2.0
"""Each map of a run is aligned on its own."""

import json
import re
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from results_factory import RawRun, spec_of, write_experiment

from slambed.native import repository_root

MAIN = runpy.run_path(str(repository_root() / "tools" / "error_per_map.py"))["main"]


def in_two_maps(root: Path) -> Path:
    """A run that is lost for a second and goes on in a new map, with an origin of its own."""
    spec = spec_of("orb_slam3", "default", None, 0)
    folder = write_experiment(
        root, [(spec, RawRun(duration_s=8.0, edge=False, lost_at_s=((3.0, 4.0),)))]
    )
    (run,) = (folder / "runs").iterdir()
    events = pd.read_parquet(run / "events.parquet")
    assert list(events["type"]).count("relocalized") == 1
    events["type"] = events["type"].astype(str).replace("relocalized", "initialized")
    events.to_parquet(run / "events.parquet")
    poses = np.loadtxt(run / "trajectory.txt")
    poses[poses[:, 0] > poses[0, 0] + 3.5, 1:4] += [50.0, -20.0, 5.0]
    np.savetxt(run / "trajectory.txt", poses, fmt="%.9f")
    return folder


def test_a_new_origin_is_no_error_of_its_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = in_two_maps(tmp_path)
    (summary,) = folder.glob("runs/*/summary.json")
    before_cm = 100 * json.loads(summary.read_text())["ate_rmse_m"]
    monkeypatch.setattr("sys.argv", ["error_per_map.py", str(folder)])
    assert MAIN() == 0
    line = capsys.readouterr().out.strip()
    found = re.findall(r"([\d.]+) cm of (\d+) poses", line)
    assert line.startswith("orb_slam3/room_walk #1: ") and len(found) == 2
    for error_cm, _ in found:
        assert float(error_cm) < 3 * before_cm < 1000
    assert sum(int(poses) for _, poses in found) == len(
        np.loadtxt(next(folder.glob("runs/*/trajectory.txt")))
    )


def test_a_system_that_reads_a_folder_has_one_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = in_two_maps(tmp_path)
    (file,) = folder.glob("runs/*/events.parquet")
    events = pd.read_parquet(file)
    events[events["type"] != "frame_tracked"].to_parquet(file)
    monkeypatch.setattr("sys.argv", ["error_per_map.py", str(folder)])
    assert MAIN() == 0
    found = re.findall(r"[\d.]+ cm of (\d+) poses", capsys.readouterr().out)
    assert found == [str(len(np.loadtxt(next(folder.glob("runs/*/trajectory.txt")))))]


def test_a_folder_without_results_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["error_per_map.py", str(tmp_path / "none")])
    assert MAIN() == 2
    assert capsys.readouterr().err.startswith("error: no results, ")
