# SPDX-License-Identifier: Apache-2.0
"""The prepared sequence: round trip, reports of damage, removal of unfinished sequences."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from data_samples import (
    CAMERA,
    HEIGHT,
    WIDTH,
    depth,
    flip,
    gray,
    one_line,
    trajectory,
    write_prepared,
)

from slambed.data.model import Frame
from slambed.data.prepared import PreparedSequence, PreparedWriter, move_into_place
from slambed.data.trajectory import Trajectory, read_groundtruth
from slambed.errors import SlambedError


def test_round_trip(tmp_path: Path) -> None:
    sequence = write_prepared(tmp_path / "s")
    sequence.verify(full=True)
    assert len(sequence) == 4
    assert np.array_equal(sequence.gray(3), gray(3))
    assert np.array_equal(sequence[0].second, depth(0))
    assert sequence[3].timestamp_ns == 1_000_300_000_000
    assert sequence.times_s == pytest.approx([0, 0.1, 0.2, 0.3])
    assert sequence.info.camera == CAMERA
    assert list(sequence.index["flags"]) == [0, 0, 1, 0]
    assert np.allclose(sequence.groundtruth().rows(), trajectory([1000.0, 1000.1, 1000.2]).rows())
    assert list(tmp_path.iterdir()) == [tmp_path / "s"]


def test_layout_is_the_documented_one(tmp_path: Path) -> None:
    write_prepared(tmp_path / "s")
    block = (tmp_path / "s/frames.bin").read_bytes()[3 * 12288 : 4 * 12288]
    pixels = WIDTH * HEIGHT
    assert block[:pixels] == gray(3).tobytes()
    assert block[pixels : 3 * pixels] == depth(3).astype("<u2").tobytes()
    assert set(block[3 * pixels :]) == {0}
    index = (tmp_path / "s/index.bin").read_bytes()
    assert int.from_bytes(index[16:24], "little") == 100_000_000
    header = json.loads((tmp_path / "s/sequence.json").read_text(encoding="utf-8"))
    assert (header["frame_stride_bytes"], header["time_origin_s"]) == (12288, 1000.0)


def test_checksum_names_the_content_not_the_source(tmp_path: Path) -> None:
    one, two = write_prepared(tmp_path / "a"), write_prepared(tmp_path / "b")
    assert one.checksum == two.checksum
    assert write_prepared(tmp_path / "c", frames=5).checksum != one.checksum


@pytest.mark.parametrize(
    ("file", "offset", "expected"),
    [
        ("frames.bin", 12288 + 5, "frame 1 does not fit its CRC"),
        ("index.bin", 24, "does not fit its checksum"),
        ("sequence.json", 30, "sequence.json"),
    ],
)
def test_a_flipped_bit_is_named(tmp_path: Path, file: str, offset: int, expected: str) -> None:
    write_prepared(tmp_path / "s")
    flip(tmp_path / "s" / file, offset)
    with pytest.raises(SlambedError) as error:
        PreparedSequence.open(tmp_path / "s").verify(full=True)
    assert expected in one_line(error)


def test_a_changed_camera_does_not_pass(tmp_path: Path) -> None:
    write_prepared(tmp_path / "s")
    file = tmp_path / "s/sequence.json"
    file.write_text(file.read_text(encoding="utf-8").replace("31.5", "32.5"), encoding="utf-8")
    with pytest.raises(SlambedError, match="checksum"):
        PreparedSequence.open(tmp_path / "s")


@pytest.mark.parametrize("file", ["frames.bin", "index.bin"])
def test_a_cut_file_is_named(tmp_path: Path, file: str) -> None:
    write_prepared(tmp_path / "s")
    path = tmp_path / "s" / file
    path.write_bytes(path.read_bytes()[:-16])
    with pytest.raises(SlambedError) as error:
        PreparedSequence.open(tmp_path / "s")
    assert file in one_line(error)


def test_not_a_sequence(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="not a prepared sequence"):
        PreparedSequence.open(tmp_path)


def writer(path: Path) -> PreparedWriter:
    return PreparedWriter(
        path,
        id="w",
        title="w",
        sensor="rgbd",
        width=WIDTH,
        height=HEIGHT,
        fps=10.0,
        camera=CAMERA,
        depth_unit_m=0.0002,
    )


def test_an_interrupt_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), writer(tmp_path / "s") as open_writer:
        open_writer.add(Frame(0, gray(0), depth(0)))
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (Frame(5, gray(1), depth(1)), "not later"),
        (Frame(9, gray(1, 32, 32), depth(1)), "32x32, not 64x48"),
    ],
)
def test_a_bad_frame_is_refused(tmp_path: Path, frame: Frame, expected: str) -> None:
    with pytest.raises(SlambedError) as error, writer(tmp_path / "s") as open_writer:
        open_writer.add(Frame(5, gray(0), depth(0)))
        open_writer.add(frame)
    assert expected in one_line(error)
    assert list(tmp_path.iterdir()) == []


def test_an_empty_sequence_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="no frames"), writer(tmp_path / "s"):
        pass


def test_a_new_version_replaces_the_old_one(tmp_path: Path) -> None:
    write_prepared(tmp_path / "s", frames=3)
    assert len(write_prepared(tmp_path / "s", frames=5)) == 5
    (tmp_path / "partial").mkdir()
    move_into_place(tmp_path / "partial", tmp_path / "s")
    assert list(tmp_path.iterdir()) == [tmp_path / "s"]


def test_trajectory_errors_name_the_line(tmp_path: Path) -> None:
    file = tmp_path / "t.txt"
    file.write_text("# comment\n1 0 0 0 0 0 0 1\n2 0 0 nan 0 0 0 1\n")
    with pytest.raises(SlambedError) as error:
        read_groundtruth(file)
    assert f"{file}:3" in one_line(error)


def test_matrices_become_quaternions() -> None:
    turn = np.array([[0.0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3]])  # 90 degrees about z
    row = Trajectory.of_matrices(np.array([7.0]), turn[None]).rows()[0]
    assert row == pytest.approx([7, 1, 2, 3, 0, 0, 0.5**0.5, 0.5**0.5])


def test_a_disk_that_is_full_at_the_end_leaves_nothing(tmp_path: Path) -> None:
    writer = PreparedWriter(
        tmp_path / "s",
        id="s",
        title="S",
        sensor="mono",
        width=WIDTH,
        height=HEIGHT,
        fps=10.0,
        camera=CAMERA,
    )
    with pytest.raises(OSError, match="No space left"), writer:
        writer.add(Frame(1, gray(0), None))
        full = Path("/dev/full").open("wb")  # noqa: SIM115
        full.write(b"x")
        writer._file = full
    assert not list(tmp_path.iterdir())
