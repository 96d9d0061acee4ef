# SPDX-License-Identifier: Apache-2.0
"""`slambed data export`: what is written is what the readers of the same format read."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import slambed
from data_samples import CAMERA, HEIGHT, WIDTH, grey, trajectory, write_prepared

from slambed.data.export import export, folder_times_ns
from slambed.data.model import Frame
from slambed.data.prepared import PreparedSequence, PreparedWriter
from slambed.data.readers import ReaderOptions, load_reader
from slambed.errors import SlambedError

TIMES_NS = [1_000_000_000_000 + i * 100_000_000 for i in range(4)]


def options(sensor: str, **changes: Any) -> ReaderOptions:
    values = {"sensor": sensor, "size": (WIDTH, HEIGHT), "camera": CAMERA, "depth_unit_m": 0.0002}
    return ReaderOptions(**(values | {"fps": 10.0, "groundtruth": ""} | changes))


def write_stereo(path: Path, sensor: str = "stereo") -> PreparedSequence:
    with PreparedWriter(
        path, id="two", title="Two", sensor=sensor, width=WIDTH, height=HEIGHT, fps=10.0,
        camera=CAMERA,
    ) as writer:  # fmt: skip
        for i, time_ns in enumerate(TIMES_NS):
            writer.add(Frame(time_ns, grey(i), grey(100 + i) if sensor == "stereo" else None))
        writer.set_groundtruth(trajectory([999.9, 1000.15, 1000.4]))
    return PreparedSequence.open(path)


def test_tum_comes_back_as_it_was(tmp_path: Path) -> None:
    sequence = write_prepared(tmp_path / "prepared")
    folder = export(sequence, "tum", tmp_path / "out")
    reader = load_reader("tum")(folder, options("rgbd", groundtruth="groundtruth.txt"))
    assert len(reader) == len(sequence)
    for mine, theirs in zip(sequence, reader, strict=True):
        assert mine.timestamp_ns == theirs.timestamp_ns
        assert np.array_equal(mine.grey, theirs.grey)
        assert np.array_equal(mine.second, theirs.second)
    assert np.allclose(reader.trajectory().rows(), sequence.groundtruth().rows(), atol=1e-6)


def test_kitti_comes_back_with_its_camera(tmp_path: Path) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    folder = export(sequence, "kitti", tmp_path / "out")
    reader = load_reader("kitti")(folder, options("stereo", groundtruth="poses.txt"))
    assert reader.camera() == CAMERA and len(reader) == 4
    for mine, theirs in zip(sequence, reader, strict=True):
        assert mine.timestamp_ns - TIMES_NS[0] == theirs.timestamp_ns
        assert np.array_equal(mine.grey, theirs.grey)
        assert np.array_equal(mine.second, theirs.second)
    found = reader.trajectory()
    assert found is not None
    # The walk goes 0.1 m a second along x; its poses lie between the measured ones.
    assert np.allclose(np.diff(found.positions_m[:, 0]), 0.01, atol=1e-6)


def test_euroc_keeps_times_poses_and_baseline(tmp_path: Path) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    folder = export(sequence, "euroc", tmp_path / "out")
    reader = load_reader("euroc")(folder, options("stereo"))
    assert [frame.timestamp_ns for frame in reader] == TIMES_NS
    assert reader.camera().bf == pytest.approx(CAMERA.bf)
    truth, found = sequence.groundtruth(), reader.trajectory()
    assert truth is not None and found is not None
    assert np.allclose(found.positions_m, truth.positions_m, atol=1e-6)
    # Rectified already: the reader's own rectification moves no pixel.
    assert np.array_equal(reader[2].grey[2:-2, 2:-2], sequence.grey(2)[2:-2, 2:-2])


def test_a_layout_that_cannot_hold_the_sequence_is_refused(tmp_path: Path) -> None:
    mono = write_stereo(tmp_path / "mono", "mono")
    with pytest.raises(SlambedError, match="is mono, which tum does not hold; take kitti"):
        export(mono, "tum", tmp_path / "out")
    with pytest.raises(SlambedError, match="unknown format 'ros'"):
        export(mono, "ros", tmp_path / "out")
    export(mono, "kitti", tmp_path / "out")
    with pytest.raises(SlambedError, match="is there already"):
        export(mono, "kitti", tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mono", "out"]


def test_the_command_writes_a_folder(tmp_path: Path) -> None:
    write_prepared(tmp_path / "prepared")
    output = tmp_path / "mine"
    code, out, err = slambed(
        "data", "export", str(tmp_path / "prepared"), "--format", "tum", "--output", str(output)
    )
    assert code == 0, err
    assert out.startswith(f"{output}: 4 frames") and (output / "rgb.txt").is_file()


@pytest.mark.parametrize("layout", ["kitti", "euroc"])
def test_a_part_has_its_frames_its_rate_and_no_truth(tmp_path: Path, layout: str) -> None:
    sequence = write_stereo(tmp_path / "prepared")
    folder = export(sequence, layout, tmp_path / "out", indices=np.array([1, 3]), with_truth=False)
    reader = load_reader(layout)(folder, options("stereo"))
    assert [frame.timestamp_ns for frame in reader] == [
        int(folder_times_ns(sequence, layout)[i]) for i in (1, 3)
    ]
    assert np.array_equal(reader[1].grey[2:-2, 2:-2], sequence.grey(3)[2:-2, 2:-2])
    names = {path.name for path in folder.rglob("*")}
    assert not names & {"poses.txt", "groundtruth.txt", "state_groundtruth_estimate0"}
    if layout == "euroc":
        assert "rate_hz: 5\n" in (folder / "mav0" / "cam0" / "sensor.yaml").read_text()
