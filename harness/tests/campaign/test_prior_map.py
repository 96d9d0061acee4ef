# SPDX-License-Identifier: Apache-2.0
"""A run that starts with the map of an earlier one, from YAML to result, in virtual time."""

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import refused, slambed
from harness_parts import run_spec
from virtual_parts import make_sequence, needs_programs

from slambed.engines.result import run_config
from slambed.errors import ExitCode, SlambedError
from slambed.spec import inputs

EXPERIMENT = """\
id: {id}
title: A short walk through a synthetic room
systems: [{{system: orbslam2, params: {{sequential: true, {params}}}}}]
datasets: [{sequence}]
playback: {{mode: every_frame, fps: 10}}
devices: {{mobile: host}}
engine: virtual
runs: {{default: 1}}
"""


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequence(tmp_path_factory.mktemp("synthetic") / "walk")


def experiment(folder: Path, name: str, sequence: Path, params: str) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(EXPERIMENT.format(id=name, sequence=sequence, params=params))
    return path


def run(folder: Path, name: str, sequence: Path, params: str) -> Path:
    """The folder of the only run of an experiment."""
    path = experiment(folder, name, sequence, params)
    code, out, err = slambed("run", str(path), "--no-figures", "--results", str(folder / "results"))
    assert code == ExitCode.OK, out + err
    (only,) = (folder / "results" / name / "runs").iterdir()
    return only


def summary(run_folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((run_folder / "summary.json").read_text())
    return content


@needs_programs
def test_a_run_goes_on_in_the_map_of_another(
    tmp_path: Path, sequence: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    first = run(tmp_path, "first", sequence, "save_map: true")
    assert summary(first)["relocalizations"] == 0
    (first / "map.slm").rename(tmp_path / "room.slm")
    # A relative path is resolved next to the experiment.
    second = run(tmp_path, "second", sequence, "prior_map: room.slm, save_map: true")
    assert summary(second)["relocalizations"] == 1
    assert summary(second)["frames_tracked"] == summary(second)["frames_total"]
    assert summary(second)["keyframes"] > summary(first)["keyframes"]
    assert (second / "map.slm").is_file()
    spec = json.loads((second / "manifest.json").read_text())["spec"]
    assert spec["inputs"] == {"prior_map": inputs.sha256_of(tmp_path / "room.slm")}

    whole = (tmp_path / "room.slm").read_bytes()
    (tmp_path / "room.slm").write_bytes(whole[:-100])
    path = tmp_path / "second.yaml"
    # A system that refuses its input has a result with its reason, like one that dies.
    again = ("run", str(path), "--no-figures", "--results", str(tmp_path / "results"))
    code, out, err = slambed(*again)
    assert code == ExitCode.NOT_ALL_GOOD, out + err
    assert "is cut or too long" in out + err
    (tmp_path / "room.slm").unlink()
    line = refused(ExitCode.BAD_INPUT, *again)
    assert "file 'room.slm' not found" in line and "second.yaml line 3" in line


def test_the_content_of_a_file_decides_the_run_not_its_place(tmp_path: Path) -> None:
    here, there = tmp_path / "a.slm", tmp_path / "b.slm"
    here.write_bytes(b"one map")
    there.write_bytes(b"one map")

    def key(path: Path) -> str:
        spec = run_spec(
            params={"prior_map": str(path)}, inputs={"prior_map": inputs.sha256_of(path)}
        )
        return spec.run_key

    assert key(here) == key(there)
    there.write_bytes(b"another map")
    assert key(here) != key(there)


def test_a_file_comes_into_the_run_folder_unchanged_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "a.slm"
    path.write_bytes(b"one map")
    digest = inputs.sha256_of(path)
    spec = run_spec(params={"prior_map": str(path)}, inputs={"prior_map": digest})
    run_dir = tmp_path / "run"
    run_dir.mkdir()
    inputs.copy_inputs(run_dir, {"prior_map": str(path)}, spec.inputs)
    inside = run_config(spec, "/sequence", str(run_dir), 1.0).params["prior_map"]
    assert Path(inside).read_bytes() == b"one map"
    path.write_bytes(b"another map")
    with pytest.raises(SlambedError, match="has changed since the campaign began"):
        inputs.copy_inputs(run_dir, {"prior_map": str(path)}, spec.inputs)
