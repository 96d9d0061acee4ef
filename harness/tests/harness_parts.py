# SPDX-License-Identifier: Apache-2.0
"""Small specs, files and stand-ins shared by the tests of spec, engines and campaign."""

import os
import re
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest
from host_late import is_late

from slambed.engines.host_lock import host_lock
from slambed.engines.reaper import reap
from slambed.engines.segmenter import MODULE
from slambed.link.facts import LinkFacts
from slambed.spec.device import VIRTUAL, CostModel, Device, Limits
from slambed.spec.experiment import Playback, Tolerances
from slambed.spec.run_spec import LinkSpec, RunSpec

needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="needs root for namespaces and cgroups")


@contextmanager
def nodes_of_tests() -> Iterator[None]:
    """Holds the host lock during tests that start nodes: a concurrent campaign would kill them
    as leftovers. Also removes leftovers of killed test runs."""
    with host_lock("tests of nodes", wait_s=120):
        reap()
        yield


TOLERANCES = {
    "rtt_error_ms_median": 50.0,
    "host_stall_ms_max": 100.0,
    "cpu_wait_share_max": 0.9,
}
"""For live tests that do not test the accuracy of the link. Measurements on a quiet and on a late
host are in docs/logbook/2026-11-25-test-durations.md."""
OF_THE_HOST = re.compile(
    "RTT error|RTT probes came back|stalled the mobile node|waited for a processor"
)
"""Reasons for an invalid run that a busy host may cause."""
OF_A_LATE_HOST = re.compile(r" came at \d|was not measured|no RTT was measured")
"""The same, only if the host was measured to be late meanwhile (`host_late`): a late fault, or
no probe in time. On a host in time these are our errors."""


def is_valid(invalid_reasons: Sequence[str]) -> bool:
    """Returns whether a live run is valid. Fails if a reason cannot be caused by the host."""
    others = [line for line in invalid_reasons if not OF_THE_HOST.search(line)]
    assert not others or (all(map(OF_A_LATE_HOST.search, others)) and is_late()), invalid_reasons
    return not invalid_reasons


def is_valid_run(summary: Mapping[str, Any], attempts: int = 3) -> bool:
    """Returns whether a live run is valid. On a busy host all attempts may be invalid; then
    checks that all were made and that the last one has a reason caused by the host."""
    if summary["valid"]:
        return True
    assert not is_valid(str(summary["invalid_reason"] or "").split("; "))
    assert summary["attempts"] == attempts
    return False


def segmenters(folder: Path) -> list[psutil.Process]:
    """Returns the segmenters with sockets in this folder."""
    return [
        process
        for process in psutil.process_iter(["cmdline"])
        if MODULE in (line := process.info["cmdline"] or []) and str(folder) in " ".join(line)
    ]


STAND_IN = Path(__file__).parent / "stand_in_node.py"
STAND_IN_SIM = Path(__file__).parent / "stand_in_sim.py"

SYSTEMS = {
    "solo": """
name: solo
title: Everything on the mobile node
roles: [mobile]
params:
  n_orb: {type: int, default: 1000, min: 100, max: 4000, unit: features}
""",
    "pair": """
name: pair
title: Helped by an edge
roles: [mobile, edge]
channels: [control, keyframe]
params:
  n_orb: {type: int, default: 1000, min: 100, max: 4000, unit: features}
  update: {type: str, default: serial, choices: [serial, parallel]}
  period_s: {type: float, default: 5, min: 0}
variants:
  plain: {}
  better: {params: {n_orb: 750, update: parallel}}
""",
}
DEVICE = "name: {name}\ntitle: {name}\nlimits: {{cores: 1, quota_cores: {quota}}}\n"
EXPERIMENT = """\
id: tiny
title: A tiny experiment
systems:
  - {system: solo}
  - system: pair
    variant: better
    params: {period_s: 1}
datasets: [room]
playback: {mode: realtime, fps: 10, end_s: 2}
link:
  backend: relay
  profiles: [none, ramp]
devices: {mobile: small, edge: big}
runs: {default: 2, paper: 100}
seed: 7
"""


def write_library(root: Path, experiment: str = EXPERIMENT) -> Path:
    """Creates a folder that looks like a checkout to `Library`; returns the experiment's file."""
    for name, text in SYSTEMS.items():
        (root / "systems" / name).mkdir(parents=True, exist_ok=True)
        (root / "systems" / name / "system.yaml").write_text(text)
    (root / "catalog" / "devices").mkdir(parents=True, exist_ok=True)
    for name, quota in (("small", 0.5), ("big", 1.0)):
        device_file = root / "catalog" / "devices" / f"{name}.yaml"
        device_file.write_text(DEVICE.format(name=name, quota=quota))
    (root / "experiments").mkdir(exist_ok=True)
    path = root / "experiments" / "tiny.yaml"
    path.write_text(experiment)
    return path


def device(name: str = "small", **limits: Any) -> Device:
    """A device with these limits."""
    return Device(name=name, title=name, limits=Limits(**limits))


def run_spec(edge: bool = False, **changes: Any) -> RunSpec:
    """A RunSpec for the stand-in node; half a second long."""
    fields: dict[str, Any] = {
        "experiment": "tiny",
        "cell": "pair" if edge else "solo",
        "repetition": 0,
        "label": "pair" if edge else "solo",
        "system": "pair" if edge else "solo",
        "variant": "default",
        "roles": ["mobile", "edge"] if edge else ["mobile"],
        "channels": ["control", "keyframe"] if edge else [],
        "params": {},
        "dataset": "room",
        "sequence_checksum": "abc",
        "playback": Playback(fps=10.0, end_s=0.5),
        "device_mobile": device(cores=1, quota_cores=0.5, memory_mb=256),
        "device_edge": device("big") if edge else None,
        "profile": "none",
        "link": LinkSpec(backend="relay", profile="none", content={}) if edge else None,
        "engine": "local",
        "seed": 1,
        "software": "test",
        "tolerances": Tolerances(),
    }
    return RunSpec(**(fields | changes))


def specs(cells: int = 2, runs: int = 2, **changes: Any) -> list[RunSpec]:
    return [
        run_spec(cell=f"c{cell}", params={"x": cell}, repetition=r, seed=r, **changes)
        for cell in range(cells)
        for r in range(runs)
    ]


def first_line(*options: str) -> str:
    """Of a program in Python. The kernel itself takes no interpreter whose path has a blank."""
    return " ".join(["#!/usr/bin/env -S", f'"{sys.executable}"', *options]) + "\n"


def stand_in(folder: Path) -> Path:
    """The stand-in node as a program file."""
    program = folder / "slambed-node"
    program.write_text(first_line("-IS") + STAND_IN.read_text())
    program.chmod(0o755)
    return program


def stand_in_sim(folder: Path) -> Path:
    """The stand-in for the simulation as a program file."""
    program = folder / "slambed-sim"
    program.write_text(first_line("-IS") + STAND_IN_SIM.read_text())
    program.chmod(0o755)
    return program


def virtual_spec(**changes: Any) -> RunSpec:
    """A RunSpec for the stand-in simulation; half a second long."""
    model = CostModel(cores=1, stages={})
    mobile = Device(name="small", title="small", limits=Limits(), model=model)
    return run_spec(**({"engine": VIRTUAL, "device_mobile": mobile} | changes))


@dataclass
class IdleLink:
    """A link that connects nothing; it may die some time after its start."""

    dies_after_s: float | None = None
    started_s: list[float] = field(default_factory=list)
    stopped: int = 0

    def start(self, t0_ns: int) -> None:
        self.started_s.append(time.monotonic())

    def alive(self) -> bool:
        if self.dies_after_s is None or not self.started_s:
            return True
        return time.monotonic() - self.started_s[0] < self.dies_after_s

    def stop(self) -> LinkFacts:
        self.stopped += 1
        return LinkFacts(backend="idle", invalid_reason=None)
