# SPDX-License-Identifier: Apache-2.0
"""A whole inference on short generated sequences, with real virtual runs."""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from checkout import needs_git
from command_line import refused, slambed
from infer_parts import plan_content, write_files
from virtual_parts import make_sequence, needs_programs

from slambed.campaign.store import RunStore
from slambed.errors import ExitCode

pytestmark = needs_programs


@dataclass(frozen=True)
class Room:
    """Two sequences, one of which has black frames for a while."""

    folder: Path

    @property
    def walk(self) -> str:
        return str(self.folder / "walk")

    @property
    def dark(self) -> str:
        return str(self.folder / "dark")

    def plan(self, folder: Path, **more: Any) -> Path:
        return write_files(folder, plan_content(self.walk, self.dark, **more), self.walk)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Room:
    found = Room(tmp_path_factory.mktemp("room"))
    make_sequence(found.folder / "walk", 3)
    black = ("--blackout-start-s", "1.5", "--blackout-end-s", "2.5")
    make_sequence(found.folder / "dark", 3, *black, name="dark")
    return found


def numbers(folder: Path, form: str = "dark") -> dict[str, Any]:
    content = json.loads((folder / "results/inference" / form / "inference.json").read_text())
    assert isinstance(content, dict)
    return content


def git(folder: Path, *arguments: str) -> None:
    named = ["-c", "user.name=n", "-c", "user.email=n@example.org"]
    subprocess.run(["git", "-C", folder, *named, *arguments], check=True, capture_output=True)


@needs_git
def test_what_was_open_is_found_and_predicts(room: Room, tmp_path: Path) -> None:
    plan = room.plan(tmp_path)
    git(tmp_path, "init")
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-m", "the plan before its runs")

    code, out, err = slambed("infer", str(plan), "--dry-run", cwd=tmp_path)
    assert code == 0, err
    assert "3 points, rounds of 5, 6 runs" in out and "committed in" in out
    assert not (tmp_path / "results").exists()

    code, out, err = slambed("infer", str(plan), cwd=tmp_path)
    assert code == 0, err
    found = numbers(tmp_path)
    best = found["points"][0]
    assert best["values"]["pictures"] == room.dark and best["counts"] == {
        "small.T1.losses.helped": [6, 6]
    }
    bright = [p for p in found["points"] if p["values"]["pictures"] == room.walk]
    assert bright and not any(p["kept"] for p in bright)
    assert found["registered"], found["registration"]
    assert found["stand_ins"] == ["dark"]  # the paper's sequence is the bright one
    fitted, held_out = found["fitted"], {b["cell"]: b for b in found["held_out"]}
    assert [b["inside"] for b in fitted] == [True]
    assert held_out["small.T1.losses.alone"]["inside"]
    assert held_out["small.T1.time.alone"]["low"] < held_out["small.T1.time.alone"]["high"]
    # On the bright sequence nothing is lost, so the printed 92 of 100 are far off.
    (light,) = (b for b in found["attribution"] if b["item"] == "pictures")
    assert light["counts"]["small.T1.losses.helped"] == [0, 6]
    page = (tmp_path / "results/inference/dark/index.html").read_text()
    assert found["digest"] in page and "committed unchanged" in page
    assert "is worth, of 6 runs per cell each" in page
    assert "<script" not in page and "http" not in page.replace("http://www.w3.org", "")

    # The second call executes nothing and writes the same page.
    before = RunStore(tmp_path / "results").keys()
    stamps = {k: (tmp_path / "results/runs" / k).stat().st_mtime_ns for k in before}
    code, _, err = slambed("infer", str(plan), cwd=tmp_path)
    assert code == 0, err
    assert numbers(tmp_path) == found
    assert RunStore(tmp_path / "results").keys() == before
    assert {k: (tmp_path / "results/runs" / k).stat().st_mtime_ns for k in before} == stamps

    # The plan is changed after the results: other criteria, the same runs.
    room.plan(tmp_path, within_log=4.0)
    code, _, err = slambed("infer", str(plan), cwd=tmp_path)
    assert code == 0, err
    bent = numbers(tmp_path)
    assert not bent["registered"] and bent["digest"] != found["digest"]
    message = " ".join(bent["registration"])
    assert f"under another plan: {found['digest']}" in message
    assert "dark.yaml has changes that are not committed" in message
    page = (tmp_path / "results/inference/dark/index.html").read_text()
    assert "Not as registered" in page


def test_an_inference_goes_on_where_it_was_interrupted(room: Room, tmp_path: Path) -> None:
    plan = room.plan(tmp_path)
    code, _, err = slambed("infer", str(plan), "--quick", cwd=tmp_path)
    assert code == 0, err
    whole = numbers(tmp_path, "dark-quick")
    assert not whole["registered"]  # nothing here is in git
    store = RunStore(tmp_path / "results")
    keys = store.keys()
    for key in keys[::2]:
        store.remove(key)
    code, _, err = slambed("infer", str(plan), "--quick", cwd=tmp_path)
    assert code == 0, err
    assert RunStore(tmp_path / "results").keys() == keys
    assert numbers(tmp_path, "dark-quick") == whole


@pytest.mark.parametrize(
    ("change", "output"),
    [
        ({"fit": ["small.T1.losses.helpd"]}, "small.T1.losses.helpd is no number"),
        ({"fit": ["small.T1.time.helped"]}, "only counts are fitted"),
        ({"experiments": ["gone.yaml"]}, "no such file"),
        ({"instead": {"nobody": {"variant": "static"}}}, "nobody is no system"),
        ({"full": {"points": 3, "first_runs": 5, "final_runs": 6, "predict_runs": 5,
                   "budget_runs": 20}}, "the budget is 20"),
    ],
)  # fmt: skip
def test_what_leads_to_no_runs_is_refused_in_one_line(
    room: Room, tmp_path: Path, change: dict[str, Any], output: str
) -> None:
    plan = room.plan(tmp_path, **change)
    assert output in refused(ExitCode.BAD_INPUT, "infer", str(plan), cwd=tmp_path)
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("item", "output"),
    [
        ({"set": "params.sync_perod_s", "range": [0.5, 5.0], "printed": 1.0}, "sync_perod_s"),
        ({"set": "params.sync_period_s", "range": [-3.0, 5.0], "printed": 1.0},
         "below the minimum"),
        ({"cases": {"a": {"helped": {"variant": "statc"}}, "b": {}}, "printed": "b"},
         "no variant 'statc'"),
        ({"cases": {"a": {"helped": {"params": {"n_orbs": 1}}}, "b": {}}, "printed": "b"},
         "unknown parameter 'n_orbs'"),
        ({"set": "profiles.lossy_wifi", "values": ["lossy_wifi", "lossy_wify"],
          "printed": "lossy_wifi"}, "lossy_wify"),
        ({"set": "datasets.elsewhere", "values": ["a", "b"], "printed": "a"}, "elsewhere"),
        ({"set": "devices.mobile.jitter.tracking", "range": [0.1, 0.2], "printed": 0.1},
         "no cost of stage 'tracking'"),
    ],
)  # fmt: skip
def test_what_cannot_be_set_is_refused_in_one_line(
    room: Room, tmp_path: Path, item: dict[str, Any], output: str
) -> None:
    plan = room.plan(tmp_path, open={"it": {"says": "it", **item}})
    line = refused(ExitCode.BAD_INPUT, "infer", str(plan), cwd=tmp_path)
    assert output in line and "dark.yaml line" in line
