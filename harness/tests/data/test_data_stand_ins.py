# SPDX-License-Identifier: Apache-2.0
"""Stand-ins for missing recordings: part of the checkout, and reported."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import refused, slambed
from data_samples import one_line, write_tum

from slambed.campaign import plan
from slambed.data.catalog import Catalog
from slambed.data.download import how_to_get
from slambed.data.trajectory import read_groundtruth
from slambed.errors import ExitCode, MissingDataError
from slambed.native import repository_root
from slambed.spec.library import Library

FR3 = "fr3_long_office_household"
PATH = repository_root() / "catalog" / "datasets" / "paths" / f"{FR3}.txt"
SYNTHETIC = """\
id: along
title: Along a path that is not here
synthetic: {trajectory: paths/nowhere.txt}
"""


def nothing_here(tmp_path: Path) -> Catalog:
    return Catalog.load(search=[tmp_path / "nothing"])


@pytest.mark.parametrize("name", Library().experiments())
def test_every_experiment_has_something_to_play(name: str, tmp_path: Path) -> None:
    library = Library()
    experiment, source = library.experiment(name)
    catalog = nothing_here(tmp_path)
    datasets = [catalog.resolve(dataset, tmp_path) for dataset in experiment.datasets]
    here = [dataset for dataset in datasets if catalog.available(dataset, tmp_path)]
    if experiment.missing_datasets == "skip":
        assert here
    else:
        assert here == datasets
    plan.check(experiment, source, library, experiment.engine)
    listed = "\n".join(plan.notes(experiment, Library()))
    for dataset in experiment.datasets:
        if wanted := catalog.stands_in_for(dataset, tmp_path):
            assert f" is played instead of {wanted.id}: numbers of the two" in listed
            assert f"dataset {dataset}: " in listed


def test_a_camera_path_comes_with_the_checkout(tmp_path: Path) -> None:
    catalog = nothing_here(tmp_path)
    assert catalog.resolve("paper_office", tmp_path).id == "synthetic_fr3_path"
    poses = read_groundtruth(PATH)
    assert 85 < poses.stamps_s[-1] - poses.stamps_s[0] < 90
    text = PATH.read_text()
    assert "CC BY 4.0" in text and "Sturm" in text and "thinned" in text
    assert "CC BY 4.0" in catalog.get("synthetic_fr3_path").license


@pytest.mark.recordings
def test_the_path_is_what_its_recipe_makes(recording: Callable[[str], Path]) -> None:
    file = repository_root() / "tools" / "thin_trajectory.py"
    spec = importlib.util.spec_from_file_location("thin_trajectory", file)
    assert spec is not None and spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    source = recording(f"trajectories/{FR3}_groundtruth.txt")
    assert tool.thinned(source, FR3, 4) == PATH.read_text()


def test_a_path_that_is_not_here_is_missing_and_not_generated(tmp_path: Path) -> None:
    (tmp_path / "along.yaml").write_text(SYNTHETIC)
    catalog = Catalog.load(tmp_path, [tmp_path / "nothing"])
    assert not catalog.available(catalog.get("along"), tmp_path)
    with pytest.raises(MissingDataError) as error:
        catalog.must_be_here("along", tmp_path)
    assert "paths/nowhere.txt" in one_line(error)
    (tmp_path / "paths").mkdir()
    (tmp_path / "paths" / "nowhere.txt").write_text("0 0 0 0 0 0 0 1\n")
    catalog.must_be_here("along", tmp_path)


def test_check_reports_what_stands_in() -> None:
    code, out, err = slambed("run", "peer_redkitchen", "--check", "--engine", "virtual")
    assert code == ExitCode.OK, err
    good, note, *_ = out.splitlines()
    assert good.endswith("good")
    # The note begins with the name that the experiment's file has. Nothing offers redkitchen.
    assert note == (
        "note: dataset peer_redkitchen: synthetic_room is played instead of redkitchen: "
        "numbers of the two cannot be compared"
    )


def test_what_is_missing_has_a_remedy_that_gets_it() -> None:
    catalog = Catalog.load()
    recorded, generated = catalog.get("fr3_long_office_household"), catalog.get("synthetic_room")
    assert "slambed data download fr3_long_office_household" in how_to_get(recorded)
    assert how_to_get(generated) == "generate it with 'slambed data prepare synthetic_room'"
    line = refused(ExitCode.BAD_INPUT, "data", "download", "synthetic_room")
    assert "is not downloaded; generate it with 'slambed data prepare synthetic_room'" in line


def test_check_reports_a_dataset_that_is_missing(tmp_path: Path) -> None:
    file = tmp_path / "tiny.yaml"
    file.write_text(
        "id: tiny\ntitle: Tiny\nsystems: [{system: orbslam2}]\ndatasets: [kitti_07_left]\n"
    )
    line = refused(ExitCode.BAD_INPUT, "run", str(file), "--check")
    assert "'kitti_07_left' not found" in line and "tiny.yaml line 4" in line


def test_list_and_prepare_report_what_a_choice_takes(tmp_path: Path) -> None:
    _, out, _ = slambed("data", "list", COLUMNS="200")
    row = next(line for line in out.splitlines() if "paper_office" in line)
    assert f"takes synthetic_fr3_path, {FR3} is missing" in row
    write_tum(tmp_path / FR3)
    _, out, _ = slambed("data", "list", COLUMNS="200", SLAMBED_DATA=str(tmp_path))
    row = next(line for line in out.splitlines() if "paper_office" in line)
    assert f"takes {FR3}" in row and "missing" not in row


@pytest.mark.parametrize(
    ("asked", "played"), [("7", "one of 4 is played: 7.5 fps"), ("60", "all are played: 30 fps")]
)
def test_check_says_which_rate_is_played(asked: str, played: str) -> None:
    check = ("run", "quickstart", "--check", "--engine", "virtual", "--set")
    code, out, err = slambed(*check, f"playback.fps={asked}")
    assert code == ExitCode.OK, err
    assert f"playback.fps {asked}: quickstart has 30 fps, of which {played}" in out
    code, out, err = slambed(*check, "playback.fps=15")
    assert code == ExitCode.OK and "playback.fps" not in out, err
