# SPDX-License-Identifier: Apache-2.0
"""A board that is as busy as those of the papers: other work on its cores, and lock contention."""

import json
import threading
from pathlib import Path

import pytest
from virtual_parts import make_sequence, needs_programs, plan_of, played_of, write_experiment

from slambed.engines.virtual import VirtualRun
from slambed.metrics.events import read_events
from slambed.native import find_program

EXPERIMENT = """\
id: walk
title: A walk with everything on a slow board
systems:
  - {{system: orbslam2, label: idle}}
  - {{system: orbslam2, label: locked, params: {{contention: true}}}}
  - system: orbslam2
    label: busy
    devices: {{mobile: {{device: raspberry_pi_4, name: busy, background: 0.7}}}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
devices: {{mobile: raspberry_pi_4}}
engine: virtual
runs: {{default: {runs}}}
"""

pytestmark = needs_programs


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Label -> folder of the run."""
    root = tmp_path_factory.mktemp("board")
    path = write_experiment(root, make_sequence(root / "walk", 6), 1, EXPERIMENT)
    plan = plan_of(path)
    found = {}
    for spec in plan.specs:
        sequence, played_s = played_of(plan)[spec.dataset]
        folder = root / spec.label
        folder.mkdir()
        run = VirtualRun(spec, sequence, played_s, folder, find_program("slambed-sim"), None)
        assert run.execute(threading.Event()).outcome == "completed"
        found[spec.label] = folder
    return found


def cpu_percent(folder: Path) -> float:
    rows = [json.loads(line) for line in (folder / "samples.jsonl").read_text().splitlines()]
    return 100 * float(rows[-1]["cpu_s"]) / float(rows[-1]["t_s"])


def test_a_background_load_is_the_devices_cpu_and_slows_nobody_while_cores_are_free(
    runs: dict[str, Path],
) -> None:
    assert cpu_percent(runs["busy"]) == pytest.approx(cpu_percent(runs["idle"]) + 70, abs=0.1)
    first, second = (
        (runs[name] / "mobile" / "trajectory.txt").read_text() for name in ("idle", "busy")
    )
    assert first == second  # one tracking and one mapping thread leave two of four cores free


def test_tracking_and_what_mapping_writes_back_wait_for_each_other(runs: dict[str, Path]) -> None:
    assert not read_events(runs["idle"]).of("map_wait")
    waits = read_events(runs["locked"]).of("map_wait")
    assert waits and all(wait["worker"] in ("tracking", "mapping") for wait in waits)
    # No wait is longer than a frame or a write-back.
    assert all(0 < wait["wait_ms"] < 200 for wait in waits)
