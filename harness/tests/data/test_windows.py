# SPDX-License-Identifier: Apache-2.0
"""Datasets that are part of another one, and prepared inputs named by dataset files."""

from pathlib import Path

import numpy as np
import pytest
from command_line import refused
from data_samples import one_line
from harness_parts import run_spec
from virtual_parts import needs_programs

from slambed.campaign.datasets import Sequence
from slambed.data.catalog import Catalog
from slambed.data.recipe import DatasetPlayback
from slambed.data.recipe_file import load_recipe
from slambed.engines.result import run_config
from slambed.errors import SlambedError
from slambed.spec.experiment import Playback
from slambed.spec.system import Parameter

WHOLE = """\
id: whole
title: Short walk
sensor: stereo
fps: 10
synthetic: {trajectory: still, seconds: 1, texel_scale: 20, width: 64, height: 48}
"""
PART = "id: part\ntitle: Its end\nsensor: stereo\nwindow_of: whole\nplayback: {start_s: 0.5}\n"


def catalog(folder: Path, **files: str) -> Catalog:
    for name, text in files.items():
        (folder / f"{name}.yaml").write_text(text)
    return Catalog.load(folder, [])


@needs_programs
def test_a_window_plays_a_part_of_the_same_files(tmp_path: Path) -> None:
    found = catalog(tmp_path, whole=WHOLE, part=PART)
    assert found.available(found.get("part"), tmp_path / "cache")
    whole = found.prepare("whole", tmp_path / "cache")
    part = found.prepare("part", tmp_path / "cache")
    assert part.path == whole.path
    kept = found.prepared("part", tmp_path / "cache")
    assert kept is not None and kept.path == whole.path
    assert found.prepared("part", tmp_path / "nothing_yet") is None
    sequence = Sequence(
        "part",
        part.checksum,
        "stereo",
        part.path,
        part.times_s,
        defaults=found.get("part").playback,
    )
    assert sequence.playback(Playback()).start_s == 0.5
    assert sequence.played_s(Playback()) == pytest.approx(0.4)
    assert sequence.playback(Playback(start_s=0.2)).start_s == 0.2  # the experiment overrides


def test_a_window_is_of_a_sequence_of_its_own(tmp_path: Path) -> None:
    found = catalog(
        tmp_path,
        whole=WHOLE,
        part=PART,
        less=PART.replace("part", "less").replace("window_of: whole", "window_of: part"),
    )
    with pytest.raises(SlambedError, match="window_of part, which is no sequence of its own"):
        found.must_be_here("less", tmp_path / "cache")
    (tmp_path / "less.yaml").write_text(PART.replace("part", "less") + "reader: tum\npaths: [x]\n")
    with pytest.raises(SlambedError, match="exactly one of reader, synthetic, window_of"):
        Catalog.load(tmp_path, []).get("less")


def test_a_window_of_itself_is_named(tmp_path: Path) -> None:
    found = catalog(tmp_path, part=PART.replace("whole", "part"))
    with pytest.raises(SlambedError, match="'part': window_of leads back to itself; name the"):
        found.whole(found.get("part"))


def test_a_window_has_the_sensor_of_its_whole(tmp_path: Path) -> None:
    found = catalog(tmp_path, whole=WHOLE, part=PART.replace("stereo", "mono"))
    with pytest.raises(SlambedError, match=r"sensor mono, .* part of whole, which is stereo; remo"):
        found.whole(found.get("part"))


@pytest.mark.parametrize("origin", ["window_of: whole", "first_of: [whole]"])
@pytest.mark.parametrize(
    "useless",
    [
        "camera: {width: 8, height: 6, fx: 5, fy: 5, cx: 4, cy: 3, bf: 1}",
        "depth_unit_m: 0.001",
        "close_depth_baselines: 30",
        "fps: 30",
        "groundtruth: a.txt",
        "paths: [a]",
        "reader_options: {time_unit: s}",
        "download: {url: x}",
    ],
)
def test_keys_of_the_source_are_refused_beside_another_dataset(
    tmp_path: Path, origin: str, useless: str
) -> None:
    file = tmp_path / "part.yaml"
    file.write_text(f"id: part\ntitle: P\n{origin}\n{useless}\n")
    key, name = useless.partition(":")[0], origin.partition(":")[0]
    with pytest.raises(SlambedError) as error:
        load_recipe(file)
    assert f"'{key}': means nothing beside {name}," in one_line(error)
    assert f"{file} line 4" in one_line(error)


@pytest.mark.parametrize(
    "useless", ["sensor: mono", "playback: {end_s: 3}", "prior_map: a", "reference: a"]
)
def test_a_choice_brings_its_own_playback_and_inputs(tmp_path: Path, useless: str) -> None:
    (tmp_path / "any.yaml").write_text(f"id: any\ntitle: A\nfirst_of: [whole]\n{useless}\n")
    with pytest.raises(SlambedError, match="means nothing beside first_of"):
        load_recipe(tmp_path / "any.yaml")


@pytest.mark.parametrize("name", [".", "..", "./rec/rgb.txt", "rec/rgb.txt", "''", '"a\\0.yaml"'])
@pytest.mark.parametrize(("key", "value"), [("window_of", "{}"), ("first_of", "[{}]")])
def test_what_names_no_dataset_is_refused(tmp_path: Path, name: str, key: str, value: str) -> None:
    (tmp_path / "part.yaml").write_text(f"id: part\ntitle: P\n{key}: {value.format(name)}\n")
    line = refused(2, "data", "show", str(tmp_path / "part.yaml"))
    assert "expected the name of a dataset, or of a .yaml file" in line and "line 3" in line


@pytest.mark.parametrize(("start_s", "end_s"), [(0.5, 0.2), (0.5, 0.5)])
def test_a_playback_that_ends_before_it_starts_is_refused(
    tmp_path: Path, start_s: float, end_s: float
) -> None:
    playback = f"playback: {{start_s: {start_s}, end_s: {end_s}}}"
    (tmp_path / "part.yaml").write_text(PART.replace("playback: {start_s: 0.5}", playback))
    with pytest.raises(SlambedError, match=rf"'playback.end_s': {end_s} is not after start_s 0.5"):
        load_recipe(tmp_path / "part.yaml")


@pytest.mark.parametrize(
    ("own", "asked", "told"),
    [
        (DatasetPlayback(start_s=2), Playback(end_s=1), "from 2 s to the end by .* end_s 1;"),
        (DatasetPlayback(end_s=3), Playback(start_s=5), "from 0 s to 3 s by .* start_s 5;"),
    ],
)
def test_an_experiment_that_does_not_fit_the_window_is_told_in_words(
    own: DatasetPlayback, asked: Playback, told: str
) -> None:
    sequence = Sequence("a", "b", "stereo", Path(), np.empty(0), defaults=own)
    with pytest.raises(SlambedError, match=told) as error:
        sequence.playback(asked)
    assert "None" not in one_line(error)


def test_recipes_keep_the_keys_that_they_had_before_there_were_streets() -> None:
    """Otherwise all existing caches would become invalid."""
    found = Catalog.load()
    assert found.get("synthetic_room").content_key().startswith("76adc22ff2ad")
    assert found.get("kitti_05").content_key().startswith("83b2f0b047c8")
    small, large = (found.get(f"synthetic_rectangle{size}") for size in ("_small", ""))
    assert small.content_key() != large.content_key()


def test_drives_and_their_windows_fit_together() -> None:
    found = Catalog.load()
    for route in ("rectangle", "rectangle_small", "circular", "circular_small", "block"):
        first, second = (found.get(f"synthetic_{route}_lap{lap}") for lap in (1, 2))
        assert first.playback.end_s == second.playback.start_s
        assert {first.window_of, second.window_of} == {f"synthetic_{route}"}
        assert (second.prior_map, second.reference) == (f"{route}_map", f"{route}_reference")
        assert found.whole(first).sensor == first.sensor == "stereo"


def test_the_mobile_node_is_given_no_file_that_is_for_the_edge() -> None:
    spec = run_spec(
        params={"prior_map": "/somewhere/a.slm", "vocabulary": "/somewhere/b.slv"},
        inputs={"prior_map": "0" * 64, "vocabulary": "1" * 64},
    ).model_copy(update={"edge_inputs": ["prior_map"]})
    config = run_config(spec, "/sequence", "/out", 1.0)
    assert config.params["prior_map"] == "/out/inputs/prior_map"
    mobile = config.without(spec.edge_inputs).params
    assert mobile["prior_map"] == ""
    assert mobile["vocabulary"] == "/out/inputs/vocabulary"
    with pytest.raises(ValueError, match="role belongs to parameters of type path"):
        Parameter(type="int", default=1, role="edge")


def test_an_experiment_may_leave_the_window_to_the_dataset() -> None:
    sequence = Sequence("a", "b", "stereo", Path(), [], defaults=DatasetPlayback(end_s=3.0))  # type: ignore[arg-type]
    assert sequence.playback(Playback(fps=5)).end_s == 3.0


def test_what_somebody_has_to_get_is_the_recording(tmp_path: Path) -> None:
    catalog = Catalog.load()
    assert catalog.original(catalog.get("paper_kitti_05")).id == "kitti_05"
    lap = catalog.get("synthetic_circular_lap1")
    assert catalog.original(lap).id == lap.window_of
    assert catalog.original(catalog.get("kitti_05")).id == "kitti_05"
    for name, says in (
        ("paper_kitti_05", "kitti_05"),
        ("synthetic_circular_lap1", f"generate it with 'slambed data prepare {lap.window_of}'"),
    ):
        assert says in refused(2, "data", "download", name)
