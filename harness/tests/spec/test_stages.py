# SPDX-License-Identifier: Apache-2.0
"""A system's own stages inherit the costs of other stages; device files need not list them."""

import threading
from pathlib import Path

import pytest
from harness_parts import EXPERIMENT, write_library
from virtual_parts import make_sequence, needs_programs, plan_of, played_of, write_experiment

from slambed.engines.virtual import VirtualRun, sim_config
from slambed.errors import SlambedError
from slambed.metrics.events import read_events
from slambed.native import find_program
from slambed.spec.device import Accelerator, CostModel, StageCost
from slambed.spec.library import Library
from slambed.spec.matrix import Circumstances, NamedProfile, expand
from slambed.spec.run_spec import RunSpec
from slambed.spec.stages import OwnStage, costs_with

HOST = Circumstances("virtual", {"none": "virtual"}, "1.0+abc", {"room": ("synthetic_room", "sum")})
PROFILE = NamedProfile("none", {"name": "none", "rtt_ms": 0})
MODEL = """\
model:
  cores: 2
  stages:
    extract: {a_us: 1000}
    track: {a_us: 100, b_us: 2, c_us: 0.5, jitter: 0.2}
"""
EXAMPLE = """\
id: walk
title: The example, whose edge is slow
systems: [{{system: example_backpressure, label: example}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{profiles: [none]}}
devices: {{mobile: host, edge: {{device: host, name: slow, cores: 1, speed: 0.03}}}}
engine: virtual
runs: {{default: {runs}}}
"""
WEIGH = "stages: {weigh: {doc: the queue, cost_as: track, factor: 0.5}}\n"


def one_run(root: Path, stages: str, models: tuple[str, ...] = ("small", "big")) -> RunSpec:
    """Returns a run of the system `pair`, with these stages added, on devices with cost models."""
    write_library(root, EXPERIMENT)
    for name in models:
        device = root / "catalog" / "devices" / f"{name}.yaml"
        device.write_text(device.read_text() + MODEL)
    system = root / "systems" / "pair" / "system.yaml"
    system.write_text(system.read_text() + stages)
    library = Library(root)
    experiment, source = library.experiment("tiny")
    specs = expand(experiment, source, library, [PROFILE], HOST, 1)
    return next(spec for spec in specs if spec.system == "pair")


def complaint(root: Path, stages: str) -> str:
    with pytest.raises(SlambedError) as caught:
        one_run(root, stages)
    line = str(caught.value)
    assert "\n" not in line and caught.value.code == 2
    return line


def test_an_inherited_cost_reaches_the_simulator_on_both_nodes(tmp_path: Path) -> None:
    spec = one_run(tmp_path, WEIGH)
    devices = sim_config(spec, 10, None).devices
    for model in (devices.mobile, devices.edge):
        assert model is not None
        assert model.stages["weigh"] == StageCost(a_us=50, b_us=1, c_us=0.25, jitter=0.2)
        assert model.stages["track"] == StageCost(a_us=100, b_us=2, c_us=0.5, jitter=0.2)


def test_what_a_stage_costs_is_in_the_key_and_what_is_said_of_it_is_not(tmp_path: Path) -> None:
    keys = [
        one_run(tmp_path / str(n), stages).run_key
        for n, stages in enumerate(
            ["", WEIGH, WEIGH.replace("the queue", "in other words"), WEIGH.replace("0.5", "0.25")]
        )
    ]
    assert keys[1] == keys[2] and len(set(keys)) == 3


def test_a_stage_of_one_node_costs_nothing_on_the_other(tmp_path: Path) -> None:
    spec = one_run(tmp_path, WEIGH.replace("factor: 0.5", "role: edge"))
    assert spec.device_mobile.model is not None and spec.device_edge is not None
    assert "weigh" not in spec.device_mobile.model.stages
    assert spec.device_edge.model is not None and "weigh" in spec.device_edge.model.stages


@pytest.mark.parametrize(
    ("stages", "expected"),
    [
        (WEIGH.replace("track", "trak"), "costs as 'trak', for which it has no cost; did you mean"),
        (WEIGH.replace("factor", "faktor"), "unknown key 'faktor'"),
        (WEIGH.replace("0.5", "0"), "'stages.weigh.factor': input should be greater than 0"),
        ("stages: {a: {doc: x, cost_as: b}, b: {doc: x, cost_as: a}}\n", "a -> b -> a"),
        ("stages: {a: {doc: x, cost_as: a}}\n", "in a circle: a -> a"),
        ("stages: {a: {cost_as: track}}\n", "'stages.a.doc' is missing"),
    ],
)
def test_a_mistake_is_one_line(tmp_path: Path, stages: str, expected: str) -> None:
    assert expected in complaint(tmp_path, stages)


def test_inherited_costs_follow_a_line_and_keep_their_accelerator() -> None:
    gpu = StageCost(a_us=8, jitter=0.1, accelerator="gpu")
    model = CostModel(cores=1, stages={"segment": gpu}, accelerators={"gpu": Accelerator()})
    stages = {
        "last": OwnStage(doc="", cost_as="middle", factor=0.5),
        "middle": OwnStage(doc="", cost_as="segment", factor=3),
    }
    found = costs_with(stages, model.stages, "edge")
    assert found["last"] == StageCost(a_us=12, jitter=0.1, accelerator="gpu")


def test_a_cost_of_the_devices_own_goes_before_an_inherited_one() -> None:
    costs = {"track": StageCost(a_us=100), "weigh": StageCost(a_us=7)}
    found = costs_with({"weigh": OwnStage(doc="", cost_as="track")}, costs, "mobile")
    assert found == costs


def test_every_stage_of_ours_has_a_cost_on_the_devices_that_know_its_base() -> None:
    """An unknown stage name is a typing mistake."""
    library = Library()
    known = {
        stage
        for name in library.devices()
        for model in [library.device(name).model]
        if model is not None
        for stage in model.stages
    }
    for name in library.systems():
        stages = library.system(name).stages
        assert {stage.cost_as for stage in stages.values()} <= known | stages.keys(), name


@needs_programs
def test_the_examples_own_stage_is_charged_though_no_device_file_knows_it(tmp_path: Path) -> None:
    library = Library()
    for name in library.devices():
        model = library.device(name).model
        assert model is None or "report_backlog" not in model.stages
    plan = plan_of(write_experiment(tmp_path, make_sequence(tmp_path / "walk"), 1, EXAMPLE))
    (spec,) = plan.specs
    ((path, played_s),) = played_of(plan).values()
    raw = tmp_path / "raw"
    raw.mkdir()
    run = VirtualRun(spec, path, played_s, raw, find_program("slambed-sim"), None)
    result = run.execute(threading.Event())
    assert result.outcome == "completed", result.reason
    log = read_events(raw)
    charged = [e for e in log.stages("edge", "report_backlog")]
    reported = [e for e in log.of("message", node="mobile") if e["channel"] == "backlog"]
    assert charged and {e["message"] for e in reported} == {"BACKLOG"}
    assert all(0 < e["wall_ms"] < 1 for e in charged)
