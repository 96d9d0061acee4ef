# SPDX-License-Identifier: Apache-2.0
"""Short virtual runs of the real program, shared by several tests."""

import hashlib
import json
import subprocess
from pathlib import Path

import pytest
from harness_parts import TOLERANCES

from slambed.campaign.folder import ResultFolder
from slambed.campaign.plan import Plan, check, make_plan
from slambed.errors import SlambedError
from slambed.native import find_program
from slambed.spec.device import VIRTUAL
from slambed.spec.library import Library
from slambed.spec.run_spec import RunSpec
from slambed.spec.software import host_software

EXPERIMENT = """\
id: walk
title: A short walk, alone and with an edge, on a slow device over a lossy link
systems:
  - {{system: orbslam2, label: alone, profiles: [lossy_wifi]}}
  - {{system: edgeslam, variant: static, label: offloaded, params: {{sync_period_s: 0.5}}}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{profiles: [lossy_wifi]}}
devices:
  mobile: {{device: host, name: slow, cores: 1, speed: 0.04}}
  edge: host
engine: virtual
runs: {{default: {runs}}}
"""


def programs_are_built() -> bool:
    try:
        for name in ("slambed-sim", "slambed-synth"):
            find_program(name)
    except SlambedError:
        return False
    return True


needs_programs = pytest.mark.skipif(
    not programs_are_built(), reason="needs the programs ('make build')"
)


def make_sequence(path: Path, seconds: int = 4, *more: str, name: str = "walk") -> Path:
    """A walk through a generated room."""
    command = [find_program("slambed-synth"), "--out", path, "--seconds", seconds, "--fps", 10]
    subprocess.run([*map(str, command), "--id", name, "--seed", "3", *more], check=True)
    return path


def write_experiment(folder: Path, sequence: Path, runs: int = 2, text: str = EXPERIMENT) -> Path:
    path = folder / "walk.yaml"
    tolerances = json.dumps(TOLERANCES)
    path.write_text(text.format(sequence=sequence, runs=runs, tolerances=tolerances))
    return path


def plan_of(path: Path, engine: str = VIRTUAL) -> Plan:
    library = Library()
    experiment, source = library.experiment(str(path))
    profiles = check(experiment, source, library, engine)
    software = host_software(program="slambed-sim")
    return make_plan(
        experiment, source, library, profiles, engine, software, experiment.runs.default
    )


def played_of(plan: Plan) -> dict[str, tuple[Path, float]]:
    playback = plan.experiment.playback
    return {key: (s.path, s.played_s(playback)) for key, s in plan.sequences.items()}


class Quiet:
    """A reporter that reports nothing."""

    def run_started(self, spec: RunSpec) -> None: ...

    def run_ended(self, spec: RunSpec, verdict: str) -> None: ...

    def run_failed(self, spec: RunSpec, why: str, last: bool) -> None: ...


CIRCUMSTANCES = {"load_1min", "started_utc", "command", "tree", "commit", "dirty"}
"""Manifest fields in which identical virtual runs may differ. Somebody may edit or commit a file of
the checkout while a test plays."""


def fingerprints(folder: ResultFolder) -> dict[str, str]:
    """Returns `run key/file` -> digest for every file of every run; manifests without
    circumstances."""
    found: dict[str, str] = {}
    keys = folder.run_keys()
    files = (path for key in keys for path in (folder.store.runs / key).rglob("*"))
    for path in sorted(path for path in files if path.is_file()):
        content = path.read_bytes()
        if path.name == "manifest.json":
            facts = json.loads(content)
            assert facts.keys() >= CIRCUMSTANCES
            kept = {key: value for key, value in facts.items() if key not in CIRCUMSTANCES}
            content = json.dumps(kept, sort_keys=True).encode()
        name = path.relative_to(folder.store.runs).as_posix()
        found[name] = hashlib.sha256(content).hexdigest()
    return found
