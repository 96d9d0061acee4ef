# SPDX-License-Identifier: Apache-2.0
"""The example ORB-SLAM3: its vocabulary and final poses. test_check_system.py plays frames to the
package."""

import importlib.util
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock, Mock

import numpy as np
import pytest

from slambed.errors import SlambedError
from slambed.native import find_program, repository_root

EXAMPLE = repository_root() / "examples" / "orb_slam3"
WORDS = repository_root() / "systems/core/features/data/orb_10k.slv"


def has_vocabulary_tool() -> bool:
    try:
        find_program("slambed-vocab")
    except SlambedError:
        return False
    return True


def converted(vocabulary: Path, text: Path) -> str:
    subprocess.run([sys.executable, EXAMPLE / "vocabulary.py", vocabulary, text], check=True)
    return text.read_text()


def test_our_vocabulary_is_written_as_dbow2_has_it(tmp_path: Path) -> None:
    lines = converted(WORDS, tmp_path / "orb.txt").split("\n")
    assert lines[0] == "10 4 0 0"
    # A line end after the last line would be one more node to ORB-SLAM.
    assert lines[-1] != ""
    leaves = 0
    for number, line in enumerate(lines[1:], start=1):
        parent, leaf, *rest = line.split()
        assert int(parent) < number and len(rest) == 33
        leaves += int(leaf)
    assert leaves == 10_000


@pytest.mark.programs
def test_a_damaged_vocabulary_is_one_line(tmp_path: Path) -> None:
    whole = WORDS.read_bytes()
    for damaged in (whole[:200_000], whole[:5000] + b"x" + whole[5001:], whole[:10]):
        (tmp_path / "bad.slv").write_bytes(damaged)
        done = subprocess.run(
            [sys.executable, EXAMPLE / "vocabulary.py", tmp_path / "bad.slv", tmp_path / "t.txt"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 1 and not (tmp_path / "t.txt").exists()
        assert done.stderr.startswith("error: the vocabulary is damaged")
        assert done.stderr.count("\n") == 1


@pytest.mark.skipif(not has_vocabulary_tool(), reason="needs slambed-vocab ('make build')")
def test_our_reader_of_that_format_gets_the_same_vocabulary(tmp_path: Path) -> None:
    converted(WORDS, tmp_path / "orb.txt")
    again = tmp_path / "again.slv"
    subprocess.run(
        [find_program("slambed-vocab"), "import", tmp_path / "orb.txt", "-o", again],
        check=True, capture_output=True,
    )  # fmt: skip
    assert again.read_bytes() == WORDS.read_bytes()


@pytest.fixture
def adapter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """run.py without the package, which only a run installs."""
    monkeypatch.setenv("SLAMBED_OUTPUT", str(tmp_path))
    monkeypatch.syspath_prepend(EXAMPLE)
    for name in ("pyorbslam3", "slambed_client"):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    spec = importlib.util.spec_from_file_location("orb_slam3_run", EXAMPLE / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_crash_while_the_path_is_saved_costs_only_the_corrections(
    adapter: ModuleType, capfd: pytest.CaptureFixture[str]
) -> None:
    slam, client = Mock(), Mock(sensor="rgbd")
    for crash in (lambda _: os.kill(os.getpid(), signal.SIGKILL), lambda _: 1 / 0, lambda _: None):
        slam.save_trajectory_tum = crash
        adapter.final_poses(slam, client, {0.1: 4}, tracked={4})
        assert not client.final.called
        assert capfd.readouterr().out.count("no corrected poses") == 1


def test_one_camera_gets_the_corrections_of_the_largest_map(adapter: ModuleType) -> None:
    """The package refuses one camera in TUM's format; EuRoC's has nanoseconds."""
    slam, client = Mock(), Mock(sensor="mono")
    slam.save_trajectory_tum = lambda _: None
    slam.save_trajectory_euroc = lambda path: Path(path).write_text(
        "100000000.000000 1 0 0 0 0 0 1\n299999990.000000 3 0 0 0 0 0 1\n"
    )
    adapter.final_poses(slam, client, {0.1: 4, 0.2: 5, 0.3: 7}, tracked={4, 5, 7})
    sent = [(call.args[0], call.args[1][0, 3]) for call in client.final.call_args_list]
    assert sent == [(4, 1.0), (7, 3.0)]


def settings_for(adapter: ModuleType, sensor: str) -> dict[str, str]:
    client = Mock(
        sensor=sensor, fx=500.0, fy=510.0, cx=320.0, cy=240.0, bf=40.0, width=640, height=480,
        fps=30.0, distortion=np.array([0.1, -0.2, 0.0, 0.0, 0.0]), depth_unit_m=0.001,
        params={"n_orb": 1000, "th_depth": 40.0},
    )  # fmt: skip
    text = adapter.settings_of(client)
    assert text.startswith("%YAML:1.0\n")
    return dict(re.findall(r"^([\w.]+): (.*(?:\n   .*)*)", text, re.MULTILINE))


def test_two_cameras_are_both_named(adapter: ModuleType) -> None:
    """The package ends with a segmentation fault on a pair that is called rectified."""
    found = settings_for(adapter, "stereo")
    assert found["Camera.type"] == '"PinHole"' and "Stereo.b" not in found
    for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"):
        assert found[f"Camera1.{name}"] == found[f"Camera2.{name}"]
    assert found["Camera2.fx"] == "500.0" and found["Camera2.k1"] == "0.0"
    numbers = re.findall(r"data: \[(.*)\]", found["Stereo.T_c1_c2"])[0].split(", ")
    expected = np.eye(4)
    expected[0, 3] = 0.08  # the right camera is on the right
    assert np.allclose(np.array(numbers, dtype=float).reshape(4, 4), expected)


def test_depth_and_one_camera_have_their_settings(adapter: ModuleType) -> None:
    depth, mono = settings_for(adapter, "rgbd"), settings_for(adapter, "mono")
    assert depth["Stereo.b"] == "0.08" and depth["RGBD.DepthMapFactor"] == "1000.0"
    assert mono["Camera1.k1"] == "0.1" and "Camera1.k3" not in mono
    for found in (depth, mono):
        assert not any(name.startswith("Camera2.") for name in found)
    assert not any(name.startswith(("Stereo.", "RGBD.")) for name in mono)


def test_a_frame_that_was_not_tracked_gets_no_final_pose(adapter: ModuleType) -> None:
    """ORB-SLAM3 writes a pose also where it was about to lose track; slambed refuses that one."""
    slam, client = Mock(), Mock(sensor="rgbd")
    slam.save_trajectory_tum = lambda path: Path(path).write_text(
        "".join(f"{t} {x} 0 0 0 0 0 1\n" for t, x in ((0.1, 1), (0.2, 2), (0.3, 3)))
    )
    adapter.final_poses(slam, client, {0.1: 4, 0.2: 5, 0.3: 7}, tracked={4, 7})
    sent = [(call.args[0], call.args[1][0, 3]) for call in client.final.call_args_list]
    assert sent == [(4, 1.0), (7, 3.0)]
