# SPDX-License-Identifier: Apache-2.0
"""Datasets that are part of another one, and prepared inputs named by dataset files."""

from pathlib import Path

import pytest
from harness_parts import run_spec
from virtual_parts import needs_programs

from slambed.campaign.datasets import Sequence
from slambed.data.catalog import Catalog
from slambed.data.recipe import DatasetPlayback
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
