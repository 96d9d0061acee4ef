# SPDX-License-Identifier: Apache-2.0
"""Grids and settings are equivalent to the same experiment written by hand."""

import hashlib
from pathlib import Path
from typing import Any

import pytest
import yaml
from command_line import refused

from slambed.campaign.run_plan import chosen, preview
from slambed.campaign.store import RunStore
from slambed.errors import SlambedError
from slambed.files.yaml_source import load_yaml
from slambed.spec.library import Library
from slambed.spec.matrix import Circumstances, NamedProfile, expand, read_profiles
from slambed.spec.run_spec import RunSpec, canonical_json
from slambed.spec.selection import meant
from slambed.spec.sweep import swept

HEAD: dict[str, Any] = {
    "title": "A sweep",
    "datasets": ["room"],
    "devices": {"mobile": "raspberry_pi_4"},
}
SYSTEMS = [{"system": "orbslam2", "label": "alone"}, {"system": "edgeslam", "variant": "static"}]


def experiment_file(folder: Path, **content: Any) -> str:
    path = folder / "sweep.yaml"
    path.write_text(yaml.safe_dump({"id": "sweep"} | HEAD | content, sort_keys=False))
    return str(path)


def runs_of(name: str, settings: list[str] | None = None) -> list[RunSpec]:
    library = Library()
    experiment, source = library.experiment(name, settings)

    def reader(item: Any, _: str, near: Path | None) -> NamedProfile:
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


WRITTEN_OUT = {
    "c_f11_tradeoff": (13, "ac908095f0403f30"),
    "c_f18_adaptive": (5, "387dd300070e8efe"),
    "c_quick": (8, "e21f24cb735a96eb"),
    "c_x_window": (8, "88a7b6a9553236de"),
    "d_f7_norb": (12, "e5a0a8b46bab78a7"),
    "d_t3_sine": (14, "6991e22f7e8e1b9d"),
    "d_x_sync": (6, "fe82bd54289f4287"),
    "m_x_backup": (3, "186b58d4a88d84c4"),
    "m_x_sync": (6, "771c77190534dfff"),
}
"""Experiments with grids: number of systems, and digest of the hand-written version. Stored
campaigns are found by the resulting keys and labels."""
NEVER_BY_HAND = {"x_all_systems"}


@pytest.mark.parametrize(("name", "count", "digest"), [(n, *d) for n, d in WRITTEN_OUT.items()])
def test_the_papers_grids_stand_for_what_was_written_by_hand(
    name: str, count: int, digest: str
) -> None:
    def number(value: Any) -> Any:
        return f"{value:g}" if isinstance(value, float | int) else value  # 2 and 2.0 are equal

    systems = Library().experiment(name)[1].data["systems"]
    reported = [
        {**system, "params": {k: number(v) for k, v in system.get("params", {}).items()}}
        for system in systems
    ]
    assert len(reported) == count
    assert hashlib.sha256(canonical_json(reported).encode()).hexdigest()[:16] == digest


def test_every_grid_of_the_checkout_is_among_these() -> None:
    files = (Library().root / "experiments").glob("*.yaml")
    assert {path.stem for path in files if "grid: {" in path.read_text()} == (
        WRITTEN_OUT.keys() | NEVER_BY_HAND
    )


def test_a_label_says_where_the_point_stands(tmp_path: Path) -> None:
    """d_f7_norb: the twelve cells of Figure 7 under the names used by reports and plans."""
    content = yaml.safe_load((Library().root / "experiments" / "d_f7_norb.yaml").read_text())
    content |= {"id": "sweep", "datasets": ["room"]}
    swept = runs_of(experiment_file(tmp_path, **content))
    points = content.pop("grid")["params.n_orb"]
    content["systems"] = [
        {**system, "label": f"{name} {n}", "params": {**system.get("params", {}), "n_orb": n}}
        for system, name in zip(content["systems"], ("alone", "static"), strict=True)
        for n in points
    ]
    written = runs_of(experiment_file(tmp_path, **content))
    assert len(written) == 2 * 6 * 2
    assert [(s.run_key, s.cell) for s in swept] == [(s.run_key, s.cell) for s in written]


def test_a_system_has_its_own_grid_instead_of_the_experiments(tmp_path: Path) -> None:
    own = {"variant": ["static", "conventional"], "params.n_orb": [600]}
    systems = [SYSTEMS[0], {"system": "edgeslam", "label": "{n_orb}: {variant}", "grid": own}]
    grid = {"params.n_orb": [500, 1000], "link.rtt_ms": [0]}
    runs = runs_of(experiment_file(tmp_path, systems=systems, grid=grid))
    assert list(dict.fromkeys(spec.cell for spec in runs)) == [
        "alone n_orb 500/room/rtt_0", "alone n_orb 1000/room/rtt_0",
        "600: static/room/rtt_0", "600: conventional/room/rtt_0",
    ]  # fmt: skip


def test_a_label_has_no_folders(tmp_path: Path) -> None:
    grid = {"params.map": ["a/b.slm"], "params.n": [5]}
    for system, label in (
        ("./mine/system.yaml", "mine map a_b.slm, n 5"),
        ("mine/other.yaml", "other map a_b.slm, n 5"),
        ("orbslam2", "orbslam2 map a_b.slm, n 5"),
    ):
        name = experiment_file(tmp_path, systems=[{"system": system, "grid": grid}])
        (choice,) = Library().experiment(name)[0].systems
        assert choice.label == label
        assert choice.params == {"map": "a/b.slm", "n": 5}


def test_params_that_are_empty_or_no_mapping(tmp_path: Path) -> None:
    grid = {"params.n_orb": [500]}
    name = experiment_file(tmp_path, systems=[SYSTEMS[0] | {"params": None, "grid": grid}])
    assert Library().experiment(name)[0].systems[0].params == {"n_orb": 500}
    for entry in ({"params": [1]}, {"params": [1], "grid": grid}):
        name = experiment_file(tmp_path, systems=[SYSTEMS[0] | entry])
        with pytest.raises(SlambedError, match=r"expected a mapping, not a list, .* line"):
            Library().experiment(name, ["params.n_orb=750"] if "grid" not in entry else None)


@pytest.mark.parametrize(
    ("entry", "expected", "line"),
    [
        ({"label": "x {n_orbs}"}, "varies no 'n_orbs' for the label", "did you mean 'n_orb'"),
        (
            {"label": "{n_orb}", "grid": {"params.n_orb": [500], "params.sync_period_s": [1, 2]}},
            "two different combinations are called", "give them labels",
        ),
        ({"grid": {"link.rtt_ms": [0]}}, "cannot vary 'link.rtt_ms'", "params.<name>"),
        ({"grid": None}, "expected keys", "line 10"),
    ],
)  # fmt: skip
def test_a_wrong_grid_of_a_system_is_one_line(
    tmp_path: Path, entry: dict[str, Any], expected: str, line: str
) -> None:
    system = {"system": "edgeslam", "variant": "static", "grid": {"params.n_orb": [500]}} | entry
    name = experiment_file(tmp_path, systems=[system], link={"profiles": ["none"]})
    with pytest.raises(SlambedError) as error:
        runs_of(name)
    assert expected in str(error.value) and line in str(error.value)


@pytest.mark.parametrize(
    ("setting", "complaint"),
    [
        ("params.n_orb=0500", "'0500' is 320 in YAML"),
        ("seed=10:00", "'10:00' is 600 in YAML"),
        ("link.profiles=[010]", "'010' is 8 in YAML"),
        ("id=other", "the id is the name of the file"),
    ],
)
def test_what_is_set_is_read_like_a_file(tmp_path: Path, setting: str, complaint: str) -> None:
    path = experiment_file(tmp_path, systems=SYSTEMS)
    with pytest.raises(SlambedError, match=f"{complaint}.*"):
        Library().experiment(path, [setting])


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
    ("grid", "expected"),
    [
        ([], "expected keys"),
        ({"n_orb": [1]}, "cannot vary 'n_orb'"),
        ({"params.": [1]}, "cannot vary"),
        ({"params.n_orb": 500}, "is a list"),
        ({"params.n_orb": [500, 500]}, "a value twice"),
        ({"params.n_orb": [[500]]}, "plain values"),
        ({"devices.mobile": [{"speed": 0.5}]}, "its own entry of systems, with devices"),
        ({"variant": ["static"]}, "in the grid and here"),
        ({"link.rtt_ms": [0]}, "two links"),
        ({"params.n_orbs": [500]}, "n_orb"),
    ],
)
def test_a_wrong_grid_is_one_line(tmp_path: Path, grid: Any, expected: str) -> None:
    name = experiment_file(tmp_path, systems=SYSTEMS[1:], link={"profiles": ["none"]}, grid=grid)
    with pytest.raises(SlambedError, match="line") as error:
        runs_of(name)
    assert expected in str(error.value)


def test_one_cell_can_be_chosen_and_reported_before(tmp_path: Path) -> None:
    runs = runs_of(experiment_file(tmp_path, systems=SYSTEMS, link={"profiles": ["none"]}))
    assert chosen(runs, []) == runs
    assert {spec.cell for spec in chosen(runs, ["alone/*"])} == {"alone/room/none"}
    with pytest.raises(SlambedError, match="is no combination; combinations: alone/room/none"):
        chosen(runs, ["alone"])
    # Selected by properties: all conditions of a selection must hold; a run needs to match one
    # selection.
    assert {spec.cell for spec in chosen(runs, ["system=orbslam2"])} == {"alone/room/none"}
    assert {spec.cell for spec in chosen(runs, ["system=edgeslam:static,link=no*,edge=host"])} == {
        "edgeslam:static/room/none"
    }
    assert chosen(runs, ["variant=static", "label=alone", "params.n_orb=1"][:2]) == runs
    for wrong, expected in (
        ("variant=statc", "variant: default, static"),
        ("variant=static,system=orbslam2", "no run has all of that"),
        ("varant=static", "or KEY=VALUE of system, variant"),
    ):
        with pytest.raises(SlambedError, match="is no combination") as error:
            chosen(runs, [wrong], "--force")
        assert expected in str(error.value) and str(error.value).startswith(f"--force {wrong}")
    lines = preview(runs, RunStore(tmp_path), ("valid",), 30.0, 2)
    assert lines[0] == "alone/room/none: 0 of 2 runs there"
    assert lines[-1] == "4 runs to execute, about 1 min 00 s"
    # Other work delays virtual runs, which are as fast as the machine allows.
    (*_, last) = preview(runs, RunStore(tmp_path), ("valid",), 30.0, 2, virtual=True)
    assert last == "4 runs to execute, about 1 min 00 s on an idle machine"
    (*_, nothing) = preview([], RunStore(tmp_path), ("valid",), 30.0, 2, virtual=True)
    assert nothing == "0 runs to execute, about 0 s"


def test_a_system_of_a_grid_has_the_lines_of_its_entry_alone(tmp_path: Path) -> None:
    """A grid's own lines at each of its points would be as many as the points squared."""
    values = list(range(300, 1300))
    system = {"system": "orbslam2", "grid": {"params.n_orb": values}}
    after = {"system": "edgeslam", "variant": "static"}
    name = experiment_file(tmp_path, systems=[system, after], link={"profiles": ["none"]})
    source = swept(load_yaml(Path(name)))
    assert len(source.data["systems"]) == len(values) + 1
    below = [place for place in source.written_at if place[:1] == ("systems",)]
    assert len(below) == 1 + 2 * len(values) + 3  # `systems`, two of each point, three of `after`
    assert source.place_of(("systems", 700, "params", "n_orb")) == source.place_of(("systems", 0))
    text = Path(name).read_text().splitlines()
    line = int(source.place_of(("systems", 1000, "variant")).rpartition("line ")[2])
    assert "variant: static" in text[line - 1]


@pytest.mark.parametrize(
    ("setting", "what"),
    [
        ("runs.usual=3", "unknown key 'usual'"),
        ("params.n_obr=750", "unknown parameter 'n_obr'"),
        ("params.n_orb=1", "1 is below the minimum 50"),
        ("link.profiles=[nope]", "unknown profile 'nope'"),
    ],
)
def test_a_mistake_in_a_setting_names_it_and_no_line(
    tmp_path: Path, setting: str, what: str
) -> None:
    """Also where a grid makes several systems of the one that it changes."""
    system = {"system": "orbslam2", "grid": {"params.loop_closing": [True, False]}}
    name = experiment_file(tmp_path, systems=[system], link={"profiles": ["none"]})
    err = refused(2, "run", name, "--check", "--set", setting)
    assert what in err and f"--set {setting}" in err and " line " not in err


def test_a_key_of_a_named_device_is_set_with_the_whole_device(tmp_path: Path) -> None:
    devices = {"mobile": "raspberry_pi_4"}
    link = {"profiles": ["none"]}
    name = experiment_file(tmp_path, systems=SYSTEMS, link=link, devices=devices)
    setting = "devices.mobile.speed=0.5"
    err = refused(2, "run", name, "--check", "--set", setting)
    assert f"--set {setting}: devices.mobile is 'raspberry_pi_4' and has no keys" in err
    advice = "devices.mobile={device: raspberry_pi_4, name: NAME, speed: 0.5}"
    assert f"write --set '{advice}'" in err
    runs = runs_of(name, settings=[advice.replace("NAME", "half")])
    assert {run.device_mobile.name for run in runs} == {"half"}


def test_an_entry_of_a_list_is_set_with_the_whole_list(tmp_path: Path) -> None:
    name = experiment_file(tmp_path, systems=SYSTEMS, link={"profiles": ["none"]})
    setting = "link.profiles.first=ramp_85"
    err = refused(2, "run", name, "--check", "--set", setting)
    assert f"--set {setting}: link.profiles is a list" in err
    assert "set the whole of it: --set 'link.profiles=[...]'" in err
    runs = runs_of(name, settings=["link.profiles=[ramp_85]"])
    assert {run.profile for run in runs} == {"ramp_85"}


def test_only_the_star_of_a_selection_is_special() -> None:
    names = ("a/room/ramp[peak_ms=50]", "a/room/ramp[peak_ms=5]", "a/room/rampp")
    links = [{"cell": (name,), "link": (name.rpartition("/")[2],)} for name in names]
    for text in (names[0], "link=ramp[peak_ms=50]", "*[peak_ms=50]", "a/*/ramp[*=50]"):
        assert meant(links, [text], "--only") == [True, False, False], text
    for text in ("link=ramp?", "link=ramp[pq]"):
        with pytest.raises(SlambedError, match="is no combination"):
            meant(links, [text], "--only")
