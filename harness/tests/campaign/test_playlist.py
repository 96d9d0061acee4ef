# SPDX-License-Identifier: Apache-2.0
"""Python's list of offered frames equals that of the C++ player (`playback.cpp`)."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from virtual_parts import EXPERIMENT, Quiet, make_sequence, needs_programs, plan_of, played_of

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.runner import Runner
from slambed.data.playlist import offered_frames
from slambed.data.prepared import PreparedSequence
from slambed.files.json_file import read_object
from slambed.native import find_program

pytestmark = needs_programs

PLAYBACKS = [
    "mode: every_frame",
    # 10 to 4 fps is a ratio of 2.5: every third frame is offered.
    "mode: every_frame, fps: 4",
    # Both ends lie on frames: the first is included, the second excluded.
    "mode: every_frame, fps: 5, start_s: 0.3, end_s: 1.5",
    "mode: every_frame, fps: 3, start_s: 0.35, end_s: 1.75",
    # More than the recorded rate.
    "mode: every_frame, fps: 30, end_s: 1",
]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequence(tmp_path_factory.mktemp("playlist") / "walk", 2)


@pytest.mark.parametrize("playback", PLAYBACKS)
def test_python_and_cpp_offer_the_same_frames(
    playback: str, sequence: Path, tmp_path: Path
) -> None:
    text = EXPERIMENT.replace("mode: realtime, fps: 10", playback)
    (tmp_path / "walk.yaml").write_text(text.format(sequence=sequence, runs=1))
    plan = plan_of(tmp_path / "walk.yaml")
    (spec,) = (s for s in plan.specs if s.label == "alone")
    folder = ResultFolder(tmp_path / "results" / "walk")
    folder.create()
    executor = ProcessExecutor(played_of(plan), find_program("slambed-sim"), None, 1)
    ledger = Ledger(folder.path / "ledger.jsonl")
    assert Runner(folder, ledger, executor).run([spec], Quiet()).valid == 1

    events = pd.read_parquet(folder.runs / spec.run_key / "events.parquet")
    tracked = events[events["type"] == "frame_tracked"]
    prepared = PreparedSequence.open(sequence)
    times_ns, play = prepared.index["timestamp_ns"].astype(np.int64), spec.playback
    expected = offered_frames(times_ns, prepared.info.fps, play.fps, play.start_s, play.end_s)
    # In this mode every offered frame is tracked.
    assert tracked["frame"].astype(int).tolist() == expected.tolist() and len(expected) > 3
    # Playback time starts with the first offered frame.
    played_s = (times_ns[expected] - times_ns[expected[0]]) / 1e9
    assert np.allclose(tracked["seq_s"], played_s, atol=1e-9)
    facts = read_object(folder.runs / spec.run_key / "manifest.json")
    assert facts is not None and facts["frames_offered"] == len(expected)
    folder.close()
