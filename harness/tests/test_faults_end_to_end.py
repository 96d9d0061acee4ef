# SPDX-License-Identifier: Apache-2.0
"""Faults with the real programs, live and virtual: DynNetSLAM and Edge-SLAM live through them."""

import json
import os
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import virtual_parts
import yaml
from test_campaign_end_to_end import image_is_built, programs_are_built
from test_cli import slambed
from virtual_parts import make_sequence

from slambed.errors import ExitCode
from slambed.spec.device import VIRTUAL

SECONDS = 12
QUICK = {
    "rtt_source": "echo",
    "echo_hz": 20.0,
    "l_ol_ms": 400.0,
    "b_ms": 100.0,
    "rtt_missing_s": 0.6,
    "decision_gap_s": 0.3,
}
KILL = {"at_s": 3, "edge": "kill"}
FAULTS: dict[str, list[dict[str, Any]]] = {
    "frozen": [{"at_s": 3, "edge": "freeze", "for_s": 3}],
    "cut": [{"at_s": 3, "link": "cut", "for_s": 3}],
    "again": [KILL, {"at_s": 6, "edge": "restart"}],
    "killed": [KILL],
    "static again": [KILL, {"at_s": 5, "edge": "restart"}],
}


def experiment(sequence: Path, engine: str) -> dict[str, Any]:
    systems = []
    for label, faults in FAULTS.items():
        if engine == VIRTUAL and KILL in faults:
            continue
        system: dict[str, Any] = {"system": "dynnetslam", "variant": "wh_wosz", "params": QUICK}
        if label.startswith("static"):
            system = {"system": "edgeslam", "variant": "static"}
        systems.append(system | {"label": label, "faults": faults})
    return {
        "id": "failing",
        "title": "A short walk during which the edge fails",
        "systems": systems,
        "datasets": [str(sequence)],
        "playback": {"mode": "realtime", "fps": 10},
        "link": {"profiles": ["rtt_20"]},
        "runs": {"default": 1},
        # Other tests may run beside this one: how exact the link is, is not what is tested here.
        "tolerances": {"rtt_error_ms_median": 50},
    }


class Run:
    """What is left of one run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.summary: dict[str, Any] = json.loads((folder / "summary.json").read_text())
        self.events = pd.read_parquet(folder / "events.parquet")

    def of(self, kind: str) -> pd.DataFrame:
        return self.events[self.events["type"] == kind]

    def states(self) -> list[str]:
        """From the first OS on: the first decision may come before the edge's first answer."""
        states = list(self.of("state_changed")["to"])
        return states[1:] if states[:1] == ["MES"] else states


pytestmark = [pytest.mark.live, pytest.mark.programs]


@pytest.fixture(scope="module", params=[VIRTUAL, "local", "docker"])
def runs(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Run]:
    engine = request.param
    if engine == VIRTUAL and not virtual_parts.programs_are_built():
        pytest.skip("needs the programs ('make build')")
    if engine != VIRTUAL and not (os.geteuid() == 0 and programs_are_built()):
        pytest.skip("needs root, and the programs ('make build')")
    if engine == "docker" and not image_is_built():
        pytest.skip("needs the node image ('make images')")
    folder = tmp_path_factory.mktemp("failing")
    path = folder / "failing.yaml"
    path.write_text(yaml.safe_dump(experiment(make_sequence(folder / "walk", SECONDS), engine)))
    results = folder / "results"
    code, out, err = slambed(
        *("run", str(path), "--engine", engine, "--results", str(results), "--wait")
    )
    assert code == ExitCode.OK, out + err
    found = [Run(run) for run in (results / "failing" / "runs").iterdir()]
    return {str(run.summary["cell"]).partition("/")[0]: run for run in found}


def test_every_run_is_valid_and_tells_its_faults(runs: dict[str, Run]) -> None:
    assert len(runs) >= 2
    for run in runs.values():
        assert run.summary["trusted"] is True, run.summary["distrust"]
        assert run.summary["frames_total"] == 10 * SECONDS
        began = run.of("fault_began").iloc[0]
        assert began["node"] == "harness" and 3.0 <= began["t_ns"] / 1e9 < 3.5
        first = FAULTS[run.summary["cell"].partition("/")[0]][0]
        assert run.summary["faults"].split(" ")[0] == first.get("edge", "cut")
    assert runs["cut"].summary["faults"] == "cut 3.0-6.0"
    if "killed" in runs:
        assert runs["killed"].summary["faults"].endswith("-")


def test_the_mobile_leaves_the_edge_and_comes_back(runs: dict[str, Run]) -> None:
    for name in {"frozen", "cut", "again"} & runs.keys():
        run = runs[name]
        assert run.states() == ["OS", "MES", "OS"], name
        assert run.summary["track_losses"] == 0, name
        applied = run.of("handover_applied")
        assert len(applied) and (applied["keyframes"] > 0).all(), name
        left, back = run.of("state_changed")["t_ns"].iloc[-2:] / 1e9
        assert 3.0 < left < 6.0 < back, name
    if "killed" not in runs:
        return
    assert runs["killed"].states() == ["OS", "MES"]
    assert runs["killed"].summary["track_losses"] == 0


def test_a_restarted_edge_gets_a_map(runs: dict[str, Run]) -> None:
    if "again" not in runs:
        pytest.skip("engine virtual kills nobody")
    again = runs["again"]
    assert len(again.of("node_restarted")) == 1
    # A field that the table has no column for.
    assert json.loads(again.of("handover_sent")["extra"].iloc[-1])["whole"] is True
    static = runs["static again"]
    assert len(static.of("node_restarted")) == 1
    restarted_s = float(static.of("fault_ended")["t_ns"].iloc[0]) / 1e9
    received = static.of("keyframe_received")
    assert (received["t_ns"] / 1e9 > restarted_s).any()
    assert len(static.of("edge_restarted")) == 1


def test_explain_shows_the_faults(runs: dict[str, Run], tmp_path: Path) -> None:
    told = {
        "frozen": "edge frozen from 3.",
        "cut": "link cut from 3.00 s to 6.00 s",
        "killed": "edge killed from 3.",
    }
    for name in told.keys() & runs.keys():
        code, out, err = slambed("explain", str(runs[name].folder), "-o", str(tmp_path / "x.png"))
        assert code == ExitCode.OK, err
        assert told[name] in out
