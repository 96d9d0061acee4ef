# SPDX-License-Identifier: Apache-2.0
"""A corrected ground truth: metrics are recomputed without new runs."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import slambed
from path_files import write_path
from virtual_parts import needs_programs

from slambed.data.catalog import Catalog
from slambed.data.trajectory import Trajectory, read_tum
from slambed.errors import ExitCode
from slambed.metrics.digest import digest

pytestmark = needs_programs

EXPERIMENT = """\
id: corrected
title: A second of the generated room
systems: [{system: orbslam2}]
datasets: [synthetic_room]
playback: {mode: realtime, fps: 10, end_s: 2}
devices: {mobile: {device: host, name: phone, cores: 1, speed: 0.5}}
engine: virtual
runs: {default: 2}
"""


@pytest.fixture(autouse=True)
def short_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits the sequence to two of its twenty seconds and a third of its frames."""
    whole = Catalog.load()
    room = whole.get("synthetic_room")
    assert room.synthetic is not None
    options = room.synthetic.model_copy(update={"seconds": 2.3})
    room = room.model_copy(update={"synthetic": options, "fps": 10.0})
    short = dataclasses.replace(whole, datasets=whole.datasets | {room.id: room})
    monkeypatch.setattr(Catalog, "load", lambda: short)


def read(run: Path, name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((run / name).read_text())
    return found


def bend(path: Path) -> None:
    """Moves the true path by up to 10 cm, like a better calibration might."""
    old = read_tum(path)
    moved = old.positions_m + np.outer(np.sin(3 * old.stamps_s), [0.1, 0.0, 0.0])
    write_path(path, Trajectory(old.stamps_s, moved, old.quaternions_xyzw))


def test_from_the_prepared_path_to_digest_and_error(tmp_path: Path) -> None:
    (tmp_path / "corrected.yaml").write_text(EXPERIMENT)
    cache, results = tmp_path / "cache", tmp_path / "results"

    def command(*words: str) -> str:
        where = ("--results", str(results))
        code, out, err = slambed(*words, *where, cwd=tmp_path, SLAMBED_CACHE=str(cache))
        assert code == ExitCode.OK, out + err
        return out

    command("run", "corrected.yaml", "--no-figures")
    runs = sorted((results / "corrected" / "runs").iterdir())
    before = [(read(run, "summary.json"), read(run, "manifest.json")) for run in runs]
    measured = {path: path.stat() for run in runs for path in run.glob("*.parquet")}
    ledger = (results / "corrected" / "ledger.jsonl").read_bytes()
    assert len(runs) == 2 and len(measured) >= 4

    (truth,) = cache.glob("prepared/synthetic_room-*/groundtruth.txt")
    bend(truth)
    out = command("report", "corrected", "--again", "--no-figures")
    assert "the ground truth of synthetic_room has changed" in out
    assert "numbers of 2 runs computed again; changed: " in out and "ate_rmse_m (2)" in out

    for run, (summary, manifest) in zip(runs, before, strict=True):
        new = read(run, "summary.json")
        assert new["groundtruth"] != summary["groundtruth"]
        assert new["ate_rmse_m"] > 2 * summary["ate_rmse_m"]
        reported = read(run, "manifest.json")["results_sha256"]
        assert reported != manifest["results_sha256"] and reported == digest(run)
        # Values that do not depend on the ground truth are unchanged.
        assert new["frames_tracked"] == summary["frames_tracked"]
    for path, status in measured.items():
        now = path.stat()
        assert (now.st_ino, now.st_mtime_ns) == (status.st_ino, status.st_mtime_ns)
    assert (results / "corrected" / "ledger.jsonl").read_bytes() == ledger

    # The campaign still accepts the runs, and metrics of both ground truths are not mixed.
    assert "2 runs, 2 there already" in command("run", "corrected.yaml", "--no-figures")
    assert "changed: none" in command("report", "corrected", "--again", "--no-figures")


def test_of_a_dataset_that_was_given_by_path(tmp_path: Path) -> None:
    """It is in no catalog and no cache: only the experiment has its path."""
    made = Catalog.load().prepare("synthetic_room", tmp_path / "elsewhere")
    folder = made.path.rename(tmp_path / "my_room")
    experiment = EXPERIMENT.replace("synthetic_room", "./my_room").replace(
        "default: 2", "default: 1"
    )
    (tmp_path / "corrected.yaml").write_text(experiment)

    def command(*words: str) -> str:
        where = ("--results", str(tmp_path / "results"))
        cache = str(tmp_path / "cache")
        code, out, err = slambed(*words, *where, cwd=tmp_path, SLAMBED_CACHE=cache)
        assert code == ExitCode.OK, out + err
        return out

    command("run", "corrected.yaml", "--no-figures")
    (run,) = (tmp_path / "results" / "corrected" / "runs").iterdir()
    before = read(run, "summary.json")
    bend(folder / "groundtruth.txt")
    out = command("report", "corrected", "--again", "--no-figures")
    assert "the ground truth of synthetic_room has changed" in out and "ate_rmse_m (1)" in out
    after = read(run, "summary.json")
    assert after["ate_rmse_m"] > 2 * before["ate_rmse_m"]

    # Gone, or called from another folder: reported, because the stored ground truth may be
    # outdated.
    folder.rename(tmp_path / "moved")
    out = command("report", "corrected", "--again", "--no-figures")
    assert "note: ./my_room is not there; ground truth is what was kept beside the runs" in out
    assert read(run, "summary.json") == after
