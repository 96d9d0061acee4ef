# SPDX-License-Identifier: Apache-2.0
"""Which runs an experiment has, on which sequences, in which order."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import slambed
from data_samples import write_prepared
from harness_parts import (
    run_spec,
    specs,
    write_library,
)

from slambed.campaign import datasets
from slambed.campaign import plan as planning
from slambed.campaign.datasets import prepare_sequence
from slambed.campaign.order import interleaved
from slambed.campaign.plan import (
    Plan,
    Provider,
    at_host_pace,
    make_plan,
    remarks_on,
    repetitions,
    unplayed,
)
from slambed.data import places
from slambed.data.recipe import DatasetPlayback
from slambed.errors import ExitCode, SlambedError
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import DEVICE_PACE, Playback
from slambed.spec.library import Library
from slambed.spec.matrix import NamedProfile
from slambed.spec.recorded_part import RecordedPart
from slambed.spec.runtime import RoleRuntime, Runtime


def test_a_recording_longer_than_the_runs_is_said() -> None:
    hall = NamedProfile("hall", {}, (), (RecordedPart("hall.log", 0, 984.2),))
    (line,) = remarks_on([hall], 12.0)
    assert line.startswith("profile hall: a run plays the first 12 s of 984 s in hall.log")
    assert not remarks_on([hall], 983.5)


def test_outages_after_the_end_of_the_runs_are_said() -> None:
    late = NamedProfile("hall", {"rtt_ms": 20, "gaps": [{"start_s": 20, "length_s": 2}]})
    (line,) = remarks_on([late], 12.0)
    assert line == "profile hall: its outages begin after the end of a run, at 12 s"
    assert not remarks_on([late], 20.5) and not remarks_on([late])


def test_profiles_that_no_system_plays_are_said(tmp_path: Path) -> None:
    own = {"system": "edgeslam", "variant": "static", "profiles": ["none"]}
    head = {
        "id": "x",
        "title": "X",
        "datasets": ["synthetic_room"],
        "link": {"profiles": ["none", 20]},
    }
    path = tmp_path / "x.yaml"

    def remarks(*systems: dict[str, object]) -> list[str]:
        path.write_text(json.dumps({**head, "systems": systems}))
        library = Library()
        experiment, source = library.experiment(str(path))
        return unplayed(experiment, planning.check(experiment, source, library))

    (line,) = remarks(own)
    assert line.startswith("no system plays rtt_20 of link.profiles")
    assert not remarks(own, {"system": "edgeslam", "variant": "conventional"})


def test_live_runs_at_the_pace_of_this_machine_are_said() -> None:
    device = Library().device("raspberry_pi_4")
    spec = run_spec(engine="local", device_mobile=device)
    (line,) = at_host_pace([spec, spec])
    assert "limits of raspberry_pi_4" in line and "--set pace=device" in line
    paced = spec.model_copy(update={"pace": DEVICE_PACE})
    virtual = spec.model_copy(update={"engine": VIRTUAL})
    here = run_spec(engine="local", device_mobile=Library().device("host"))
    assert not at_host_pace([paced, virtual, here])
    runtime = Runtime(mobile=RoleRuntime(command=["their-slam"]))
    (line,) = at_host_pace([spec, spec.model_copy(update={"runtime": runtime})])
    assert "--set" not in line and "programs that are not slambed's" in line


def test_what_belongs_to_a_sequence_reaches_each_of_its_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare, segmented = planning.prepare_sequence, list[str]()
    monkeypatch.setattr(
        planning, "prepare_sequence", lambda *a: replace(prepare(*a), reference="truth")
    )
    monkeypatch.setattr(planning, "datasets_with_masks", lambda experiment, _: {*names})
    monkeypatch.setattr(planning, "networks_of", lambda _, found: segmented.extend(found) or {})
    here = str(write_prepared(tmp_path / "here").path)
    names = [here, f"{here}/"]
    systems = [
        {"system": "solo", "label": device, "datasets": [name], "devices": {"mobile": device}}
        for name, device in zip(names, ("small", "big"), strict=True)
    ]
    plan = plan_with(names, tmp_path, systems=systems, provide=Path)
    assert [spec.reference for spec in plan.specs] == ["truth"] * 4
    assert segmented == names


def test_order_interleaves_and_repeats_itself() -> None:
    wanted = specs(cells=5, runs=3)
    first = interleaved(wanted, seed=1)
    assert [s.repetition for s in first] == [0] * 5 + [1] * 5 + [2] * 5
    assert interleaved(list(reversed(wanted)), seed=1) != first[::-1]
    assert interleaved(wanted, seed=1) == first
    assert interleaved(wanted, seed=2) != first
    assert [s.cell for s in first[:5]] != [s.cell for s in first[5:10]]


def test_order_of_the_first_repetitions_does_not_depend_on_later_ones() -> None:
    wanted = specs(cells=5, runs=3)
    fewer = [spec for spec in wanted if spec.repetition < 2]
    assert interleaved(wanted, 1)[:10] == interleaved(fewer, 1)


def plan_with(
    datasets: list[str], root: Path, provide: Provider | None = None, **changes: Any
) -> Plan:
    text = json.dumps(
        {
            "id": "tiny",
            "title": "Tiny",
            "systems": [{"system": "solo"}],
            "datasets": datasets,
            "devices": {"mobile": "small"},
            **changes,
        }
    )
    write_library(root, text)
    library = Library(root)
    experiment, source = library.experiment("tiny")
    return make_plan(experiment, source, library, [], "local", "test", 2, provide)


def test_a_dataset_that_is_not_here_ends_the_experiment_or_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(places, "search_path", lambda: [tmp_path / "nothing"])
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    here = str(write_prepared(tmp_path / "here").path)
    with pytest.raises(SlambedError, match=r"'kitti_07_left' not found.*line"):
        plan_with(["kitti_07_left", here], tmp_path)
    plan = plan_with(["kitti_07_left", here], tmp_path, missing_datasets="skip")
    assert {spec.dataset for spec in plan.specs} == {"tiny"}
    assert len(plan.specs) == 2
    assert len(plan.left_out) == 1 and "SLAMBED_DATA" in plan.left_out[0]
    with pytest.raises(SlambedError, match="no dataset of"):
        plan_with(["kitti_07_left"], tmp_path, missing_datasets="skip")
    # An unknown name is a mistake, not missing data.
    with pytest.raises(SlambedError, match="not known"):
        plan_with(["kiti_07", here], tmp_path, missing_datasets="skip")


def test_a_dataset_has_playback_for_what_an_experiment_leaves_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    sequence = prepare_sequence(str(write_prepared(tmp_path / "here").path))
    own = replace(sequence, defaults=DatasetPlayback(fps=5.0, start_s=0.1))
    assert sequence.playback(Playback(fps=10.0)) == Playback(fps=10.0)
    assert own.playback(Playback(end_s=0.3)) == Playback(fps=5.0, start_s=0.1, end_s=0.3)
    assert own.playback(Playback(fps=10.0)).fps == 10.0
    assert own.played_s(Playback()) == pytest.approx(sequence.played_s(Playback()) - 0.1)
    with pytest.raises(SlambedError, match="does not go with the experiment's"):
        own.playback(Playback(end_s=0.05))
    # The run's meaning includes the dataset's defaults.
    monkeypatch.setattr(planning, "prepare_sequence", lambda name, notify: own)
    assert {s.playback.fps for s in plan_with(["here"], tmp_path).specs} == {5.0}


def test_the_end_of_a_window_counts_from_the_begin_of_the_whole_sequence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    whole = prepare_sequence(str(write_prepared(tmp_path / "here").path))
    lap2 = replace(whole, times_s=np.linspace(0, 9, 10), defaults=DatasetPlayback(start_s=5))
    monkeypatch.setattr(planning, "prepare_sequence", lambda name, notify: lap2)
    monkeypatch.setattr(planning, "kept_sequence", lambda name: lap2)
    monkeypatch.setattr(planning, "sensor_of", lambda name: lap2.sensor)
    (spec, *_) = plan_with(["tiny"], tmp_path, playback={"end_s": 8}).specs
    assert (spec.playback.start_s, spec.playback.end_s) == (5, 8)
    library = Library(tmp_path)
    experiment, source = library.experiment("tiny")
    experiment = experiment.model_copy(update={"missing_datasets": "skip"})
    assert planning.check(experiment, source, library) == []
    with pytest.raises(SlambedError, match=r"end_s 11 is after .* which lasts 9\.0 s"):
        plan_with(["tiny"], tmp_path, playback={"end_s": 11})
    # A shorter sequence in place of the one that was asked for is no mistake, but is said.
    replaced = plan_with(["longer_one"], tmp_path, playback={"end_s": 11}).remarks
    assert "tiny ends at 9 s, before playback.end_s 11" in replaced
    assert not plan_with(["longer_one"], tmp_path, playback={"end_s": 9}).remarks


def test_a_fault_after_the_end_of_a_sequence_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    here = str(write_prepared(tmp_path / "here").path)
    helped: dict[str, Any] = {
        "systems": [{"system": "pair"}],
        "devices": {"mobile": "small", "edge": "big"},
        "link": {"backend": "relay", "profiles": [0]},
    }
    plan = plan_with([here], tmp_path, **helped, faults=[{"at_s": 0.2, "edge": "kill"}])
    assert plan.specs[0].faults
    with pytest.raises(SlambedError, match=r"kill at 0.3 s: playback is over at 0.3 s"):
        plan_with([here], tmp_path, **helped, faults=[{"at_s": 0.3, "edge": "kill"}])


@pytest.mark.parametrize(("asked", "count"), [(None, 2), ("default", 2), ("paper", 100), ("5", 5)])
def test_repetitions(tmp_path: Path, asked: str | None, count: int) -> None:
    write_library(tmp_path)
    experiment, _ = Library(tmp_path).experiment("tiny")
    assert repetitions(experiment, asked) == count
    for bad in ("0", "-1", "many", "²"):
        with pytest.raises(SlambedError, match="--runs"):
            repetitions(experiment, bad)


def test_a_selection_without_a_run_is_refused_before_a_sequence_is_made(tmp_path: Path) -> None:
    here = {"SLAMBED_CACHE": str(tmp_path / "cache"), "SLAMBED_DATA": ""}
    results = ("--results", str(tmp_path / "results"))
    for option in ("--only", "--force"):
        words = ("run", "quickstart", "--engine", "virtual", option, "dataset=attic", *results)
        code, _, line = slambed(*words, **here)
        assert code == ExitCode.BAD_INPUT
        # Named as in the results: by the sequence that stands in.
        assert f"{option} dataset=attic is no combination; dataset: synthetic_" in line
    assert not list((tmp_path / "cache").glob("prepared/*"))


def test_a_long_preparation_reports_now_and_then() -> None:
    lines: list[str] = []
    now_s = 0.0
    report = datasets.reported("walk", lines.append, lambda: now_s)
    for done in range(1, 1001):
        now_s = done / 8
        report(done, 1000)
    assert lines[0] == "preparing walk: 120 of 1,000 frames, about 1 min 50 s left"
    assert len(lines) == 8, "every 15 of 125 s"
