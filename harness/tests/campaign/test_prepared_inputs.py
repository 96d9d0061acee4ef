# SPDX-License-Identifier: Apache-2.0
"""Inputs made by runs: created once, cached by key, verified, and not kept if a condition fails."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from virtual_parts import make_sequence, needs_programs

from slambed.campaign.prepared_inputs import find_prepared, prepare_input
from slambed.errors import SlambedError
from slambed.native import repository_root
from slambed.spec import inputs
from slambed.spec.library import Library

MAP = """\
id: walk_map
title: Map of a walk
system: orbslam2
params: {{sequential: true}}
dataset: {sequence}
playback: {{mode: every_frame, fps: 10}}
yields: map
must: {{coverage: 0.9{more}}}
"""
PATH = """\
id: walk_path
title: Path in that map
system: orbslam2
params: {{sequential: true, prior_map: {map}}}
dataset: {sequence}
playback: {{mode: every_frame, fps: 10}}
yields: live_path
"""


class Lines(list[str]):
    def __call__(self, line: str) -> None:
        self.append(line)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequence(tmp_path_factory.mktemp("synthetic") / "walk")


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Library]:
    """A checkout with its own inputs but the usual systems and devices."""
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    root = tmp_path / "checkout"
    (root / "catalog" / "inputs").mkdir(parents=True)
    for name in ("systems", "catalog/devices"):
        (root / name).symlink_to(repository_root() / name)
    yield Library(root)


def write(library: Library, text: str, **values: object) -> None:
    content = text.format(**values)
    name = content.split()[1]
    (library.root / "catalog" / "inputs" / f"{name}.yaml").write_text(content)


@needs_programs
def test_an_input_is_made_once_and_verified(library: Library, sequence: Path) -> None:
    write(library, MAP, sequence=sequence, more="")
    reported = Lines()
    made = prepare_input("walk_map", library, reported)
    assert reported == ["making input walk_map: Map of a walk"]
    assert made.file.read_bytes()[:4] == b"SLMP"
    assert made.sha256 == inputs.sha256_of(made.file)
    assert made.record["found"]["coverage"] == 1.0
    before = made.file.read_bytes()
    assert prepare_input("walk_map", library, reported) == made
    assert len(reported) == 1  # not made again
    (newest,) = find_prepared("walk_map")
    assert newest.record == made.record
    # A modified file is not used: the run recreates the same bytes.
    made.file.write_bytes(before[:-1] + b"x")
    again = prepare_input("walk_map", library, reported)
    assert "is damaged" in reported[1]
    assert again.file.read_bytes() == before
    # The record contains no path of this machine.
    assert str(library.root) not in json.dumps(made.record)

    write(library, PATH, sequence=sequence, map=made.file)
    path = prepare_input("walk_path", library, reported)
    assert path.record["inputs"] == {"prior_map": made.sha256}
    assert len(path.file.read_text().splitlines()) > 30


@needs_programs
def test_nothing_is_kept_of_a_run_that_breaks_a_condition(
    library: Library, sequence: Path, tmp_path: Path
) -> None:
    write(library, MAP, sequence=sequence, more=", loops_closed: 3")
    with pytest.raises(SlambedError, match="loops_closed is 0, not at least 3; nothing was kept"):
        prepare_input("walk_map", library, Lines())
    assert not find_prepared("walk_map")
    left = [path.name for path in (tmp_path / "cache" / "inputs").iterdir()]
    assert left == [".walk_map.lock"]


def test_a_recipe_with_a_slip_is_one_line(library: Library) -> None:
    with pytest.raises(SlambedError, match="unknown input 'walk'"):
        library.input("walk")
    (library.root / "catalog" / "inputs" / "walk.yaml").write_text(
        "id: walk\ntitle: t\nyield: map\n"
    )
    with pytest.raises(SlambedError, match="yield"):
        library.input("walk")


def test_every_recipe_of_the_checkout_goes_with_its_dataset() -> None:
    from slambed.data.catalog import Catalog

    library, catalog = Library(), Catalog.load()
    for name in library.inputs():
        recipe, _ = library.input(name)
        dataset = catalog.get(recipe.dataset)
        system = library.system(recipe.system)
        system.resolve(system.choose_variant(recipe.variant), recipe.params)
        if inputs.FROM_DATASET in recipe.params.values():
            assert dataset.prior_map in library.inputs()
    named = [n for d in catalog.datasets.values() for n in (d.prior_map, d.reference) if n]
    assert set(named) <= set(library.inputs())
