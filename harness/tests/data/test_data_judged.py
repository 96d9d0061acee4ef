# SPDX-License-Identifier: Apache-2.0
"""Checks when a recording is prepared: times, ground truth, numbers of images, units."""

from __future__ import annotations

import codecs
from pathlib import Path

import cv2
import numpy as np
import pytest
from data_samples import depth, gray, one_line, tum_recipe, write_tum

from slambed.data.catalog import Catalog
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError

EPOCH_S = 1305031102


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A TUM folder, played by the dataset file next to it."""
    tum_recipe(tmp_path / "datasets")
    return write_tum(tmp_path / "data/tiny_tum")


def prepare(home: Path, name: str = "tiny_tum") -> tuple[PreparedSequence, str]:
    """Returns the sequence and the remarks."""
    reported: list[str] = []
    catalog = Catalog.load(home / "datasets", [home / "data"])
    return catalog.prepare(name, home / "cache", notify=reported.append), "\n".join(reported)


def refused(home: Path) -> str:
    with pytest.raises(SlambedError) as error:
        prepare(home)
    return one_line(error)


def retime(walk: Path, times: list[str], poses: list[str] | None = None) -> None:
    """Changes the times of the first color and depth frames, and of poses."""
    names = sorted(file.name for file in (walk / "rgb").iterdir())
    for kind in ("rgb", "depth"):
        (walk / kind).rename(walk / f"{kind}.old")
        (walk / kind).mkdir()
        for i in range(len(times)):
            picture = gray(i) if kind == "rgb" else depth(i)
            cv2.imwrite(str(walk / kind / names[i]), picture)
        rows = [f"{time} {kind}/{name}" for time, name in zip(times, names, strict=False)]
        (walk / f"{kind}.txt").write_text("\n".join(rows) + "\n")
    rows = [f"{time} {i} 0 0 0 0 0 1" for i, time in enumerate(times if poses is None else poses)]
    (walk / "groundtruth.txt").write_text("\n".join(rows) + "\n")


@pytest.mark.parametrize(
    ("factor", "name"), [(10**3, "milliseconds"), (10**6, "microseconds"), (10**9, "nanoseconds")]
)
def test_units_of_time_are_recognized_and_reported(
    walk: Path, tmp_path: Path, factor: int, name: str
) -> None:
    retime(walk, [str((EPOCH_S * 10 + i) * factor // 10) for i in range(4)])
    sequence, reported = prepare(tmp_path)
    assert sequence.duration_s == pytest.approx(0.3) and sequence.groundtruth() is not None
    assert f"rgb.txt: times are read as {name}" in reported
    assert f"times of the ground truth are read as {name}" in reported


def test_a_unit_that_is_not_certain_is_asked_for(walk: Path, tmp_path: Path) -> None:
    retime(walk, ["0", "100", "200", "300"])
    assert "100 apart, which in seconds does not go with fps 10; say" in refused(tmp_path)
    tum_recipe(tmp_path / "datasets", reader_options="{time_unit: ms}")
    sequence, reported = prepare(tmp_path)
    assert sequence.duration_s == pytest.approx(0.3) and "rgb.txt" not in reported
    tum_recipe(tmp_path / "datasets", reader_options="{time_unit: min}")
    assert "time_unit must be s, ms, us or ns, not 'min'" in refused(tmp_path)


def test_a_clock_that_jumps_is_reported_with_line_and_frame(walk: Path, tmp_path: Path) -> None:
    retime(walk, ["12.0", "12.1", f"{EPOCH_S}.2", f"{EPOCH_S}.3"])
    line = refused(tmp_path)
    assert "rgb.txt:3: times jump by 41.4 years from frame 1 (12.100000 s) to frame 2" in line
    retime_pause = ["12.0", "12.1", "112.2", "112.3"]
    (walk / "rgb.old").rename(tmp_path / "rgb.old")
    (walk / "depth.old").rename(tmp_path / "depth.old")
    retime(walk, retime_pause)
    assert "max_gap_s" in refused(tmp_path)
    tum_recipe(tmp_path / "datasets", reader_options="{max_gap_s: 200}")
    assert prepare(tmp_path)[0].duration_s == pytest.approx(100.3)


def test_zeros_and_single_frames_are_refused(walk: Path, tmp_path: Path) -> None:
    retime(walk, ["0", "0", "0"])
    assert "rgb.txt: all 3 lines have the time 0; record time stamps" in refused(tmp_path)
    for kind in ("rgb", "depth"):
        (walk / f"{kind}.txt").write_text((walk / f"{kind}.txt").read_text().splitlines()[0])
    assert "rgb.txt:1: the dataset has one frame" in refused(tmp_path)


def test_lines_out_of_order_are_played_in_order_and_reported(walk: Path, tmp_path: Path) -> None:
    before = prepare(tmp_path)[0].checksum
    lines = (walk / "rgb.txt").read_text().splitlines()
    (walk / "rgb.txt").write_text("\n".join([lines[0], lines[2], lines[1], *lines[3:]]) + "\n")
    sequence, reported = prepare(tmp_path)
    assert sequence.checksum == before
    assert "rgb.txt:3: time goes back by 0.1" in reported


def test_times_before_zero_are_moved_and_reported(walk: Path, tmp_path: Path) -> None:
    retime(walk, ["-0.25", "-0.15", "-0.05", "0.05"])
    sequence, reported = prepare(tmp_path)
    truth = sequence.groundtruth()
    assert sequence.info.time_origin_s == 0.75 and truth is not None
    assert truth.stamps_s.tolist() == pytest.approx([0.75, 0.85, 0.95, 1.05])
    assert "rgb.txt:1: times begin at -0.250000 s; 1 s are added" in reported


def test_ground_truth_of_another_clock_is_reported_with_both_ranges(
    walk: Path, tmp_path: Path
) -> None:
    retime(walk, ["10.0", "10.1", "10.2"], ["500.0", "500.1", "500.2"])
    line = refused(tmp_path)
    assert "does not overlap" in line
    assert "frames from 10.000 to 10.200 s, 3 poses from 500.000 to 500.200 s" in line


def test_sparse_ground_truth_names_the_nearest_pose(walk: Path, tmp_path: Path) -> None:
    retime(walk, ["10.0", "10.1", "10.2", "10.3"], ["10.025", "10.225"])
    assert "no frame has a pose within 20 ms, the nearest is 25 ms away" in refused(tmp_path)
    (walk / "groundtruth.txt").write_text("10.0 0 0 0 0 0 0 1\n")
    assert "1 of 4 frames have a pose" in prepare(tmp_path)[1]


def test_ground_truth_that_is_asked_for_is_not_left_out(walk: Path, tmp_path: Path) -> None:
    (walk / "groundtruth.txt").unlink()
    assert "groundtruth.txt is missing (ground truth)" in refused(tmp_path)


MARKS = {"utf-8": b"", "utf-8-sig": b"", "utf-16": b"", "utf-16-le": codecs.BOM_UTF16_LE}


@pytest.mark.parametrize("encoding", [*MARKS, "latin-1"])
def test_lists_in_any_encoding_with_headers_and_commas(
    walk: Path, tmp_path: Path, encoding: str
) -> None:
    before = prepare(tmp_path)[0]
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt"):
        rows = (walk / name).read_text().splitlines()[1:]
        rows = [row.replace(" ", ", ") + "," for row in rows]
        text = "\r\n".join(["timestamp, what", *rows, "# größer"]) + "\r\n"
        (walk / name).write_bytes(MARKS.get(encoding, b"") + text.encode(encoding))
    sequence, reported = prepare(tmp_path)
    assert sequence.checksum == before.checksum
    assert reported.endswith(
        "1 of 6 pictures have none of the second sensor near them and are left out"
    )
    assert (sequence.path / "groundtruth.txt").read_text() == (
        before.path / "groundtruth.txt"
    ).read_text()


def test_a_zero_byte_is_no_text(walk: Path, tmp_path: Path) -> None:
    (walk / "rgb.txt").write_text("# color\n12.0 rgb/\0.png\n")
    assert "rgb.txt:2: a zero byte, which no text has" in refused(tmp_path)


def test_names_with_blanks(walk: Path, tmp_path: Path) -> None:
    before = prepare(tmp_path)[0].checksum
    lines = (walk / "rgb.txt").read_text().splitlines()
    old = walk / lines[1].split()[1]
    old.rename(walk / "rgb/a walk.png")
    lines[1] = f"{lines[1].split()[0]} rgb/a walk.png"
    (walk / "rgb.txt").write_text("\n".join(lines))
    assert prepare(tmp_path)[0].checksum == before
    (walk / "rgb/a walk.png").unlink()
    assert "rgb.txt:2: there is neither 'rgb/a walk.png' nor 'rgb/a'" in refused(tmp_path)


def test_bytes_behind_the_end_of_a_picture(walk: Path, tmp_path: Path) -> None:
    """Cameras pad their JPEGs, and text mode changes the end of a PNG; a thumbnail has its own
    end marker."""
    png = sorted((walk / "rgb").iterdir())[0]
    png.write_bytes(png.read_bytes() + b"\r\n" + bytes(100))
    before = prepare(tmp_path)[0].checksum
    jpeg = sorted((walk / "rgb").iterdir())[1]
    good = cv2.imencode(".jpg", gray(1))[1].tobytes()
    small = cv2.imencode(".jpg", gray(1)[:16, :16])[1].tobytes()
    exif = b"\xff\xe1" + (len(small) + 2).to_bytes(2, "big") + small
    jpeg.write_bytes(good[:2] + exif + good[2:])
    whole = prepare(tmp_path)[0].checksum
    jpeg.write_bytes(good[:2] + exif + good[2:] + bytes(1000))
    assert prepare(tmp_path)[0].checksum == whole != before
    jpeg.write_bytes(good[:2] + exif + good[2:-200])
    assert "JPEG is truncated" in refused(tmp_path)


def test_pictures_of_sixteen_bits_need_a_range(walk: Path, tmp_path: Path) -> None:
    for i, file in enumerate(sorted((walk / "rgb").iterdir())):
        cv2.imwrite(str(file), 500 + 10 * gray(i).astype(np.uint16))
    assert "a picture of 16 bits with values 500 to 3050" in refused(tmp_path)
    tum_recipe(tmp_path / "datasets", reader_options="{gray_range: [500, 3050]}")
    assert np.array_equal(prepare(tmp_path)[0].gray(1), gray(1))
    tum_recipe(tmp_path / "datasets", reader_options="{gray_range: [3050, 500]}")
    assert "gray_range must be two numbers, the lower one first" in refused(tmp_path)


def test_pixels_are_those_of_the_sensor_whatever_exif_says(walk: Path, tmp_path: Path) -> None:
    file = sorted((walk / "rgb").iterdir())[0]
    plain = cv2.imencode(".jpg", gray(0))[1].tobytes()
    turned = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    file.write_bytes(plain)
    before = prepare(tmp_path)[0].checksum
    file.write_bytes(
        plain[:2] + b"\xff\xe1" + (len(turned) + 2).to_bytes(2, "big") + turned + plain[2:]
    )
    assert prepare(tmp_path)[0].checksum == before


def test_depth_of_another_size_is_to_be_aligned(walk: Path, tmp_path: Path) -> None:
    for file in (walk / "depth").iterdir():
        cv2.imwrite(str(file), np.full((40, 80), 1000, np.uint16))
    line = refused(tmp_path)
    assert "depth of 80x40 pixels, the first camera has 64x48; align depth to color" in line


def test_a_wrong_unit_of_depth_names_the_largest_value(walk: Path, tmp_path: Path) -> None:
    tum_recipe(tmp_path / "datasets", depth_unit_m="0.1")
    assert "the largest value is 10000" in refused(tmp_path)


CAMERA = "{{ width: 64, height: 48, fx: 50, fy: 50, cx: 31.5, cy: 23.5, bf: 4, {more} }}"


def test_distortion_of_four_five_and_eight_numbers(walk: Path, tmp_path: Path) -> None:
    def with_camera(more: str) -> PreparedSequence:
        tum_recipe(tmp_path / "datasets", camera=CAMERA.format(more=more))
        return prepare(tmp_path)[0]

    four = with_camera("distortion: [0.1, 0.2, 0.001, 0.002]")
    five = with_camera("distortion: [0.1, 0.2, 0.001, 0.002, 0]")
    assert four.info.camera.distortion == (0.1, 0.2, 0.001, 0.002, 0)
    assert four.checksum == five.checksum and np.array_equal(four.gray(1), gray(1))
    eight = with_camera("distortion: [0.1, 0.2, 0.001, 0.002, 0, 0.3, 0, 0]")
    assert eight.info.camera.distortion == (0, 0, 0, 0, 0)
    assert not np.array_equal(eight.gray(1), gray(1))
    tum_recipe(tmp_path / "datasets", camera=CAMERA.format(more="distortion: [1, 2, 3]"))
    with pytest.raises(SlambedError, match="3 numbers of radial-tangential distortion; expected"):
        Catalog.load(tmp_path / "datasets", [tmp_path / "data"]).get("tiny_tum")


def test_a_fisheye_lens_is_taken_out_and_others_are_refused_by_name(
    walk: Path, tmp_path: Path
) -> None:
    fisheye = "distortion: [0.1, 0.01, 0, 0], distortion_model: {model}"
    tum_recipe(
        tmp_path / "datasets", camera=CAMERA.format(more=fisheye.format(model="equidistant"))
    )
    sequence = prepare(tmp_path)[0]
    # A scene point in the distorted image and in the undistorted one.
    matrix = np.array([[50, 0, 31.5], [0, 50, 23.5], [0, 0, 1.0]])
    pixel = np.array([[[41.0, 30.0]]])
    coefficients = np.array([0.1, 0.01, 0, 0])
    x, y = cv2.fisheye.distortPoints((pixel - [31.5, 23.5]) / 50, matrix, coefficients)[0, 0]
    column, row = int(x), int(y)
    found = float(sequence.gray(1)[30, 41])
    around = gray(1)[row : row + 2, column : column + 2]
    assert around.min() - 1 <= found <= around.max() + 1
    assert set(np.unique(sequence.second(1))) <= {0, *np.unique(depth(1))}
    tum_recipe(tmp_path / "datasets", camera=CAMERA.format(more=fisheye.format(model="fov")))
    with pytest.raises(SlambedError, match="distortion model 'fov' is not supported"):
        Catalog.load(tmp_path / "datasets", [tmp_path / "data"]).get("tiny_tum")


def test_a_pattern_with_several_hits_is_reported(walk: Path, tmp_path: Path) -> None:
    write_tum(tmp_path / "data/tiny_tum_2")
    tum_recipe(tmp_path / "datasets", paths="['tiny_tum*']")
    assert "'paths' matches 1 more" in prepare(tmp_path)[1]


def test_stereo_is_not_straightened_by_one_lens(tmp_path: Path) -> None:
    lens = "distortion: [0.1, 0, 0, 0], distortion_model: equidistant"
    tum_recipe(
        tmp_path / "datasets", sensor="stereo", reader="bag", camera=CAMERA.format(more=lens)
    )
    with pytest.raises(SlambedError, match="stereo pictures must be rectified"):
        Catalog.load(tmp_path / "datasets", [tmp_path / "data"]).get("tiny_tum")


def test_a_camera_without_baseline(walk: Path, tmp_path: Path) -> None:
    camera = CAMERA.format(more="distortion: [0, 0, 0, 0]").replace("bf: 4", "bf: 0")
    tum_recipe(tmp_path / "datasets", camera=camera)
    assert "bf of the dataset's camera is 0" in refused(tmp_path)
    tum_recipe(tmp_path / "datasets", camera=camera, sensor="mono")
    assert prepare(tmp_path)[0].info.camera.bf == 0
