# SPDX-License-Identifier: Apache-2.0
"""Recall and precision of a run's culling, judged by the labels of a generated sequence."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from results_factory import RawRun, spec_of, write_raw

from slambed.errors import SlambedError
from slambed.metrics.culling import Culling, culling_of, widened
from slambed.metrics.run_summary import summarize_run
from slambed.segment.frame_file import MASKS, encode_frames
from slambed.segment.instances import Instance, Mask, Segmented
from slambed.segment.mask_cache import LABELS_FILE, LABELS_KEY, encode_frame

WIDTH, HEIGHT, BORDER_PX = 40, 30, 3


def block(left: int, right: int) -> Mask:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[10:20, left:right] = True
    return mask


def write_labels(folder: Path, *frames: Segmented) -> None:
    folder.mkdir(exist_ok=True)
    data = encode_frames(MASKS, LABELS_KEY, [encode_frame(frame) for frame in frames])
    (folder / LABELS_FILE).write_bytes(data)


def features_event(frame: int, kept: str, culled: str) -> dict[str, Any]:
    return {"type": "frame_features", "frame": frame, "kept": kept, "culled": culled}


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    person = Instance(0, 1.0, block(10, 20))
    chair = Instance(1, 1.0, block(30, 35), moves=False)
    write_labels(
        tmp_path / "walk", Segmented(WIDTH, HEIGHT, (person, chair)), Segmented(WIDTH, HEIGHT)
    )
    return tmp_path / "walk"


def test_all_features_of_all_frames_count_alike(sequence: Path) -> None:
    frames = [
        # On a person: culled twice, kept once. Near one: culled once, kept once. On a chair:
        # culled.
        features_event(0, kept="15 15 22 15 0 0 ", culled="10 10 19 19 22 19 32 15 "),
        features_event(1, kept="15 15 ", culled="16 16 "),  # no person there
    ]
    found = culling_of(frames, sequence, BORDER_PX)
    assert found.recall == pytest.approx(2 / 3)
    assert found.precision == pytest.approx(3 / 5)
    assert culling_of(frames, sequence, 0).precision == pytest.approx(2 / 5)


def test_nothing_to_share_out_is_no_number(sequence: Path) -> None:
    assert culling_of([features_event(1, "15 15 ", "")], sequence, BORDER_PX) == Culling()
    outside = culling_of([features_event(0, "-3 12 99 12 ", "12 -1 12 30 ")], sequence, BORDER_PX)
    assert outside == Culling(recall=None, precision=0.0)


@pytest.mark.parametrize("border_px", [0, 1, 3, 50])
def test_the_border_is_a_square(border_px: int) -> None:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[12, 7] = mask[0, WIDTH - 1] = True
    rows, columns = np.indices(mask.shape)
    expected = np.zeros_like(mask)
    for row, column in np.argwhere(mask):
        expected |= np.maximum(abs(rows - row), abs(columns - column)) <= border_px
    assert np.array_equal(widened(mask, border_px), expected)


def test_labels_of_another_kind_are_refused(sequence: Path) -> None:
    (sequence / LABELS_FILE).write_bytes(hashlib.sha256(b"nonsense").digest() * 4)
    with pytest.raises(SlambedError, match=r"labels\.bin"):
        culling_of([features_event(0, "", "")], sequence, BORDER_PX)


def test_a_summary_has_them_where_the_sequence_has_labels(sequence: Path, tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun())
    spec = spec_of("edgeslam_semantic", "adaptive", "infocom_wifi_5g", 0)
    spec["params"] = {"mask_border_px": BORDER_PX, "record_culling": True}
    run = json.loads((raw / "run.json").read_text()) if (raw / "run.json").exists() else {}
    (raw / "run.json").write_text(json.dumps(run | {"sequence": str(sequence)}))
    assert summarize_run(raw, spec)["cull_recall"] is None
    with (raw / "mobile" / "events.jsonl").open("a") as events:
        events.write(json.dumps(features_event(0, "15 15 ", "10 10 0 0 ") | {"t_ns": 1}) + "\n")
    found = summarize_run(raw, spec)
    assert (found["cull_recall"], found["cull_precision"]) == (0.5, 0.5)
    (sequence / LABELS_FILE).unlink()
    assert summarize_run(raw, spec)["cull_recall"] is None
