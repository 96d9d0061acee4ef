# SPDX-License-Identifier: Apache-2.0
"""The worked examples with limits and over a varying link, engines local and docker."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest
from command_line import slambed
from harness_parts import TOLERANCES, is_valid_run, needs_root
from test_campaign_end_to_end import image_is_built, programs_are_built
from virtual_parts import make_sequence

from slambed.errors import ExitCode
from slambed.native import repository_root

EXAMPLES = repository_root() / "examples" / "visual_odometry"
EXPERIMENT = """\
id: theirs
title: Systems that are programs of their own
systems:
  - {{system: {examples}/remote_odometry.yaml, label: remote, {faults}}}
  - {{system: {examples}/folder_odometry.yaml, label: reader}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 5}}
link:
  backend: relay
  profiles:
    - {{profile: ramp, name: ramp, params: {{peak_ms: 40, rise_s: 1, hold_s: 1, fall_s: 1}}}}
devices: {{mobile: raspberry_pi_4, edge: edge_i7_6700t}}
runs: {{default: 1}}
tolerances: {tolerances}
"""

pytestmark = [
    needs_root,
    pytest.mark.skipif(not programs_are_built(), reason="needs the programs ('make build')"),
]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequence(tmp_path_factory.mktemp("synthetic") / "walk")


def run_them(
    folder: Path, sequence: Path, engine: str, faults: str = "profiles: [ramp]"
) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """System -> summary and manifest of its run."""
    path = folder / "theirs.yaml"
    tolerances = json.dumps(TOLERANCES)
    path.write_text(
        EXPERIMENT.format(
            examples=EXAMPLES, sequence=sequence, faults=faults, tolerances=tolerances
        )
    )
    code, out, err = slambed(
        *("run", str(path), "--engine", engine, "--results", str(folder / "results")),
        *("--wait", "--no-figures"),
    )
    assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), out + err
    found = {}
    for run in (folder / "results" / "theirs" / "runs").iterdir():
        summary = json.loads((run / "summary.json").read_text())
        found[summary["system"]] = summary, json.loads((run / "manifest.json").read_text())
    assert sorted(found) == ["folder_odometry", "remote_odometry"], out + err
    return found


def judge(found: dict[str, tuple[dict[str, Any], dict[str, Any]]]) -> None:
    for summary, manifest in found.values():
        if not is_valid_run(summary):
            continue
        assert summary["outcome"] == "completed", summary["outcome_reason"]
        assert summary["frames_total"] == 20 and summary["frames_tracked"] >= 1
        assert summary["frames_tracked"] + (summary["frames_dropped"] or 0) <= 20
        assert summary["ate_rmse_m"] < 0.1
        # Player and program: all threads of both are capped at one core of the device.
        names = {thread["name"] for thread in manifest["limits"]["mobile"]["threads"]}
        assert {"slambed-play", "python3"} <= names
    remote, _ = found["remote_odometry"]
    if remote["valid"]:
        assert remote["bytes_up"] > 20 * remote["bytes_down"] > 0
        assert remote["rtt_error_ms_median"] < 50
    reader, manifest = found["folder_odometry"]
    assert reader["bytes_up"] is None
    if reader["valid"]:
        # It received the played frames, but the times of their tracking are unknown.
        assert reader["frames_total"] == reader["frames_tracked"] == 20
        assert reader["coverage"] == 1.0 and reader["track_losses"] == 0
        assert reader["mobile_cpu_percent_mean"] > 1 and reader["mobile_mem_mb_peak"] > 20
        assert 0.3 < reader["wall_s"] < 30
        for unknown in ("frames_dropped", "track_ms_median", "coverage_processed"):
            assert reader[unknown] is None, unknown
    assert manifest["spec"]["runtime"]["reads"] == "tum"


def test_programs_of_others_run_under_limits_and_over_the_link(
    tmp_path: Path, sequence: Path
) -> None:
    judge(run_them(tmp_path, sequence, "local"))


def test_an_edge_of_others_that_is_killed_costs_frames_and_not_the_run(
    tmp_path: Path, sequence: Path
) -> None:
    killed = "faults: [{at_s: 2, edge: kill}]"
    summary, _ = run_them(tmp_path, sequence, "local", killed)["remote_odometry"]
    if is_valid_run(summary):
        assert summary["outcome"] == "completed", summary["outcome_reason"]
        assert 1 <= summary["frames_tracked"] <= 12 and summary["track_losses"] == 1


@pytest.mark.nightly
@pytest.mark.skipif(not image_is_built(), reason="needs Docker and the node image ('make images')")
def test_the_same_in_containers_of_their_own_image(tmp_path: Path, sequence: Path) -> None:
    subprocess.run([EXAMPLES / "build_image.sh"], check=True, stdout=subprocess.DEVNULL)
    found = run_them(tmp_path, sequence, "docker")
    judge(found)
    assert len({manifest["spec"]["software"] for _, manifest in found.values()}) == len(found)
