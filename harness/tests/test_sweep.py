# SPDX-License-Identifier: Apache-2.0
"""Grids and settings stand for what somebody would have written by hand."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from slambed.campaign.preview import chosen, preview
from slambed.campaign.store import RunStore
from slambed.errors import SlambedError
from slambed.spec.library import Library
from slambed.spec.matrix import Circumstances, NamedProfile, expand, read_profiles
from slambed.spec.run_spec import RunSpec

HEAD: dict[str, Any] = {
    "title": "A sweep", "datasets": ["room"], "devices": {"mobile": "raspberry_pi_4"},
}  # fmt: skip
SYSTEMS = [{"system": "orbslam2", "label": "alone"}, {"system": "edgeslam", "variant": "static"}]


def experiment_file(folder: Path, **content: Any) -> str:
    path = folder / "sweep.yaml"
    path.write_text(yaml.safe_dump({"id": "sweep"} | HEAD | content, sort_keys=False))
    return str(path)


def runs_of(name: str, settings: list[str] | None = None) -> list[RunSpec]:
    library = Library()
    experiment, source = library.experiment(name, settings)

    def reader(item: Any, _: str) -> NamedProfile:
        rtt = {"rtt_ms": {"constant_ms": item}} if not isinstance(item, str) else {}
        return NamedProfile(f"rtt_{item:g}" if rtt else str(item), rtt)

    profiles = read_profiles(experiment, source, reader)
    backends = {profile.name: "virtual" for profile in profiles}
    host = Circumstances("virtual", backends, "s", {"room": ("room", "r")})
    return expand(experiment, source, library, profiles, host, runs=2)


def test_a_grid_has_the_keys_of_cells_written_by_hand(tmp_path: Path) -> None:
    swept = runs_of(
        experiment_file(
            tmp_path, systems=SYSTEMS, grid={"params.n_orb": [500, 1000], "link.rtt_ms": [0, 40]}
        )
    )
    by_hand = [
        {**system, "label": f"{name} {n}", "params": {"n_orb": n}}
        for system, name in zip(SYSTEMS, ("alone", "static"), strict=True)
        for n in (500, 1000)
    ]
    written = runs_of(experiment_file(tmp_path, systems=by_hand, link={"profiles": [0, 40]}))
    assert [spec.run_key for spec in swept] == [spec.run_key for spec in written]
    assert len({spec.run_key for spec in swept}) == 2 * 2 * 2 * 2
    cells = list(dict.fromkeys(spec.cell for spec in swept))
    assert cells[0] == "alone n_orb 500/room/rtt_0"
    assert cells[-1] == "edgeslam:static n_orb 1000/room/rtt_40"


def test_the_papers_sweep_by_hand_is_a_grid(tmp_path: Path) -> None:
    """d_f7_norb names twelve systems; four lines of a grid name the same runs."""
    content = yaml.safe_load((Library().root / "experiments" / "d_f7_norb.yaml").read_text())
    content |= {"id": "sweep", "datasets": ["room"]}
    written = runs_of(experiment_file(tmp_path, **content))
    content["systems"] = [
        {"system": "orbslam2", "params": {"second_hypotheses": False}, "label": "alone"},
        {"system": "edgeslam", "variant": "static"},
    ]
    content["grid"] = {"params.n_orb": [500, 625, 750, 875, 1000, 1250]}
    swept = runs_of(experiment_file(tmp_path, **content))
    assert [spec.run_key for spec in swept] == [spec.run_key for spec in written]


def test_what_is_set_goes_before_the_file(tmp_path: Path) -> None:
    name = experiment_file(tmp_path, systems=SYSTEMS, link={"profiles": ["none"]}, seed=1)
    runs = runs_of(name, ["params.n_orb=750", "playback.end_s=10.0", "seed=5"])
    assert {spec.params["n_orb"] for spec in runs} == {750}
    assert {spec.playback.end_s for spec in runs} == {10.0}
    assert {spec.seed for spec in runs} == {5, 6}
    for wrong in ("params.n_orb", "=3", "id=other", "seed.more=1", "title=[", "params.n_orbs=3"):
        with pytest.raises(SlambedError):
            runs_of(name, [wrong])


@pytest.mark.parametrize(
    ("grid", "told"),
    [
        ([], "expected keys"),
        ({"n_orb": [1]}, "cannot vary 'n_orb'"),
        ({"params.": [1]}, "cannot vary"),
        ({"params.n_orb": 500}, "is a list"),
        ({"params.n_orb": [500, 500]}, "a value twice"),
        ({"params.n_orb": [[500]]}, "plain values"),
        ({"variant": ["static"]}, "in the grid and here"),
        ({"link.rtt_ms": [0]}, "two links"),
        ({"params.n_orbs": [500]}, "n_orb"),
    ],
)
def test_a_wrong_grid_is_one_line(tmp_path: Path, grid: Any, told: str) -> None:
    name = experiment_file(tmp_path, systems=SYSTEMS[1:], link={"profiles": ["none"]}, grid=grid)
    with pytest.raises(SlambedError, match="line") as error:
        runs_of(name)
    assert told in str(error.value)


def test_one_cell_can_be_chosen_and_told_before(tmp_path: Path) -> None:
    runs = runs_of(experiment_file(tmp_path, systems=SYSTEMS, link={"profiles": ["none"]}))
    assert chosen(runs, []) == runs
    assert {spec.cell for spec in chosen(runs, ["alone/*"])} == {"alone/room/none"}
    with pytest.raises(SlambedError, match="is no cell; cells: alone/room/none"):
        chosen(runs, ["alone"])
    lines = preview(runs, RunStore(tmp_path), ("trusted",), 30.0, 2)
    assert lines[0] == "alone/room/none: 0 of 2 runs there"
    assert lines[-1].startswith("4 runs to execute, about 1")
