# SPDX-License-Identifier: Apache-2.0
"""Masks: run lengths, mask files, persons from a network's maps, scores."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from data_samples import write_prepared

from slambed.data.picture_sheet import TILE_WIDTH_PX
from slambed.errors import SlambedError
from slambed.segment.frame_file import MASKS, encode_frames
from slambed.segment.instances import Instance, Segmented, mask_of, runs_of
from slambed.segment.mask_cache import MaskCache, decode_frame, encode_frame
from slambed.segment.people import Middle, find_centers, persons, suppress
from slambed.segment.scores import Scores, keypoint_similarity
from slambed.segment.sheet import write_mask_sheet

ROWS, COLUMNS = 64, 80


def disc(width: int, height: int, u: float, v: float, radius: float) -> np.ndarray:
    y, x = np.mgrid[:height, :width]
    return (x - u) ** 2 + (y - v) ** 2 < radius**2


def points(seed: int) -> np.ndarray:
    drawn = np.random.default_rng(seed).uniform(0, 30, (17, 3)).astype(np.float32)
    drawn[:, 2] = np.arange(17) % 3
    return drawn


def picture() -> Segmented:
    first = Instance(0, 0.75, disc(40, 30, 10, 12, 6), True, points(1))
    second = Instance(3, 0.5, disc(40, 30, 30, 20, 9), False)
    return Segmented(40, 30, (first, second))


@pytest.mark.parametrize("pattern", ["0", "1", "01", "10", "0011", "110100"])
def test_runs_and_masks_are_the_same_thing(pattern: str) -> None:
    mask = np.array([[c == "1" for c in pattern]])
    runs = runs_of(mask)
    assert runs.sum() == mask.size and runs[1:].all()
    assert np.array_equal(mask_of(runs, mask.shape[1], 1), mask)


def test_a_file_gives_back_what_was_put_into_it(tmp_path: Path) -> None:
    file = tmp_path / "a.masks"
    blocks = [encode_frame(picture()), encode_frame(Segmented(40, 30))]
    file.write_bytes(encode_frames(MASKS, "made for a test", blocks))
    masks = MaskCache.open(file, "made for a test")
    assert len(masks) == 2 and masks.frame(1).instances == ()
    for found, put in zip(masks.frame(0).instances, picture().instances, strict=True):
        assert (found.class_index, found.score, found.moves) == (
            put.class_index,
            put.score,
            put.moves,
        )
        assert np.array_equal(found.mask, put.mask)
        if put.keypoints is not None:
            assert np.array_equal(found.keypoints, put.keypoints)
    assert np.array_equal(masks.frame(0).moving(), picture().instances[0].mask)


def test_a_sheet_shows_what_was_found_and_only_that(tmp_path: Path) -> None:
    sequence = write_prepared(tmp_path / "s", frames=5)
    width, height = sequence.info.width, sequence.info.height
    half = np.zeros((height, width), np.bool_)
    half[height // 2 :] = True
    found = Segmented(width, height, (Instance(0, 0.9, half),))
    blocks = [encode_frame(found if i == 0 else Segmented(width, height)) for i in range(5)]
    (tmp_path / "a.masks").write_bytes(encode_frames(MASKS, "a", blocks))
    write_mask_sheet(sequence, MaskCache.open(tmp_path / "a.masks"), tmp_path / "sheet.png", 5)
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    tall = round(height * TILE_WIDTH_PX / width)
    assert sheet.shape == (2 * tall, 4 * TILE_WIDTH_PX, 3)  # five frames, four per row
    colored = np.ptp(sheet.astype(int), axis=2) > 0
    below = slice(tall // 2 + 8, tall - 8)
    assert colored[below, :TILE_WIDTH_PX].all()
    assert not colored[:, TILE_WIDTH_PX:].any() and not colored[tall:].any()


def test_a_file_for_something_else_or_torn_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "a.masks"
    whole = encode_frames(MASKS, "a", [encode_frame(picture())])
    file.write_bytes(whole)
    with pytest.raises(SlambedError, match="made for 'a', not for 'b'"):
        MaskCache.open(file, "b")
    for torn in (b"", whole[:20], whole[:40], whole[:-1], b"SLIC" + whole[4:], whole + b"x"):
        file.write_bytes(torn)
        with pytest.raises(SlambedError, match="damaged") as raised:
            MaskCache.open(file)
        assert "\n" not in str(raised.value)


def test_no_flipped_byte_of_a_frame_passes() -> None:
    block = encode_frame(picture())
    for at in range(len(block)):
        broken = bytearray(block)
        broken[at] ^= 0x41
        with pytest.raises((ValueError, struct.error)):
            decode_frame(bytes(broken))


@pytest.mark.parametrize(
    ("at", "value", "why"),
    [
        (18, b"\x04\x00", "flags"),
        (20, b"\x00\x00\x00\x40", "score"),
        (20, b"\x00\x00\xc0\x7f", "score"),
        (28, b"\x00\x00\xc0\x7f", "key points"),
        (24, b"\xff\xff\xff\x0f", "buffer"),
    ],
)
def test_nonsense_with_a_right_crc_is_refused(at: int, value: bytes, why: str) -> None:
    block = bytearray(encode_frame(picture()))
    block[at : at + len(value)] = value
    block[4:8] = zlib.crc32(bytes(block[8:])).to_bytes(4, "little")
    with pytest.raises(ValueError, match=why):
        decode_frame(bytes(block))


def maps_of(people: list[tuple[int, int, int, int, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Returns the output of a perfect network for people as boxes (u, v, width, height in cells,
    score)."""
    mask = np.zeros((2 * ROWS, 2 * COLUMNS), np.float32)
    maps = np.zeros((22, ROWS, COLUMNS), np.float32)
    y, x = np.mgrid[:ROWS, :COLUMNS]
    for u, v, width, height, score in people:
        rows, columns = (
            slice(v - height // 2, v + height // 2),
            slice(u - width // 2, u + width // 2),
        )
        mask[2 * rows.start : 2 * rows.stop, 2 * columns.start : 2 * columns.stop] = 1
        maps[0, v, u] = score
        maps[1, rows, columns] = (u - x)[rows, columns] / 16
        maps[2, rows, columns] = (v - y)[rows, columns] / 16
        maps[3, v, u], maps[4, v, u] = np.log(width / 16), np.log(height / 16)
        maps[5, v - height // 2, u] = 0.9  # the nose on top
    return mask, maps


def test_people_beside_each_other_are_distinguished() -> None:
    found = persons(*maps_of([(20, 30, 12, 40, 0.9), (50, 30, 16, 40, 0.8)]), 640, 480, 0.8)
    assert [round(i.score, 2) for i in found.instances] == [0.9, 0.8]
    left, right = found.instances
    assert left.mask[225, 160] and not left.mask[225, 400] and right.mask[225, 400]
    assert left.keypoints is not None and left.keypoints[0, 2] == 2
    assert left.keypoints[0, :2] == pytest.approx((8 * 20.5 - 0.5, 7.5 * 10.5 - 0.5), abs=4)
    assert not left.keypoints[1:, 2].any()


def test_n_m_says_from_which_overlap_two_are_one() -> None:
    maps = maps_of([(30, 30, 20, 40, 0.9)])
    maps[1][0, 30, 33] = 0.8
    maps[1][3, 30, 33], maps[1][4, 30, 33] = np.log(20 / 16), np.log(40 / 16)
    maps[1][1, :, 32:] -= (30 - 33) / 16  # half of the votes are for the second
    first, second = find_centers(maps[1])
    assert first.overlap(second) == pytest.approx(17 / 23)
    assert len(persons(*maps, 640, 480, 0.8).instances) > len(
        persons(*maps, 640, 480, 0.6).instances
    )


def test_suppression_keeps_the_best_and_what_lies_apart() -> None:
    middles = [Middle(10, 10, 8, 8, 0.9), Middle(11, 10, 8, 8, 0.8), Middle(40, 10, 8, 8, 0.7)]
    assert suppress(middles, 0.5) == [middles[0], middles[2]]
    assert suppress(middles, 1.0) == middles


def test_a_person_without_a_middle_is_kept_for_culling() -> None:
    mask, maps = maps_of([(30, 30, 20, 40, 0.9)])
    maps[0] = 0
    (found,) = persons(mask, maps, 640, 480, 0.8).instances
    assert found.moves and found.mask.mean() > 0.1 and found.score < 0.5


def test_scores_of_the_truth_itself_are_perfect() -> None:
    scores = Scores()
    truth = Segmented(40, 30, (picture().instances[0],))
    scores.add(truth, truth)
    scores.add(Segmented(40, 30), Segmented(40, 30))
    content = scores.as_dict()
    assert (content["iou_mean"], content["recall"], content["precision"]) == (1, 1, 1)
    assert content["marked_without_people"] == 0


def test_scores_of_a_shifted_mask_are_the_counted_ones() -> None:
    true, found = np.zeros((10, 10), bool), np.zeros((10, 10), bool)
    true[:, :4], found[:, 2:4] = True, True
    found[:, 4:5] = True
    scores = Scores()
    scores.add(
        Segmented(10, 10, (Instance(0, 1.0, found),)), Segmented(10, 10, (Instance(0, 1.0, true),))
    )
    content = scores.as_dict()
    assert content["iou_mean"] == pytest.approx(20 / 50)
    assert (content["recall"], content["precision"]) == (0.5, pytest.approx(2 / 3, abs=1e-4))


def test_key_point_similarity_falls_with_distance_and_misses() -> None:
    truth = points(2)
    truth[:, 2] = 2
    near, missing = truth.copy(), truth.copy()
    near[:, 0] += 3
    missing[8:, 2] = 0
    area = 1000.0
    assert keypoint_similarity(truth, truth, area) == pytest.approx(1)
    assert 0.2 < keypoint_similarity(near, truth, area) < 0.95
    assert keypoint_similarity(missing, truth, area) == pytest.approx(8 / 17)
