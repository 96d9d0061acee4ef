# SPDX-License-Identifier: Apache-2.0
"""`--json` prints one document on standard output and nothing else, with the exit code of the text
output."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from command_line import refused, slambed, slambed_process
from virtual_parts import make_sequence, needs_programs, write_experiment

from slambed.campaign.prepared_inputs import RECORD
from slambed.data.catalog import Catalog
from slambed.errors import ExitCode
from slambed.link.profile import profile_names
from slambed.spec.library import Library


def document(*arguments: str, code: int = 0) -> Any:
    found, out, err = slambed(*arguments, "--json")
    assert found == code, err
    return json.loads(out)


@pytest.mark.parametrize(
    ("verb", "names"),
    [
        ("systems", Library().systems()),
        ("devices", Library().devices()),
        ("experiments", Library().experiments()),
        ("profiles", profile_names()),
    ],
)
def test_lists_have_an_entry_for_each_file(verb: str, names: list[str]) -> None:
    found = document(verb)
    assert [item["name"] for item in found] == names
    assert all("title" in item or "description" in item or "error" in item for item in found)


def test_a_file_that_cannot_be_read_is_an_entry_with_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments/torn.yaml").write_text("id: torn\ntitle: [\n")
    monkeypatch.setattr("slambed.spec.library.repository_root", lambda: tmp_path)
    (found,) = document("experiments")
    assert found["name"] == "torn" and "not YAML" in found["error"]


def test_a_profile_says_its_range_and_its_definition(tmp_path: Path) -> None:
    found = document("profiles", "show", "ramp_85")
    assert found["rtt_range_ms"] == [0.0, 85.0] and "rtt_ms" in found["definition"]


PROFILE = "name: größer\ndescription: 20 ± 5 ms\nrtt_ms: {constant: 20}\n"


def encoded(name: str) -> dict[str, str]:
    """Returns the environment of a program whose standard streams have this encoding."""
    return {"PYTHONIOENCODING": name, "PYTHONUTF8": "0", "LC_ALL": "C.UTF-8"}


def test_an_output_of_ascii_holds_the_same_document(tmp_path: Path) -> None:
    (tmp_path / "größer.yaml").write_text(PROFILE, encoding="utf-8")
    command = ("profiles", "show", "größer.yaml")
    code, out, err = slambed_process(*command, "--json", cwd=tmp_path, **encoded("ascii"))
    assert (code, err) == (ExitCode.OK, "") and out.isascii()
    found = json.loads(out)
    assert found == json.loads(slambed(*command, "--json", cwd=tmp_path)[1])
    assert (found["name"], found["description"]) == ("größer", "20 ± 5 ms")


def test_an_error_line_tells_a_character_that_its_stream_lacks(tmp_path: Path) -> None:
    latin = encoded("latin-1")
    code, _, err = slambed_process("profiles", "show", "ω.yaml", cwd=tmp_path, **latin)
    assert code == ExitCode.BAD_INPUT and r"\u03c9.yaml" in err


def test_datasets_say_whether_they_are_here() -> None:
    found = {item["id"]: item for item in document("data", "list")}
    assert list(found) == list(Catalog.load().datasets)
    assert found["synthetic_room"]["state"] in ("generated", "prepared")


def test_networks_and_inputs_say_what_their_files_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path))
    (people,) = [item for item in document("masks", "list") if item["name"] == "slambed_people"]
    assert people["license"] and people["size_bytes"] > 0
    found = document("inputs", "list")
    assert [item["name"] for item in found] == Library().inputs()
    assert all(item["yields"] and item["made"] is None for item in found)
    name = found[0]["name"]
    folder = tmp_path / "inputs" / f"{name}-0123"
    folder.mkdir(parents=True)
    (folder / "map.bin").write_bytes(b"x")
    record = {"id": name, "file": "map.bin", "sha256": "00", "found": {"coverage": 1.0}}
    (folder / RECORD).write_text(json.dumps(record))
    made = document("inputs", "show", name)["made"]
    assert made == {"path": str(folder / "map.bin")} | record
    assert "unknown input" in refused(2, "inputs", "show", "nothing", "--json")


def test_papers_and_what_is_wrong_with_them() -> None:
    assert {"dynnetslam", "cloudslam"} <= {item["id"] for item in document("papers", "list")}
    assert document("papers", "lint", "dynnetslam") == {"papers": ["dynnetslam"], "problems": []}


def test_status_of_what_was_never_run(tmp_path: Path) -> None:
    found = document("status", "quickstart", "--results", str(tmp_path))
    assert found["complete"] is False and found["cells"] == []
    assert "0 of 9 runs" in found["notes"][0]


@needs_programs
def test_status_counts_the_runs_of_each_cell(tmp_path: Path) -> None:
    sequence = make_sequence(tmp_path / "walk", 2)
    path = write_experiment(tmp_path, sequence, runs=1)
    place = ("--results", str(tmp_path / "results"))
    assert slambed("run", str(path), "--no-figures", *place)[0] == 0
    found = document("status", "walk", *place)
    assert found["complete"] is True and len(found["cells"]) == 2
    assert all(c["valid"] == 1 and not c["missing"] for c in found["cells"])
    gone = next((tmp_path / "results/runs").iterdir())
    shutil.rmtree(gone)
    found = document("status", "walk", *place, code=1)
    assert [c["missing"] for c in found["cells"]].count(1) == 1
    sizes = document("results", "size", *place)
    assert sizes["experiments"]["walk"]["runs"] == 1 and sizes["in_no_plan"]["runs"] == 0


def test_sizes_are_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path))
    (tmp_path / "features").mkdir()
    (tmp_path / "features/a.features").write_bytes(bytes(10_000))
    kinds = document("cache", "size")["kinds"]
    assert kinds["features"]["items"] == 1 and kinds["features"]["bytes"] >= 10_000
    assert kinds["prepared"] == {"items": 0, "bytes": 0, "unused_days_max": None}


def test_the_doctor_says_whether_anything_can_run() -> None:
    code, out, _ = slambed("doctor", "--json")
    found = json.loads(out)
    assert found["can_run"] == (code == 0)
    assert {"topic", "level", "found", "cost"} == set(found["findings"][0])


def test_errors_of_a_trajectory_are_numbers(tmp_path: Path) -> None:
    path = tmp_path / "walk.txt"
    path.write_text("".join(f"{t} {t * t} {t} 0 0 0 0 1\n" for t in range(5)))
    found = document("evaluate", str(path), str(path))
    assert found["ate_m"]["pairs"] == 5 and found["ate_m"]["rmse"] < 1e-9
    assert found["rpe"]["translation_m"]["rmse"] < 1e-9 and found["rpe"]["delta"] == "1 s"


def test_an_error_stays_a_line(tmp_path: Path) -> None:
    line = refused(2, "results", "size", "--json", "--results", str(tmp_path / "none"))
    assert "no such folder" in line
