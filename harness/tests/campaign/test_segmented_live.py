# SPDX-License-Identifier: Apache-2.0
"""Live segmentation: each variant of edgeslam_semantic with a segmenter on its edge, and with
one that is killed or hangs during the run."""

import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
import pytest
import yaml
from command_line import slambed
from harness_parts import TOLERANCES, is_valid_run, segmenters
from test_campaign_end_to_end import image_is_built, programs_are_built
from test_faults_end_to_end import Run
from virtual_parts import make_sequence
from waiting import LIMIT_S

from slambed.engines.segmenter import FOLDER
from slambed.errors import ExitCode

SECONDS, FPS = 6, 10
PEOPLE = ("--sensor", "mono", "--trajectory", "xyz", "--people", "2", "--activity", "crossing",
          "--width", "320", "--height", "240", "--texel-scale", "4")  # fmt: skip
VARIANTS = ("adaptive", "no_adapt", "maskslam_offloaded")
FLOOR_MS = 150
FAULT_AFTER_S = 2.0
AT_ITS_END = 2
"""Pictures of edgeSLAM that may still be unsegmented when the mobile node ends."""
pytestmark = [
    pytest.mark.programs,
    pytest.mark.live,
    pytest.mark.skipif(
        os.geteuid() != 0 or not programs_are_built(),
        reason="needs root, and the programs ('make build')",
    ),
]


def play(
    folder: Path, engine: str, *variants: str, faults: Sequence[dict[str, Any]] = ()
) -> dict[str, Run]:
    """Returns the valid runs by variant; on a busy host some may be invalid."""
    experiment = {
        "id": "segmented",
        "title": "People cross the picture",
        "systems": [
            {"system": "edgeslam_semantic", "variant": name, "label": name, "faults": list(faults)}
            for name in variants
        ],
        "datasets": [str(make_sequence(folder / "walk", SECONDS, *PEOPLE))],
        "playback": {"mode": "realtime", "fps": FPS},
        "link": {"profiles": ["infocom_wifi_5g"]},
        "devices": {"mobile": "host", "edge": "host"},
        "runs": {"default": 1},
        "tolerances": TOLERANCES,
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
    valid = [run for run in found if is_valid_run(run.summary)]
    for run in valid:
        assert run.summary["outcome"] == "completed", run.summary
    assert segmenters(results) == []
    return {str(run.summary["variant"]): run for run in valid}


def stages(run: Run, name: str) -> pd.DataFrame:
    found = run.of("stage")
    return found[found["name"] == name]


@pytest.mark.parametrize("engine", ["local", pytest.param("docker", marks=pytest.mark.nightly)])
def test_every_picture_that_came_is_segmented_and_none_besides(engine: str, tmp_path: Path) -> None:
    if engine == "docker" and not image_is_built():
        pytest.skip("needs the node image ('make images')")
    for variant, run in play(tmp_path, engine, *VARIANTS).items():
        segmented = len(stages(run, "segment"))
        held = run.of("mask_held")
        assert segmented == len(held) > 5, variant
        assert run.of("segment_failed").empty, variant
        reported = [
            json.loads(extra) for extra in held["extra"]
        ]  # the table has no columns for them
        # The end of a run does not wait for the last delayed masks.
        assert all(t["took_ms"] + t["held_ms"] >= FLOOR_MS - 1 for t in reported[:-1]), variant
        if variant == "maskslam_offloaded":
            assert segmented == len(run.of("frame_sent")) == len(run.of("frame_answered"))
        else:
            mapped = len(run.of("keyframe_sent"))
            assert mapped - AT_ITS_END <= segmented <= mapped, variant
            assert len(run.of("mask_applied")) > 2, variant
            assert run.summary["coverage"] > 0.5, variant


class Fault(threading.Thread):
    """Applies `meet` to the segmenter of each run in this folder, in the middle of the run."""

    def __init__(self, folder: Path, meet: Callable[[psutil.Process], None]) -> None:
        super().__init__(daemon=True)
        self.folder, self.meet = folder, meet
        self.over, self.met = threading.Event(), 0

    def run(self) -> None:
        began: dict[Path, float] = {}
        while not self.over.wait(0.05):
            for process in segmenters(self.folder):
                run = _run_of(process)
                if not (run / "start.json").exists():
                    continue
                if time.monotonic() - began.setdefault(run, time.monotonic()) > FAULT_AFTER_S:
                    self.meet(process)
                    began[run] = float("inf")
                    self.met += 1


def _run_of(process: psutil.Process) -> Path:
    (socket,) = (part for part in process.info["cmdline"] if f"/{FOLDER}/" in part)
    return Path(socket).parents[1]


def kill(process: psutil.Process) -> None:
    process.send_signal(signal.SIGKILL)


def hang(process: psutil.Process) -> None:
    process.send_signal(signal.SIGSTOP)


def kill_container(process: psutil.Process) -> None:
    ask = ["docker", "ps", "--quiet", "--filter", f"volume={_run_of(process) / FOLDER}"]
    found = subprocess.run(ask, capture_output=True, text=True, check=True).stdout.split()
    assert len(found) == 1, found
    subprocess.run(["docker", "kill", *found], capture_output=True, check=True)


def meet_segmenters(
    engine: str, meet: Callable[[psutil.Process], None], variants: Sequence[str], folder: Path
) -> dict[str, Run]:
    """Executes runs with a fault of their segmenter in the middle."""
    if engine == "docker" and not image_is_built():
        pytest.skip("needs the node image ('make images')")
    fault = Fault(folder, meet)
    fault.start()
    try:
        runs = play(folder, engine, *variants)
    finally:
        fault.over.set()
        fault.join(LIMIT_S)
    assert not fault.is_alive(), "what meets the segmenters goes on"
    assert fault.met >= len(variants)
    return runs


def goes_on_without_masks(variant: str, run: Run, uploads: int) -> int:
    """Checks that tracking continues; returns the time of the first picture without masks.
    `uploads`: minimum number of edgeSLAM's later keyframes, each sent after the report that the
    previous one has no mask."""
    failed = run.of("segment_failed")
    assert len(failed) > 0, variant
    assert failed["reason"].str.contains("segmenter").all(), variant
    dead_ns = int(failed["t_ns"].min())
    tracked = run.of("frame_tracked")
    after = tracked[tracked["t_ns"] > dead_ns]
    assert (after["state"] == "ok").sum() > FPS, variant
    assert run.summary["frames_total"] == SECONDS * FPS
    if variant == "no_adapt":
        assert (run.of("keyframe_sent")["t_ns"] > dead_ns).sum() >= uploads, variant
        missing = run.of("mask_missing")
        assert len(missing) >= len(failed) - 1, variant
        assert (missing["reason"] == "not segmented").all(), variant
    return dead_ns


@pytest.mark.parametrize(
    ("engine", "meet"),
    [("local", kill), pytest.param("docker", kill_container, marks=pytest.mark.nightly)],
)
def test_a_segmenter_that_dies_is_started_again(
    engine: str, meet: Callable[[psutil.Process], None], tmp_path: Path
) -> None:
    runs = meet_segmenters(engine, meet, ("no_adapt", "maskslam_offloaded"), tmp_path)
    for variant, run in runs.items():
        dead_ns = goes_on_without_masks(variant, run, uploads=3)
        assert len(run.of("segmenter_ended")) == 1, variant
        (back_ns,) = run.of("segmenter_restarted")["t_ns"]
        assert run.of("segmenter_ended")["t_ns"].iloc[0] <= back_ns, variant
        held, failed = run.of("mask_held"), run.of("segment_failed")
        assert not held["t_ns"].between(dead_ns, back_ns).any(), variant
        assert (held["t_ns"] > back_ns).sum() > 2, variant
        # One picture may have been on its way to the dead segmenter.
        assert (failed["t_ns"] > back_ns).sum() <= 1, variant
        assert run.summary["segmenter_restarts"] == 1, variant
        beside = json.loads((run.folder / "manifest.json").read_text())["sidecar"]
        assert beside["segmenter_restarts"] == 1, variant
        assert beside["segmenter_cpu_s"] is None, variant


@pytest.mark.nightly
def test_tracking_goes_on_beside_a_segmenter_that_hangs(tmp_path: Path) -> None:
    # Full offload waits for each mask, so it would hardly track.
    for variant, run in meet_segmenters("local", hang, ("no_adapt",), tmp_path).items():
        dead_ns = goes_on_without_masks(variant, run, uploads=1)
        assert run.of("mask_held")["t_ns"].max() < dead_ns, variant
        assert run.of("segmenter_ended").empty, variant


def test_an_edge_that_is_started_again_maps_and_segments_again(tmp_path: Path) -> None:
    faults = [{"at_s": 2.0, "edge": "kill"}, {"at_s": 3.5, "edge": "restart"}]
    for variant, run in play(tmp_path, "local", "adaptive", "no_adapt", faults=faults).items():
        assert len(run.of("node_restarted")) == 1, variant
        restarted = run.of("edge_restarted")
        assert len(restarted) == 1, variant
        since = restarted["t_ns"].iloc[0]
        killed, back = run.of("fault_began")["t_ns"].iloc[0], run.of("fault_ended")["t_ns"].iloc[0]
        assert killed < back < since, variant
        for kind in ("keyframe_sent", "keyframe_mapped", "slice_applied", "mask_applied"):
            assert (run.of(kind)["t_ns"] >= since).sum() >= 2, (variant, kind)
        # The new edge sends no slice of another map than the mobile node's.
        assert not (run.of("slice_declined")["t_ns"] > since).any(), variant
        tracked = run.of("frame_tracked")
        away = tracked[(tracked["t_ns"] > killed) & (tracked["t_ns"] < back)]
        assert (away["state"] == "ok").sum() > FPS / 2, variant
