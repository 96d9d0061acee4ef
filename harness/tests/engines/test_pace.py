# SPDX-License-Identifier: Apache-2.0
"""Live runs at the pace of their devices: experiment options, nodes' settings and metrics."""

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from command_line import slambed
from harness_parts import (
    EXPERIMENT,
    TOLERANCES,
    device,
    is_valid_run,
    needs_root,
    run_spec,
    write_library,
)
from results_factory import RawRun, spec_of
from results_factory import write_experiment as write_results
from virtual_parts import make_sequence, needs_programs

from slambed.engines.live_run import paced_devices
from slambed.errors import ExitCode, SlambedError
from slambed.metrics import pace
from slambed.metrics.events import EventLog
from slambed.report.compute_times import compute_times
from slambed.report.load import load
from slambed.report.setup import setup_lines
from slambed.report.truth import truth_table
from slambed.spec.device import CostModel, Device, DeviceChange, StageCost
from slambed.spec.library import Library
from slambed.spec.matrix import Circumstances, NamedProfile, expand
from slambed.spec.run_spec import RunSpec

PACED = EXPERIMENT + "pace: device\n"
MODEL = "model:\n  cores: 2\n  stages:\n    track: {a_us: 100}\n"
OWN = "stages: {weigh: {doc: the queue, cost_as: track}}\n"
PI = {"name": "raspberry_pi_4", "model": {"cores": 4}}


def specs(root: Path, text: str, engine: str = "local", models: bool = True) -> list[RunSpec]:
    write_library(root, text)
    for name in ("small", "big") if models else ():
        path = root / "catalog" / "devices" / f"{name}.yaml"
        path.write_text(path.read_text() + MODEL)
    system = root / "systems" / "pair" / "system.yaml"
    system.write_text(system.read_text() + OWN)
    library = Library(root)
    experiment, source = library.experiment("tiny")
    host = Circumstances(engine, {"none": engine}, "1.0+abc", {"room": ("room", "sum")})
    profile = NamedProfile("none", {"name": "none", "rtt_ms": 0})
    return expand(experiment, source, library, [profile], host, 1)


def test_a_pace_is_in_the_key_of_live_runs_alone(tmp_path: Path) -> None:
    def keys(name: str, text: str, engine: str) -> list[str]:
        return [spec.run_key for spec in specs(tmp_path / name, text, engine)]

    usual = keys("a", EXPERIMENT, "local")
    assert keys("b", EXPERIMENT + "pace: host\n", "local") == usual
    assert not set(keys("c", PACED, "local")) & set(usual)
    assert keys("d", PACED, "virtual") == keys("e", EXPERIMENT, "virtual")
    assert "pace" not in run_spec().meaning()


def test_what_a_device_costs_is_in_the_key_of_a_paced_run(tmp_path: Path) -> None:
    solo, pair = specs(tmp_path, PACED)
    assert solo.paced and pair.device_edge is not None
    meant: Any = pair.meaning()
    for node in ("device_mobile", "device_edge"):
        assert meant[node]["limits"]["quota_cores"] and meant[node]["model"]["cores"] == 2
        # The cost of a system's own stage is included, as in a virtual run.
        assert meant[node]["model"]["stages"]["weigh"]["a_us"] == 100


def test_a_device_without_a_cost_model_has_no_pace(tmp_path: Path) -> None:
    with pytest.raises(SlambedError) as caught:
        specs(tmp_path, PACED, models=False)
    line = str(caught.value)
    assert "device small has no cost model" in line and "pace: device" in line
    assert "line" in line and "\n" not in line and caught.value.code == ExitCode.BAD_INPUT


def test_a_program_of_its_own_has_none_either(tmp_path: Path) -> None:
    write_library(tmp_path, PACED)
    system = tmp_path / "systems" / "solo" / "system.yaml"
    runtime = "runtime: {mobile: {command: [./run]}}\n"
    system.write_text(system.read_text().replace("params:", runtime + "params:"))
    with pytest.raises(SlambedError, match="program of its own"):
        specs_of_own(tmp_path)


def specs_of_own(root: Path) -> list[RunSpec]:
    library = Library(root)
    experiment, source = library.experiment("tiny")
    host = Circumstances("local", {"none": "relay"}, "1.0+abc", {"room": ("room", "sum")})
    return expand(experiment, source, library, [NamedProfile("none", {"name": "none"})], host, 1)


def test_a_core_of_the_device_is_what_a_thread_may_use() -> None:
    for limits, share in (
        ({"quota_cores": 1.0, "thread_cores": 0.25}, 0.25),
        ({"quota_cores": 0.5}, 0.5),
        ({"quota_cores": 2.0}, 1.0),
        ({}, 1.0),
    ):
        small = device(**limits)
        assert small.share_on(small.limits) == share


def test_nodes_are_given_their_own_devices_alone(tmp_path: Path) -> None:
    solo, pair = specs(tmp_path, PACED)
    assert pair.device_edge is not None
    small, big = pair.device_mobile, pair.device_edge
    limits = {"mobile": small.limits, "edge": big.limits}
    both = paced_devices({"mobile": small, "edge": big}, limits).as_json()
    alone = paced_devices({"mobile": solo.device_mobile}, limits).as_json()
    assert set(both) == {"mobile", "edge"} and set(alone) == {"mobile"}
    reported: Any = both["mobile"]
    assert reported["share"] == 0.5 and reported["device"]["stages"]["track"]["a_us"] == 100


def test_a_background_load_is_in_the_key_where_there_is_one() -> None:
    plain = Device(
        name="board",
        title="",
        limits=device().limits,
        model=CostModel(cores=4, stages={"track": StageCost(a_us=1)}),
    )
    busy = DeviceChange(device="board", name="busy", background=0.7).applied_to(plain)
    assert busy.model is not None and busy.model.background == 0.7
    assert "background" not in json.dumps(plain.meaning("virtual"))
    assert busy.model.model_dump(mode="json")["background"] == 0.7


def stage(charged_ms: float | None, wall_ms: float, **more: object) -> dict[str, Any]:
    event = {"t_ns": 1, "node": "mobile", "type": "stage", "name": "track", "wall_ms": wall_ms}
    return event | ({} if charged_ms is None else {"charged_ms": charged_ms}) | more


def test_stages_that_the_host_is_too_slow_for_are_counted() -> None:
    log = EventLog(
        [stage(10, 10), stage(30, 40, missed=True), stage(5, 5, node="edge", missed=True)]
    )
    assert pace.missed(log) == 2
    assert pace.ratio(log) == pytest.approx(50 / 40)
    assert pace.ratio(EventLog([stage(None, 7)])) is None
    # Before Python 3.12 sum() loses the last digit.
    assert pace.ratio(EventLog([stage(1, 1), *[stage(0, 0.1)] * 10])) == 2


def results(root: Path, **more: object) -> Path:
    spec = spec_of("orbslam2", "default", None, 0, device_mobile=PI, **more)
    run = RawRun(
        duration_s=4.0,
        edge=False,
        cpu_percent=15.0,
        manifest={
            "limits": {
                "mobile": {
                    "asked": {"thread_cores": 0.25, "quota_cores": 1.0},
                    "granted": {"quota_cores": 1.0},
                }
            }
        },
    )
    return write_results(root, [(spec, run)])


def setup_of(folder: Path) -> list[str]:
    found = load(folder)
    return setup_lines(found, compute_times(found))


def test_a_report_says_whose_compute_times_they_are(tmp_path: Path) -> None:
    message = " ".join(setup_of(results(tmp_path / "a", pace="device")))
    assert "Pace of the device, 1 runs" in message and "kept in real time" in message
    assert "two machines" not in message
    assert "Pace of the device" not in " ".join(setup_of(results(tmp_path / "b")))


def test_truth_compares_the_cpu_of_devices_at_their_pace(tmp_path: Path) -> None:
    paced, virtual = (
        results(tmp_path / "a", pace="device"),
        results(tmp_path / "b", engine="virtual"),
    )
    table = truth_table(load(paced), load(virtual))
    cpu = {row[1]: row for row in table.rows if "CPU" in row[1]}
    assert list(cpu) == ["mobile CPU [% of the device]"]
    live = float(cpu["mobile CPU [% of the device]"][2].split()[0])
    assert live == pytest.approx(15, abs=0.5)  # of 4 quarters of a core
    usual = truth_table(load(results(tmp_path / "c")), load(virtual))
    assert [row[1] for row in usual.rows if "CPU" in row[1]] == ["mobile CPU [% of a core]"]


def test_paces_are_never_pooled(tmp_path: Path) -> None:
    runs = [
        (
            spec_of("orbslam2", "default", None, 0, device_mobile=PI, pace=name),
            RawRun(duration_s=3.0, edge=False),
        )
        for name in ("host", "device")
    ]
    found = load(write_results(tmp_path / "a", runs))
    assert sorted(found.runs["label"]) == ["orbslam2 (local)", "orbslam2 (local, device's pace)"]
    with pytest.raises(SlambedError, match="two paces"):
        truth_table(found, load(results(tmp_path / "b", engine="virtual")))


LIVE = """\
id: paced
title: A walk at the pace of a small board
systems: [{{system: edgeslam, variant: static, label: offloaded}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{backend: relay, profiles: [rtt_20]}}
devices: {{mobile: raspberry_pi_4, edge: edge_i7_6700t}}
pace: device
runs: {{default: 1}}
tolerances: {tolerances}
"""


@pytest.mark.live
@needs_root
@needs_programs
def test_a_live_run_has_the_compute_times_of_its_device(tmp_path: Path) -> None:
    sequence = make_sequence(tmp_path / "walk")
    path = tmp_path / "paced.yaml"
    path.write_text(LIVE.format(sequence=sequence, tolerances=json.dumps(TOLERANCES)))
    arguments = ["run", str(path), "--engine", "local", "--results", str(tmp_path), "--wait"]
    code, out, err = slambed(*arguments)
    assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), out + err
    (run,) = (tmp_path / "paced" / "runs").iterdir()
    summary = json.loads((run / "summary.json").read_text())
    manifest = json.loads((run / "manifest.json").read_text())
    reported = json.loads((run / "nodes" / "run.json").read_text())["pace"]
    assert summary["pace"] == manifest["spec"]["pace"] == "device"
    if not is_valid_run(summary):
        return
    assert summary["outcome"] == "completed", summary["outcome_reason"]
    assert reported["mobile"]["share"] == manifest["limits"]["mobile"]["asked"]["thread_cores"]
    assert reported["edge"]["share"] == 1.0
    # No stage is faster than the device, and none gets less CPU time.
    events = pd.read_parquet(run / "events.parquet")
    stages = events[events["type"] == "stage"]
    extra = pd.DataFrame(list(stages["extra"].map(json.loads)))
    assert set(stages["node"]) == {"mobile", "edge"} and extra["charged_ms"].notna().all()
    during = stages["t_ns"].to_numpy() < 0.9 * summary_end_ns(events)
    charged, wall = extra["charged_ms"].to_numpy(), stages["wall_ms"].to_numpy()
    assert (wall[during] >= charged[during] - 0.002).all()
    share = stages["node"].map({"mobile": reported["mobile"]["share"], "edge": 1.0}).to_numpy()
    assert (stages["cpu_ms"].to_numpy()[during] >= (share * charged)[during] - 0.002).all()
    extract = stages["name"].eq("extract").to_numpy()
    assert 15 < charged[extract].mean() < 25  # the papers' board, whatever this host is
    assert summary["pace_ratio"] > 0.99 and summary["pace_missed"] >= 0
    report = (tmp_path / "paced" / "report.md").read_text()
    assert "Pace of the device, 1 runs" in report


def summary_end_ns(events: pd.DataFrame) -> float:
    """End of playback; stages running then are cut short."""
    return float(events.loc[events["type"] == "frame_tracked", "t_ns"].max())
