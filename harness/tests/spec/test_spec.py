# SPDX-License-Identifier: Apache-2.0
"""Experiment files: what is read, and how a mistake is reported."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from harness_parts import EXPERIMENT, run_spec, write_library

from slambed.campaign.plan import check
from slambed.commands.report_request import check_figure_names
from slambed.data.recipe_file import load_recipe
from slambed.errors import SlambedError
from slambed.native import repository_root
from slambed.spec.library import Library
from slambed.spec.matrix import Circumstances, NamedProfile, expand, read_profiles
from slambed.spec.run_spec import RunSpec, canonical_json
from slambed.spec.software import source_hash

HOST = Circumstances(
    "local",
    {"none": "relay", "ramp": "relay"},
    "1.0+abc",
    {"room": ("synthetic_room", "sum")},
)


def named(item: str | float | dict[str, Any], where: str, near: Path | None) -> NamedProfile:
    return NamedProfile(str(item), {"name": str(item)})


def matrix(
    root: Path, text: str = EXPERIMENT, runs: int = 2, host: Circumstances = HOST
) -> list[RunSpec]:
    write_library(root, text)
    library = Library(root)
    experiment, source = library.experiment("tiny")
    profiles = read_profiles(experiment, source, named)
    return expand(experiment, source, library, profiles, host, runs)


def complaint(root: Path, old: str, new: str) -> str:
    assert old in EXPERIMENT
    return complaint_of(root, EXPERIMENT.replace(old, new))


def complaint_of(root: Path, text: str, host: Circumstances = HOST) -> str:
    with pytest.raises(SlambedError) as caught:
        matrix(root, text, host=host)
    line = str(caught.value)
    assert "\n" not in line
    return line


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("fps: 10", "fsp: 10", ["unknown key 'fsp'", "tiny.yaml line 9", "did you mean 'fps'?"]),
        ("  backend:", "  bakcend:", ["unknown key 'bakcend'", "line 11", "'backend'"]),
        ("seed: 7", "sede: 7", ["unknown key 'sede'", "line 15", "'seed'"]),
        ("fps: 10", "fps: -1", ["'playback.fps'", "greater than or equal to 0.001", "line 9"]),
        ("fps: 10", "fps: 5.0e-324", ["'playback.fps'", "equal to 0.001", "line 9"]),
        ("fps: 10", "fps: .nan", ["'playback.fps'", "line 9"]),
        ("end_s: 2", "start_s: 3, end_s: 2", ["end_s 2.0 is not after start_s 3.0", "line 9"]),
        ("title: A tiny experiment\n", "", ["'title' is missing"]),
        ("seed: 7", "seed: 7\nseed: 8", ["'seed' is given twice", "line 16"]),
        ("fps: 10", "fps: 1e-3", ["'playback.fps'", "YAML's form of this number is 1.0e-3"]),
        ("seed: 7", "seed: many", ["'seed'", "integer", "'many'", "line 15"]),
        ("seed: 7", "seed: [", ["not YAML", "tiny.yaml line"]),
        ("system: solo", "system: sole", ["unknown system 'sole'", "'solo'", "line 4"]),
        ("variant: better", "variant: beter", ["no variant 'beter'", "'better'", "line 5"]),
        ("period_s: 1", "perod_s: 1", ["unknown parameter 'perod_s'", "'period_s'", "line 7"]),
        ("period_s: 1", "period_s: -1", ["'period_s'", "below the minimum 0", "line 7"]),
        ("period_s: 1", "update: never", ["'update'", "serial, parallel", "line 7"]),
        ("period_s: 1", "n_orb: 1.5", ["1.5 is not an int"]),
        ("mobile: small", "mobile: smal", ["unknown device 'smal'", "'small'"]),
        ("[none, ramp]", "[none, none]", ["'none' is given twice", "line 12"]),
        ("{system: solo}", "{system: solo, profiles: [rmp]}", ["'rmp'", "'ramp'", "line 4"]),
        ("{system: solo}", "{system: solo, datasets: [rom]}", ["'rom'", "'room'", "line 4"]),
        ("id: tiny", "id: teeny", ["'teeny' is not the file's name", "line 1"]),
        ("datasets: [room]", "datasets: [room, room]", ["named twice", "line 8"]),
        ("datasets: [room]", "datasets: []", ["'datasets'", "line 8"]),
    ],
)
def test_a_mistake_is_one_line_with_its_place(
    tmp_path: Path, old: str, new: str, parts: list[str]
) -> None:
    text = complaint(tmp_path, old, new)
    for part in parts:
        assert part in text


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("period_s: 1", "period_s: {a: 1}",
         "'systems.1.params.period_s': expected true or false, a number or text, not a mapping"),
        ("period_s: 1", "period_s:", "or text, not null"),
        ("{period_s: 1}", "5", "'systems.1.params': expected a mapping, not 5"),
        ("seed: 7", "seed: {first: 7}", "'seed': expected an integer, not a mapping"),
        ("seed: 7", "seed: 7.5", "'seed': expected an integer, not 7.5"),
        ("fps: 10", "fps: {a: 1}", "'playback.fps': expected a number, not a mapping"),
        ("fps: 10", "fps: true", "'playback.fps': expected a number, not true"),
        ("mode: realtime", "mode: {a: 1}", "'realtime' or 'every_frame' (it is a mapping)"),
        ("title: A tiny experiment", "title: [tiny]", "'title': expected text, not a list"),
        ("datasets: [room]", "datasets: room", "'datasets': expected a list, not 'room'"),
        ("fps: 10", "stop_at_first_loss: 1", "expected true or false, not 1"),
        ("[none, ramp]", "[none, [ramp]]",
         "'link.profiles.1': expected text, a number or a mapping, not a list"),
    ],
)  # fmt: skip
def test_the_wrong_kind_of_value_is_reported_with_the_right_one(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    text = complaint(tmp_path, old, new)
    assert expected in text and "tiny.yaml line " in text


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("default: 1000,", "default: {a: 1},",
         "'params.n_orb.default': expected true or false, a number or text, not a mapping"),
        ("min: 100,", "min: [100],", "'params.n_orb.min': expected a number, not a list"),
        ("unit: features", "unit: {of: features}", "'params.n_orb.unit': expected text, not a map"),
    ],
)  # fmt: skip
def test_the_wrong_kind_of_value_in_a_system_too(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    write_library(tmp_path)
    path = tmp_path / "systems" / "solo" / "system.yaml"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(SlambedError) as caught:
        Library(tmp_path).system("solo")
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("params", "expected"),
    [
        ("{n_orbs: 1}", "unknown parameter 'n_orbs' of system solo; did you mean 'n_orb'?"),
        ("{n_orb: x}", "'x' is not an int"),
    ],
)
def test_a_wrong_parameter_of_a_variant_has_its_line(
    tmp_path: Path, params: str, expected: str
) -> None:
    write_library(tmp_path)
    path = tmp_path / "systems" / "solo" / "system.yaml"
    text = path.read_text().partition("variants:")[0].rstrip("\n")
    path.write_text(f"{text}\nvariants:\n  odd:\n    params: {params}\n")
    with pytest.raises(SlambedError) as caught:
        Library(tmp_path).system("solo")
    assert expected in str(caught.value)
    assert f"system.yaml line {text.count(chr(10)) + 4}" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sensors: []", "'sensors': expected at least one entry, not a list"),
        ("params: {'a b': {type: int, default: 1}}", "digits and '_', no digit first, not 'a b'"),
        ('params: {"a\\n": {type: int, default: 1}}', "digits and '_', no digit first, not 'a"),
        (
            "params: {a: {type: int, default: 1}, A: {type: int, default: 2}}",
            "params: 'a' and 'A', one environment variable for two",
        ),
        ("params: {a: {type: str, default: x, min: 1}}", "min and max belong to numbers"),
        ("channels: [a]", "channels need a role edge"),
        ("runtime: {mobile: {command: [x], env: {'A=B': x}}}", "no digit first, not 'A=B'"),
        ("runtime: {mobile: {command: [x], env: {A: 1}}}", "expected text, not 1 (quote it)"),
        ('runtime: {mobile: {command: ["x\\0"]}}', "a NUL byte cannot be given to a program"),
        ("runtime: {mobile: {command: ['{foldr}/x']}}", "'{foldr}', did you mean 'folder'?"),
        (
            "runtime: {reads: tum, trajectory: out/p.txt, mobile: {command: [x]}}",
            "expected the name of a file, without a folder",
        ),
    ],
)
def test_what_no_program_can_get_is_named(tmp_path: Path, text: str, expected: str) -> None:
    write_library(tmp_path)
    path = tmp_path / "systems" / "solo" / "system.yaml"
    path.write_text(f"name: solo\ntitle: t\nroles: [mobile]\n{text}\n")
    with pytest.raises(SlambedError) as caught:
        Library(tmp_path).system("solo")
    assert expected in str(caught.value) and "system.yaml line 4" in str(caught.value)


def test_braces_of_a_shell_are_no_placeholders(tmp_path: Path) -> None:
    write_library(tmp_path)
    path = tmp_path / "systems" / "solo" / "system.yaml"
    command = "[sh, -c, 'echo ${folders} {other} {folder}']"
    text = f"name: solo\ntitle: t\nroles: [mobile]\nruntime: {{mobile: {{command: {command}}}}}\n"
    path.write_text(text)
    assert Library(tmp_path).system("solo").runtime is not None


@pytest.mark.parametrize("name", ["./solo", "..", "systems/solo"])
def test_a_folder_of_a_system_is_no_name(tmp_path: Path, name: str) -> None:
    write_library(tmp_path)
    with pytest.raises(SlambedError, match=r"give the path of its file, .*system\.yaml"):
        Library(tmp_path).system(name)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "{system: solo}",
            "{system: solo, profiles: []}",
            "profiles': expected at least one",
        ),
        (
            "{system: solo}",
            "{system: solo, datasets: []}",
            "datasets': expected at least one",
        ),
        ("id: tiny", "id: my exp", "'id': expected a name of letters (a to z), digits"),
    ],
)
def test_lists_without_an_entry_and_odd_names_are_refused(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    assert expected in complaint(tmp_path, old, new)


def test_datasets_of_a_system_are_named_as_those_of_the_experiment(tmp_path: Path) -> None:
    text = EXPERIMENT.replace("datasets: [room]", "datasets: [./own.yaml]")
    text = text.replace("{system: solo}", "{system: solo, datasets: [./own.yaml]}")
    write_library(tmp_path, text)
    experiment, _ = Library(tmp_path).experiment("tiny")
    assert experiment.systems[0].datasets == experiment.datasets
    assert experiment.datasets == [str(tmp_path / "experiments" / "own.yaml")]


def test_a_parameter_of_a_system_without_any_is_named(tmp_path: Path) -> None:
    write_library(tmp_path)
    path = tmp_path / "systems" / "solo" / "system.yaml"
    text = "name: solo\ntitle: t\nroles: [mobile]\nvariants: {odd: {params: {x: 1}}}\n"
    path.write_text(text)
    with pytest.raises(SlambedError, match=r"unknown parameter 'x' of system solo; it has none, "):
        Library(tmp_path).system("solo")


@pytest.mark.parametrize(
    ("mobile", "parts"),
    [
        ("{device: small, name: x, speed: -2}", ["'devices.mobile.speed'", "greater than 0", "-2"]),
        ("{device: small, name: x, cores: 0}", ["'devices.mobile.cores'", "equal to 1", "is 0"]),
        ("{device: small, name: x y}", ["'devices.mobile.name'", "'x y'"]),
        ("{device: small, speed: 2}", ["key 'devices.mobile.name' is missing"]),
        ("{device: small, name: x, sped: 2}", ["unknown key 'sped'", "did you mean 'speed'?"]),
        ("{device: small, name: big, speed: 2}", ["there is a device big already"]),
        (
            "{device: small, name: x, speed: {a: 1}}",
            ["mobile.speed': expected a number, not a map"],
        ),
        ("5", ["'devices.mobile': expected text or a mapping, not 5"]),
        ("[small]", ["'devices.mobile': expected text or a mapping, not a list"]),
    ],
)
def test_a_mistake_in_a_changed_device_is_reported_as_one(
    tmp_path: Path, mobile: str, parts: list[str]
) -> None:
    text = complaint(tmp_path, "mobile: small", f"mobile: {mobile}")
    for part in [*parts, "tiny.yaml line 13"]:
        assert part in text
    own = f"{{system: solo, devices: {{mobile: {mobile}}}}}"
    text = complaint(tmp_path, "{system: solo}", own)
    for part in [*(p.replace("'devices", "'systems.0.devices") for p in parts), "line 4"]:
        assert part in text


def test_a_system_with_an_edge_needs_a_link(tmp_path: Path) -> None:
    text = complaint(tmp_path, "link:\n  backend: relay\n  profiles: [none, ramp]\n", "")
    assert "system pair has an edge but there is no link" in text


def test_an_unknown_experiment_names_its_neighbor(tmp_path: Path) -> None:
    write_library(tmp_path)
    with pytest.raises(SlambedError, match=r"unknown experiment 'tinny'.*did you mean 'tiny'"):
        Library(tmp_path).experiment("tinny")


def test_the_matrix_is_systems_times_profiles_times_runs(tmp_path: Path) -> None:
    specs = matrix(tmp_path)
    assert [spec.cell for spec in specs[::2]] == [
        "solo/synthetic_room/none",
        "solo/synthetic_room/ramp",
        "pair:better/synthetic_room/none",
        "pair:better/synthetic_room/ramp",
    ]
    assert len({spec.run_key for spec in specs}) == 8
    solo, pair = specs[0], specs[-1]
    assert solo.link is None and solo.device_edge is None and solo.profile == "none"
    assert pair.link is not None and pair.link.profile == "ramp"
    # System default, then variant, then experiment.
    assert pair.params == {"n_orb": 750, "period_s": 1.0, "update": "parallel"}


def test_a_system_plays_only_the_datasets_that_it_names(tmp_path: Path) -> None:
    text = EXPERIMENT.replace("datasets: [room]", "datasets: [room, hall]")
    text = text.replace("{system: solo}", "{system: solo, datasets: [hall]}")
    both = {"room": ("synthetic_room", "sum"), "hall": ("synthetic_hall", "other")}
    specs = matrix(tmp_path, text, host=replace(HOST, datasets=both))
    played = {(spec.label, spec.dataset) for spec in specs}
    assert played == {
        ("solo", "synthetic_hall"),
        ("pair:better", "synthetic_room"),
        ("pair:better", "synthetic_hall"),
    }
    alone = EXPERIMENT.replace("{system: solo}", "{system: solo, datasets: [room]}")
    keys = [[spec.run_key for spec in matrix(tmp_path, t)] for t in (EXPERIMENT, alone)]
    assert keys[0] == keys[1]  # what else the experiment plays is in no key


def test_a_fault_must_be_inside_what_its_own_system_plays(tmp_path: Path) -> None:
    text = EXPERIMENT.replace("datasets: [room]", "datasets: [room, hall]")
    text = text.replace("fps: 10, end_s: 2", "fps: 10")
    fault = "\n    faults: [{at_s: 3, edge: kill}]\n    datasets: "
    both = {"room": ("synthetic_room", "sum"), "hall": ("synthetic_hall", "other")}
    host = replace(HOST, datasets=both, played_s={"room": 2.0, "hall": 5.0})
    hall = text.replace("    variant: better", f"    variant: better{fault}[hall]")
    assert any(spec.faults for spec in matrix(tmp_path, hall, host=host))
    room = hall.replace("[hall]", "[room]")
    assert "kill at 3 s: playback is over at 2 s" in complaint_of(tmp_path, room, host)


def test_repetitions_share_their_seed_across_cells(tmp_path: Path) -> None:
    specs = matrix(tmp_path)
    assert {spec.seed for spec in specs if spec.repetition == 1} == {8}


def test_a_key_does_not_depend_on_how_the_file_is_spelled(tmp_path: Path) -> None:
    spelled = EXPERIMENT.replace("title: A tiny experiment", "title: 'Another title'  # comment")
    spelled = spelled.replace("params: {period_s: 1}", "params:\n      period_s: 1.0")
    spelled = spelled.replace("id: tiny\n", "") + "id: tiny\n"
    first = [spec.run_key for spec in matrix(tmp_path / "a", EXPERIMENT)]
    second = [spec.run_key for spec in matrix(tmp_path / "b", spelled)]
    assert first == second


def test_more_repetitions_keep_the_keys_of_the_first_ones(tmp_path: Path) -> None:
    few = {spec.run_key for spec in matrix(tmp_path, runs=2)}
    many = {spec.run_key for spec in matrix(tmp_path, runs=3)}
    assert few < many and len(many) == 12


@pytest.mark.parametrize(
    "change",
    [
        {"params": {"n_orb": 500}},
        {"sequence_checksum": "other"},
        {"engine": "docker"},
        {"seed": 2},
        {"repetition": 1},
        {"software": "other"},
        {"profile": "ramp"},
    ],
)
def test_a_key_depends_on_everything_a_run_means(change: dict[str, Any]) -> None:
    assert run_spec(**change).run_key != run_spec().run_key


def test_a_key_ignores_names_and_judgments() -> None:
    other = run_spec(experiment="x", cell="y", label="z")
    assert other.run_key == run_spec().run_key


def test_a_key_is_the_same_in_every_process_and_version() -> None:
    # A changed value means that every existing result is made anew: do it knowingly.
    assert run_spec(edge=True).run_key == "73a71b7142f1edbe"


def test_a_run_spec_survives_json() -> None:
    spec = run_spec(edge=True)
    again = RunSpec.model_validate(json.loads(spec.model_dump_json()))
    assert again == spec and again.run_key == spec.run_key


def test_canonical_json_refuses_nan() -> None:
    with pytest.raises(ValueError):
        canonical_json({"a": float("nan")})


def test_a_label_is_one_line(tmp_path: Path) -> None:
    text = complaint(tmp_path, "{system: solo}", '{system: solo, label: "two\\n"}')
    assert "expected one line of text without '/'" in text


def test_the_same_cell_twice_is_refused(tmp_path: Path) -> None:
    text = complaint(tmp_path, "- {system: solo}", "- {system: solo}\n  - {system: solo, label: b}")
    assert "are the same" in text


def test_the_same_system_on_two_datasets_is_two_cells(tmp_path: Path) -> None:
    text = EXPERIMENT.replace("datasets: [room]", "datasets: [synthetic_room, synthetic_office]")
    write_library(tmp_path, text)
    library = Library(tmp_path)
    experiment, source = library.experiment("tiny")
    # Before anything is prepared: neither has a checksum yet.
    assert check(experiment, source, library, "local")


def test_different_cells_need_different_names(tmp_path: Path) -> None:
    twin = "- {system: solo}\n  - {system: solo, params: {n_orb: 500}}"
    text = complaint(tmp_path, "- {system: solo}", twin)
    assert "two different combinations are called" in text and "labels" in text


def test_source_hash_follows_sources_but_not_tests(tmp_path: Path) -> None:
    (tmp_path / "systems" / "core" / "tests").mkdir(parents=True)
    source = tmp_path / "systems" / "core" / "a.cpp"
    source.write_text("int a;")
    first = source_hash(tmp_path)
    (tmp_path / "systems" / "core" / "tests" / "a_test.cpp").write_text("int b;")
    (tmp_path / "systems" / "core" / "README.md").write_text("words")
    assert source_hash(tmp_path) == first
    source.write_text("int b;")
    assert source_hash(tmp_path) != first


@pytest.mark.parametrize(
    ("asked", "parts"),
    [
        ("report: {metrics: [lost, ate_rmse]}", ["metric 'ate_rmse'", "'ate_rmse_m'"]),
        ("report: {metrics: [dataset]}", ["metric 'dataset'", "known: "]),
        ("report: {plots: [trajectories]}", ["plot 'trajectories'", "'trajectory'"]),
        ("reproduces: [nopaper.T9]", ["published number 'nopaper.T9'"]),
        ("reproduces: [dynnet.T1, dynnet.T66]", ["published number 'dynnet.T66'", "'dynnet.T"]),
    ],
)
def test_what_a_report_cannot_show_is_refused_before_anything_runs(
    tmp_path: Path, asked: str, parts: list[str]
) -> None:
    write_library(tmp_path, EXPERIMENT.replace("seed: 7", f"seed: 7\n{asked}"))
    library = Library(tmp_path)
    with pytest.raises(SlambedError) as caught:
        check_figure_names(*library.experiment("tiny"))
    for part in [*parts, "unknown ", "tiny.yaml line 16"]:
        assert part in str(caught.value)


LIBRARY = Library()


@pytest.mark.parametrize("name", LIBRARY.experiments())
def test_every_experiment_of_the_checkout_reads(name: str) -> None:
    experiment, source = LIBRARY.experiment(name)
    check_figure_names(experiment, source)
    LIBRARY.device(experiment.devices.mobile)
    LIBRARY.device(experiment.devices.edge)


def test_all_variants_of_systems_without_a_prior_map_are_compared() -> None:
    experiment, _ = LIBRARY.experiment("x_all_systems")
    played = {(choice.system, choice.variant) for choice in experiment.systems}
    known = {
        (name, variant)
        for name in ("orbslam2", "edgeslam", "dynnetslam", "multithread_rl", "edgeslam_semantic")
        for variant in LIBRARY.system(name).variants or [None]
    }
    assert played == known and len(known) == 17
    recipes = repository_root() / "catalog" / "datasets"
    for choice in experiment.systems:
        datasets = experiment.datasets_of(choice)
        sensors = {load_recipe(recipes / f"{name}.yaml").sensor for name in datasets}
        assert sensors <= set(LIBRARY.system(choice.system).sensors) and len(datasets) == 3


@pytest.mark.parametrize(
    ("own", "devices"),
    [
        ("{mobile: big}", ("big", "big")),
        ("{edge: small}", ("small", "small")),
        ("{mobile: big, edge: small}", ("big", "small")),
    ],
)
def test_a_system_has_the_experiments_device_where_it_names_none(
    tmp_path: Path, own: str, devices: tuple[str, str]
) -> None:
    text = EXPERIMENT.replace("variant: better", f"variant: better\n    devices: {own}")
    for spec in matrix(tmp_path, text):
        edge = spec.device_edge.name if spec.device_edge else None
        expected = ("small", None) if spec.system == "solo" else devices
        assert (spec.device_mobile.name, edge) == expected


def test_a_device_that_nobody_names_is_the_host(tmp_path: Path) -> None:
    folder = tmp_path / "catalog" / "devices"
    folder.mkdir(parents=True)
    (folder / "host.yaml").write_text("name: host\ntitle: host\nlimits: {}\n")
    for devices, expected in (("", ("host", "host")), ("devices: {edge: big}\n", ("host", "big"))):
        specs = matrix(
            tmp_path, EXPERIMENT.replace("devices: {mobile: small, edge: big}\n", devices)
        )
        assert specs[-1].device_edge is not None
        assert (specs[-1].device_mobile.name, specs[-1].device_edge.name) == expected


@pytest.mark.parametrize("name", LIBRARY.systems())
def test_every_system_of_the_checkout_reads(name: str) -> None:
    system = LIBRARY.system(name)
    for parameter in system.params.values():
        assert parameter.doc, "a parameter says what it is for"


def test_the_checkout_is_found() -> None:
    assert (repository_root() / "experiments" / "quickstart.yaml").is_file()


def test_a_calibration_of_the_host_makes_limits_of_boards_other_limits() -> None:
    plain = run_spec()
    fast, slow = (plain.model_copy(update={"host_speed": speed}) for speed in (1.0, 1.1))
    assert len({plain.run_key, fast.run_key, slow.run_key}) == 3
