# SPDX-License-Identifier: Apache-2.0
"""Dataset files outside of the checkout."""

import shlex
from pathlib import Path

import pytest
from command_line import refused, slambed
from data_samples import one_line, write_tum
from virtual_parts import needs_programs, plan_of

from slambed.data.catalog import Catalog
from slambed.errors import ExitCode, SlambedError
from slambed.spec.library import Library

EXPERIMENT = """\
id: one
title: one
systems: [{{system: orbslam2}}]
datasets: [{dataset}]
playback: {{end_s: 0.2}}
engine: virtual
"""
SMALL = "synthetic: {trajectory: spline, seconds: 1, width: 160, height: 120}\nfps: 5\n"
RECORDED = (
    "reader: tum\npaths: [walk]\ndepth_unit_m: 0.0002\n"
    "camera: {width: 8, height: 6, fx: 5, fy: 5, cx: 4, cy: 3, bf: 1}\n"
)


def write_dataset(path: Path, name: str, text: str = SMALL) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"id: {name}\ntitle: Mine\n{text}")
    return path


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("SLAMBED_DATASETS", raising=False)
    return tmp_path / "cache"


@needs_programs
@pytest.mark.parametrize("file", ["mine.yaml", "mine/dataset.yaml"])
def test_an_experiment_names_a_file_as_seen_from_it(tmp_path: Path, file: str) -> None:
    write_dataset(tmp_path / "lab" / file, "mine")
    path = tmp_path / "lab" / "one.yaml"
    path.write_text(EXPERIMENT.format(dataset=f"./{file}"))
    experiment, _ = Library().experiment(str(path))
    assert experiment.datasets == [str(tmp_path / "lab" / file)]
    code, out, err = slambed("run", str(path), "--check", cwd=tmp_path)
    assert code == ExitCode.OK and out.startswith(f"{path}: good"), err
    by_path = plan_of(path)
    assert {spec.dataset for spec in by_path.specs} == {"mine"}
    assert {spec.cell for spec in by_path.specs} == {"orbslam2/mine"}


@needs_programs
def test_what_a_run_means_does_not_hang_on_where_its_dataset_file_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_dataset(tmp_path / "lab" / "mine.yaml", "mine")
    path = tmp_path / "one.yaml"
    path.write_text(EXPERIMENT.format(dataset="./lab/mine.yaml"))
    by_path = [spec.run_key for spec in plan_of(path).specs]
    monkeypatch.setenv("SLAMBED_DATASETS", f"/nowhere:{tmp_path / 'lab'}")
    path.write_text(EXPERIMENT.format(dataset="mine"))
    assert [spec.run_key for spec in plan_of(path).specs] == by_path


def test_folders_of_datasets_are_listed_and_known(tmp_path: Path) -> None:
    write_dataset(tmp_path / "lab" / "mine.yaml", "mine")
    write_dataset(tmp_path / "lab" / "other" / "dataset.yaml", "other")
    own = {"SLAMBED_DATASETS": f"/nowhere:{tmp_path / 'lab'}", "COLUMNS": "200"}
    code, out, err = slambed("data", "list", **own)
    assert code == ExitCode.OK, err
    rows = {line.split()[0]: line for line in out.splitlines() if line.strip()}
    assert "generated" in rows["mine"] and "generated" in rows["other"]
    assert "synthetic_room" in rows
    code, out, _ = slambed("data", "where", **own)
    assert f"{tmp_path / 'lab'}  (dataset files)" in out
    assert "/nowhere  (dataset files, does not exist)" in out
    assert "mine" not in {line.split()[0] for line in slambed("data", "list")[1].splitlines()}


def test_a_source_may_lie_beside_the_file(tmp_path: Path) -> None:
    write_tum(tmp_path / "lab" / "walk")
    file = write_dataset(tmp_path / "lab" / "mine.yaml", "mine", RECORDED)
    catalog = Catalog.load(search=[tmp_path / "nothing"])
    assert catalog.locate(catalog.get(str(file))) == tmp_path / "lab" / "walk"
    part = write_dataset(tmp_path / "lab" / "part.yaml", "part", "window_of: mine\n")
    catalog = Catalog.load(search=[tmp_path / "nothing"])
    assert catalog.whole(catalog.get(str(part))).id == "mine"
    assert catalog.available(catalog.get(str(part)))


def test_an_id_of_ours_is_refused_in_one_line(tmp_path: Path) -> None:
    file = write_dataset(tmp_path / "lab" / "synthetic_room.yaml", "synthetic_room")
    message = "'synthetic_room' is already taken by"
    line = refused(ExitCode.BAD_INPUT, "data", "show", str(file))
    assert (
        f"{file}: {message}" in line
        and "catalog/datasets/synthetic_room.yaml; give it another id" in line
    )
    path = tmp_path / "one.yaml"
    path.write_text(EXPERIMENT.format(dataset="./lab/synthetic_room.yaml"))
    line = refused(ExitCode.BAD_INPUT, "run", str(path), "--check")
    assert message in line and "one.yaml line 4" in line
    # A user with such a file on the search path expects it, but would get ours.
    own = {"SLAMBED_DATASETS": str(tmp_path / "lab")}
    path.write_text(EXPERIMENT.format(dataset="synthetic_room"))
    assert message in refused(ExitCode.BAD_INPUT, "run", str(path), "--check", **own)
    path.write_text(EXPERIMENT.format(dataset="synthetic_office"))
    assert slambed("run", str(path), "--check", **own)[0] == ExitCode.OK
    code, _, err = slambed("data", "list", **own)
    assert code == ExitCode.BAD_INPUT and message in err and err.count("\n") == 1


def test_a_file_that_is_not_there_or_has_another_name_is_one_line(tmp_path: Path) -> None:
    line = refused(ExitCode.BAD_INPUT, "data", "prepare", str(tmp_path / "no.yaml"))
    assert f"there is no dataset file {tmp_path / 'no.yaml'}" in line
    file = write_dataset(tmp_path / "mine" / "dataset.yaml", "yours")
    with pytest.raises(SlambedError) as error:
        Catalog.load().get(str(file))
    assert "the id is 'yours'" in one_line(error) and "name its folder yours" in one_line(error)


@needs_programs
def test_what_a_new_dataset_says_comes_next_works(tmp_path: Path) -> None:
    folder = tmp_path / "my lab"
    code, out, err = slambed("new", "dataset", "my_walk", "--folder", "my lab", cwd=tmp_path)
    assert code == ExitCode.OK, err
    file = folder / "my_walk.yaml"
    # Only as many frames as the test needs.
    file.write_text(
        file.read_text().replace("seconds: 20", "seconds: 1\n  width: 160\n  height: 120")
    )
    written, *following, last = out.splitlines()
    assert written == "my lab/my_walk.yaml"
    commands = [line.removeprefix("next:").split("slambed ", 1)[1] for line in following]
    assert commands == [f"data {verb} 'my lab/my_walk.yaml'" for verb in ("prepare", "show")]
    for line in commands:
        code, out, err = slambed(*shlex.split(line), cwd=tmp_path)
        assert code == ExitCode.OK and "30 frames" in out, err
    named = last.removeprefix("then, in an experiment beside it: datasets: [").removesuffix("]")
    (folder / "one.yaml").write_text(EXPERIMENT.format(dataset=named))
    assert slambed("run", "my lab/one.yaml", "--check", cwd=tmp_path)[0] == ExitCode.OK


def test_a_system_in_the_home_folder_is_named_by_a_tilde(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    text = EXPERIMENT.format(dataset="quickstart").replace("orbslam2", "~/mine/system.yaml")
    (tmp_path / "lab").mkdir()
    path = tmp_path / "lab" / "one.yaml"
    path.write_text(text)
    experiment, _ = Library().experiment(str(path))
    assert experiment.systems[0].system == str(tmp_path / "mine" / "system.yaml")
