# SPDX-License-Identifier: Apache-2.0
"""Faults with the real programs, live and virtual: DynNetSLAM and Edge-SLAM survive them."""

import json
import os
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import virtual_parts
import yaml
from command_line import slambed
from harness_parts import TOLERANCES, is_valid_run
from test_campaign_end_to_end import image_is_built, programs_are_built
from virtual_parts import make_sequence

from slambed.errors import ExitCode
from slambed.spec.device import VIRTUAL

SECONDS = 9
QUICK = {
    "rtt_source": "echo",
    "echo_hz": 20.0,
    "l_ol_ms": 400.0,
    "b_ms": 100.0,
    "rtt_missing_s": 0.6,
    "decision_gap_s": 0.3,
}
AT_S, BACK_S = 2.0, 4.0
KILL = {"at_s": AT_S, "edge": "kill"}
RESTART = {"at_s": BACK_S, "edge": "restart"}
FAULTS: dict[str, list[dict[str, Any]]] = {
    "frozen": [{"at_s": AT_S, "edge": "freeze", "for_s": BACK_S - AT_S}],
    "cut": [{"at_s": AT_S, "link": "cut", "for_s": BACK_S - AT_S}],
    "again": [KILL, RESTART],
    "killed": [KILL],
    "static again": [KILL, RESTART],
}
PLAYED = {
    VIRTUAL: ("frozen", "cut"),
    "local": tuple(FAULTS),
    # Processes are handled differently in a container; everything else is the same.
    "docker": ("frozen", "again"),
}


def experiment(sequence: Path, engine: str) -> dict[str, Any]:
    systems = []
    for label in PLAYED[engine]:
        system: dict[str, Any] = {"system": "dynnetslam", "variant": "wh_wosz", "params": QUICK}
        if label.startswith("static"):
            system = {"system": "edgeslam", "variant": "static"}
        systems.append(system | {"label": label, "faults": FAULTS[label]})
    return {
        "id": "failing",
        "title": "A short walk during which the edge fails",
        "systems": systems,
        "datasets": [str(sequence)],
        "playback": {"mode": "realtime", "fps": 10},
        "link": {"profiles": ["rtt_20"]},
        "runs": {"default": 1},
        "tolerances": TOLERANCES,
    }


class Run:
    """The stored files of one run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.summary: dict[str, Any] = json.loads((folder / "summary.json").read_text())
        self.events = pd.read_parquet(folder / "events.parquet")

    def of(self, kind: str) -> pd.DataFrame:
        return self.events[self.events["type"] == kind]

    def states(self) -> list[str]:
        """From the first OS state on: the first decision may precede the edge's first answer."""
        states = list(self.of("state_changed")["to"])
        return states[1:] if states[:1] == ["MES"] else states


# Seven runs of nine seconds each, up to three times on a late host: over 200 s.
pytestmark = [pytest.mark.programs, pytest.mark.timeout(900)]
LIVE = [
    pytest.param("local", marks=pytest.mark.live),
    pytest.param("docker", marks=[pytest.mark.live, pytest.mark.nightly]),
]


@pytest.fixture(scope="module", params=[VIRTUAL, *LIVE])
def runs(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Run]:
    """Returns the valid runs by label; on a busy host some may be invalid."""
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
        *("run", str(path), "--engine", engine, "--results", str(results), "--wait", "--no-figures")
    )
    found = [Run(run) for run in (results / "failing" / "runs").iterdir()]
    assert len(found) == len(PLAYED[engine]), out + err
    valid = [run for run in found if is_valid_run(run.summary)]
    assert code == (ExitCode.OK if valid == found else ExitCode.NOT_ALL_GOOD), out + err
    assert engine != VIRTUAL or valid == found
    return {str(run.summary["cell"]).partition("/")[0]: run for run in valid}


def test_every_run_reports_its_faults(runs: dict[str, Run]) -> None:
    for name, run in runs.items():
        assert run.summary["frames_total"] == 10 * SECONDS
        began = run.of("fault_began").iloc[0]
        assert began["node"] == "harness" and AT_S <= began["t_ns"] / 1e9 < AT_S + 0.5
        assert run.summary["faults"].split(" ")[0] == FAULTS[name][0].get("edge", "cut")
    if "cut" in runs:
        assert runs["cut"].summary["faults"] == "cut 2.0-4.0"
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
        assert AT_S < left < BACK_S < back, name
    if "killed" not in runs:
        return
    assert runs["killed"].states() == ["OS", "MES"]
    assert runs["killed"].summary["track_losses"] == 0


def test_a_restarted_edge_gets_a_map(runs: dict[str, Run]) -> None:
    if "again" in runs:
        again = runs["again"]
        assert len(again.of("node_restarted")) == 1
        # A field without a column in the table.
        assert json.loads(again.of("handover_sent")["extra"].iloc[-1])["whole"] is True
    if "static again" not in runs:
        return
    static = runs["static again"]
    assert len(static.of("node_restarted")) == 1
    restarted_s = float(static.of("fault_ended")["t_ns"].iloc[0]) / 1e9
    received = static.of("keyframe_received")
    assert (received["t_ns"] / 1e9 > restarted_s).any()
    assert len(static.of("edge_restarted")) == 1


def test_explain_shows_the_faults(runs: dict[str, Run], tmp_path: Path) -> None:
    reported = {
        "frozen": "edge frozen from 2.",
        "cut": "link cut from 2.00 s to 4.00 s",
        "killed": "edge killed from 2.",
    }
    for name in reported.keys() & runs.keys():
        code, out, err = slambed("explain", str(runs[name].folder), "-o", str(tmp_path / "x.png"))
        assert code == ExitCode.OK, err
        assert reported[name] in out
