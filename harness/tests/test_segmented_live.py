# SPDX-License-Identifier: Apache-2.0
"""What segments, live: each variant of edgeslam_semantic with a segmenter beside its edge, and with
one that is killed in the middle."""

import json
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
import pytest
import yaml
from command_line import slambed
from harness_parts import is_trusted, segmenters
from test_campaign_end_to_end import image_is_built, programs_are_built
from test_faults_end_to_end import Run
from virtual_parts import make_sequence

from slambed.engines.segmenter import FOLDER
from slambed.errors import ExitCode

SECONDS, FPS = 6, 10
PEOPLE = ("--sensor", "mono", "--trajectory", "xyz", "--people", "2", "--activity", "crossing",
          "--width", "320", "--height", "240", "--texel-scale", "4")  # fmt: skip
VARIANTS = ("adaptive", "no_adapt", "maskslam_offloaded")
FLOOR_MS = 150
KILL_AFTER_S = 2.0
AT_ITS_END = 2
"""Pictures of edgeSLAM that are still to be segmented when the mobile says goodbye."""
pytestmark = [
    pytest.mark.programs,
    pytest.mark.live,
    pytest.mark.skipif(
        os.geteuid() != 0 or not programs_are_built(),
        reason="needs root, and the programs ('make build')",
    ),
]


def play(folder: Path, engine: str, *variants: str) -> dict[str, Run]:
    """By variant, what may be judged: on a busy host not every run."""
    experiment = {
        "id": "segmented",
        "title": "People cross the picture",
        "systems": [
            {"system": "edgeslam_semantic", "variant": name, "label": name} for name in variants
        ],
        "datasets": [str(make_sequence(folder / "walk", SECONDS, *PEOPLE))],
        "playback": {"mode": "realtime", "fps": FPS},
        "link": {"profiles": ["infocom_wifi_5g"]},
        "devices": {"mobile": "host", "edge": "host"},
        "runs": {"default": 1},
        # Other tests may run beside this one: how exact the link is, is not what is tested here.
        "tolerances": {"rtt_error_ms_median": 50},
    }
    path = folder / "segmented.yaml"
    path.write_text(yaml.safe_dump(experiment))
    results = folder / "results"
    code, out, err = slambed(
        *("run", str(path), "--engine", engine, "--results", str(results), "--wait", "--no-figures")
    )
    assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), out + err
    found = [Run(run) for run in (results / "segmented" / "runs").iterdir()]
    assert len(found) == len(variants), out + err
    for run in found:
        assert run.summary["outcome"] == "completed", run.summary
    trusted = [run for run in found if is_trusted(run.summary)]
    assert segmenters(results) == []
    return {str(run.summary["variant"]): run for run in trusted}


def stages(run: Run, name: str) -> pd.DataFrame:
    found = run.of("stage")
    return found[found["name"] == name]


@pytest.mark.parametrize("engine", ["local", "docker"])
def test_every_picture_that_came_is_segmented_and_none_besides(engine: str, tmp_path: Path) -> None:
    if engine == "docker" and not image_is_built():
        pytest.skip("needs the node image ('make images')")
    for variant, run in play(tmp_path, engine, *VARIANTS).items():
        segmented = len(stages(run, "segment"))
        held = run.of("mask_held")
        assert segmented == len(held) > 5, variant
        assert run.of("segment_failed").empty, variant
        told = [json.loads(extra) for extra in held["extra"]]  # the table has no columns for them
        # The end of a run does not wait for what is held back last.
        assert all(t["took_ms"] + t["held_ms"] >= FLOOR_MS - 1 for t in told[:-1]), variant
        if variant == "maskslam_offloaded":
            assert segmented == len(run.of("frame_sent")) == len(run.of("frame_answered"))
        else:
            mapped = len(run.of("keyframe_sent"))
            assert mapped - AT_ITS_END <= segmented <= mapped, variant
            assert len(run.of("mask_applied")) > 2, variant
            assert run.summary["coverage"] > 0.5, variant


class Killer(threading.Thread):
    """Kills each segmenter in this folder in the middle of its run."""

    def __init__(self, folder: Path) -> None:
        super().__init__(daemon=True)
        self.folder, self.over, self.killed = folder, threading.Event(), 0

    def run(self) -> None:
        began: dict[int, float] = {}
        while not self.over.wait(0.05):
            for process in segmenters(self.folder):
                if (_run_of(process) / "start.json").exists():
                    since = began.setdefault(process.pid, time.monotonic())
                    if time.monotonic() - since > KILL_AFTER_S:
                        process.send_signal(signal.SIGKILL)
                        began[process.pid] = float("inf")
                        self.killed += 1


def _run_of(process: psutil.Process) -> Path:
    (socket,) = (part for part in process.info["cmdline"] if f"/{FOLDER}/" in part)
    return Path(socket).parents[1]


def test_tracking_goes_on_without_its_segmenter(tmp_path: Path) -> None:
    killer = Killer(tmp_path)
    killer.start()
    try:
        runs: dict[str, Any] = play(tmp_path, "local", "no_adapt", "maskslam_offloaded")
    finally:
        killer.over.set()
        killer.join()
    assert killer.killed >= 2
    for variant, run in runs.items():
        failed = run.of("segment_failed")
        assert len(failed) > 0, variant
        assert failed["reason"].str.contains("segmenter").all(), variant
        dead_ns = failed["t_ns"].min()
        assert run.of("mask_held")["t_ns"].max() < dead_ns, variant
        tracked = run.of("frame_tracked")
        after = tracked[tracked["t_ns"] > dead_ns]
        assert (after["state"] == "ok").sum() > FPS, variant
        assert run.summary["frames_total"] == SECONDS * FPS
