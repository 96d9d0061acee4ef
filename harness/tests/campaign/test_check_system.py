# SPDX-License-Identifier: Apache-2.0
"""`slambed check-system`: passes for the examples and the skeleton, fails for planted defects."""

import re
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from command_line import slambed
from waiting import until

from slambed.campaign.campaign_state import is_alive
from slambed.campaign.check_system import Checked, _plays, _stops
from slambed.errors import SlambedError
from slambed.native import find_program, repository_root

EXAMPLES = repository_root() / "examples" / "visual_odometry"
MOST_DRIFT_CM = 4.5
"""Of OpenCV's odometry: it drifts 3.6 cm, with inverted steps 5.2 cm."""
RIGHT_WAY = "pose @ np.linalg.inv(step)"


def programs_are_built() -> bool:
    try:
        return all(map(find_program, ("slambed-play", "slambed-synth")))
    except SlambedError:
        return False


pytestmark = pytest.mark.skipif(
    not programs_are_built(), reason="needs the programs ('make build')"
)


@pytest.fixture
def system(tmp_path: Path) -> Path:
    """A new skeleton, which passes."""
    assert slambed("new", "system", "fresh", "--folder", str(tmp_path))[0] == 0
    return tmp_path / "fresh" / "system.yaml"


def red_lines(system: Path) -> list[str]:
    code, out, err = slambed("check-system", str(system))
    assert err == "" and code in (0, 1)
    red = [line for line in out.splitlines() if line.startswith("no ")]
    assert bool(red) == bool(code), out
    return red


def opencv_odometry(tmp_path: Path) -> Path:
    """A copy of the example without its section python, so that nothing is downloaded."""
    folder = copied_example("opencv_odometry", tmp_path)
    content = yaml.safe_load((folder / "system.yaml").read_text())
    del content["runtime"]["python"]
    (folder / "system.yaml").write_text(yaml.safe_dump(content))
    return folder / "system.yaml"


@pytest.mark.parametrize("name", ["remote_odometry.yaml", "folder_odometry.yaml"])
def test_the_examples_keep_the_contract(name: str) -> None:
    assert red_lines(EXAMPLES / name) == []


def test_opencvs_odometry_keeps_the_contract_with_the_opencv_of_slambed(tmp_path: Path) -> None:
    code, out, _ = slambed("check-system", str(opencv_odometry(tmp_path)))
    assert code == 0, out
    found = re.search(r"ATE over these frames ([\d.]+) cm", out)
    assert found is not None and float(found[1]) < MOST_DRIFT_CM, out


def test_an_odometry_that_chains_inverted_motions_is_red(tmp_path: Path) -> None:
    file = opencv_odometry(tmp_path)
    program = file.with_name("run.py")
    assert RIGHT_WAY in program.read_text()
    program.write_text(program.read_text().replace(RIGHT_WAY, "pose @ step"))
    (line,) = red_lines(file)
    assert line.startswith("no  motions from frame to frame are chained as T_wc[k] = T_wc[k-1]")


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["opencv_odometry", "orb_slam3"])
def test_examples_of_pypi_keep_the_contract(name: str) -> None:
    code, out, _ = slambed("check-system", str(EXAMPLES.parent / name / "system.yaml"))
    assert code == 0, out


def test_the_skeleton_keeps_the_contract(system: Path) -> None:
    assert red_lines(system) == []


def test_every_sensor_is_played(system: Path) -> None:
    """A package may end at the settings of two cameras and play depth well."""
    text = system.read_text()
    assert "sensors: [rgbd]" in text
    system.write_text(text.replace("sensors: [rgbd]", "sensors: [rgbd, mono, stereo]"))
    assert red_lines(system) == []
    program = system.with_name("run.py")
    breaks = '    if client.sensor == "stereo":\n        raise ValueError("no second camera")\n'
    program.write_text(
        program.read_text().replace("    client.ready()\n", breaks + "    client.ready()\n")
    )
    code, out, _ = slambed("check-system", str(system))
    assert code == 1
    plays = "plays to the end, and answers every frame"
    assert f"ok  sensor mono: {plays}\n" in out
    assert f"no  sensor stereo: {plays}: not ready, ValueError: no second camera\n" in out
    assert "last lines that the mobile program printed" in out and "Traceback" in out


def test_the_skeleton_of_a_program_that_reads_a_folder_keeps_the_contract(tmp_path: Path) -> None:
    new = ("new", "system", "fresh", "--reads-folder", "--folder", str(tmp_path))
    code, out, _ = slambed(*new)
    assert code == 0 and f"next: slambed check-system {tmp_path}/fresh/system.yaml" in out
    assert "slambed" not in (tmp_path / "fresh" / "run.py").read_text().partition('"""\n')[2]
    assert red_lines(tmp_path / "fresh" / "system.yaml") == []
    beside = str(tmp_path / "fresh" / "fresh_beside_ours.yaml")
    assert slambed("run", beside, "--engine", "local", "--check")[0] == 0


def test_a_metric_is_optional_and_the_line_says_what_it_means(system: Path) -> None:
    content = yaml.safe_load(system.read_text())
    content["metrics"] |= {
        "found": {"doc": "places found again", "event": "found", "take": "count"},
        "mapped": {"doc": "keyframes left", "event": "map_made", "take": "last", "field": "n"},
        "wrong": {"doc": "a field of no event", "event": "seen", "take": "mean", "field": "hue"},
    }
    system.write_text(yaml.safe_dump(content))
    code, out, _ = slambed("check-system", str(system), COLUMNS="400")
    assert code == 0, out
    reported = {
        line.split()[2]: line for line in out.splitlines() if line.startswith("ok  metric ")
    }
    assert "(mean gray value of a frame): event 'seen' comes, 20 times" in reported["mean_gray"]
    for name, event, none in (("found", "found", "0"), ("mapped", "map_made", "empty")):
        assert f"an event '{event}' did not come in these 20 frames" in reported[name]
        assert ": optional, and there is none here" in reported[name]
        assert reported[name].endswith(f"in a run without one the metric is {none}")
    assert "event 'seen' comes, but none has a number 'hue'" in reported["wrong"]


DEFECTS = {
    "never ready": ("    client.ready()\n", "    import time; time.sleep(600)\n", "ready"),
    "gives up": ("        pose = where", "        if frame.index == 4:\n            break\n"
                 "        pose = where", "plays to the end"),
    "says nothing": ("client.pose(frame, pose)", "pass", "answers every frame"),
    "fails": ("        pose = where", "        1 / (10 - frame.index)\n        pose = where",
              "ZeroDivisionError"),
    "is no pose": ("return np.eye(4)", "return np.full((4, 4), np.nan)", "plays to the end"),
    "never ends": ("    client.close()\n", "    client.close()\n    import time; time.sleep(600)\n",
                   "ends by itself"),
    "is scaled": ("return np.eye(4)", "return np.diag([2, 2, 2, 1.0])", "has no rotation in"),
    "is transposed": ("return np.eye(4)", "T = np.eye(4); T[3, 0] = 1; return T",
                      "the last row of the pose of frame 0"),
    "takes a name": ("client.pose(frame, pose)",
                     "client.pose(frame, pose); client.event('frame_tracked')",
                     "is called frame_tracked, which the player writes"),
    "is no client": ("    client.ready()\n", "    raise SystemExit(0)\n", "say that it is ready"),
    "prints much": ("    client.ready()\n",
                    "    print('e' * 100_000); raise SystemExit(3)\n", "eee"),
}  # fmt: skip


@pytest.mark.parametrize("defect", DEFECTS)
def test_a_planted_defect_is_red(system: Path, defect: str) -> None:
    good, bad, expected = DEFECTS[defect]
    program = system.parent / "run.py"
    assert good in program.read_text()
    program.write_text(program.read_text().replace(good, bad))
    system.write_text(system.read_text() + "  ready_s: 8\n")
    red = red_lines(system)
    assert red and expected in red[0]


def test_what_a_hanging_program_started_is_ended_with_it(system: Path) -> None:
    program, noted = system.parent / "run.py", system.parent / "started"
    hangs = f"""    import subprocess, time
    child = subprocess.Popen(["sleep", "600"])
    open({str(noted)!r}, "w").write(str(child.pid))
    time.sleep(600)
"""
    program.write_text(program.read_text().replace("    client.ready()\n", hangs))
    system.write_text(system.read_text() + "  ready_s: 8\n")
    assert red_lines(system)
    until(lambda: not is_alive(int(noted.read_text()), time.time()), "the end of its child")


@pytest.mark.parametrize(
    ("head", "complaint"),
    [
        ("#!/usr/bin/nope\n", "its first line asks for '/usr/bin/nope')"),
        ("#!/bin/sh\r\n", "asks for '/bin/sh', and its lines end as on Windows"),
    ],
)
def test_a_script_whose_interpreter_is_not_there_is_named(
    system: Path, head: str, complaint: str
) -> None:
    script = system.parent / "go.sh"
    script.write_text(head, newline="")
    script.chmod(0o755)
    content = yaml.safe_load(system.read_text())
    content["runtime"]["mobile"]["command"] = ["./go.sh"]
    system.write_text(yaml.safe_dump(content))
    assert complaint in red_lines(system)[0]


def test_a_metric_of_every_system_is_refused(system: Path) -> None:
    content = yaml.safe_load(system.read_text())
    content["metrics"] = {"coverage": {"doc": "d", "event": "e", "take": "count"}}
    system.write_text(yaml.safe_dump(content))
    code, _, err = slambed("check-system", str(system))
    assert code == 2 and f"'coverage' is a metric of every system, {system}, choose" in err


@pytest.mark.parametrize(
    ("kind", "name"),
    [("system", "edgeslam"), ("dataset", "synthetic_room"), ("experiment", "runs")],
)
def test_a_name_of_ours_is_refused_for_a_skeleton(tmp_path: Path, kind: str, name: str) -> None:
    code, _, err = slambed("new", kind, name, "--folder", str(tmp_path))
    assert code == 2 and "another name" in err and not list(tmp_path.iterdir())


def test_a_failing_program_shows_its_last_lines(system: Path) -> None:
    program = system.parent / "run.py"
    good, bad, _ = DEFECTS["fails"]
    program.write_text(program.read_text().replace(good, bad))
    code, out, _ = slambed("check-system", str(system))
    _, _, printed = out.partition("last lines that the mobile program printed:\n")
    assert code == 1 and "Traceback" in printed and "1 / (10 - frame.index)" in printed


def copied_example(name: str, tmp_path: Path) -> Path:
    folder = tmp_path / name
    folder.mkdir()
    for path in filter(Path.is_file, (EXAMPLES.parent / name).iterdir()):
        (folder / path.name).write_bytes(path.read_bytes())
    return folder


WRITES = "trajectory.write_text("
READERS_DEFECTS = {
    "no trajectory": (WRITES, "str(", "left no such trajectory"),
    "no poses": ('"\\n".join(lines)', '""', "no pose in it"),
    "frame numbers for times": ("join([stamp,", "join([str(len(lines)),", "time of no frame"),
    "nanoseconds": ("join([stamp,", "join([str(1e9 * float(stamp)),", "in seconds"),
    "no rotations": ("*quaternion(T_wc[:3, :3])]", "*(2 * quaternion(T_wc[:3, :3]))]",
                     "is no rotation"),
    "diverged": ("[*T_wc[:3, 3], ", "[1e300, 0, len(lines) ** 2, ",
                 "compared with the true one: a pose is 1e+300 m away"),
    "fails": ("    lines = []\n", "    lines = [1 / 0]\n", "ZeroDivisionError"),
    "never ends": (WRITES, "import time; time.sleep(600)\n    " + WRITES, "had to be killed"),
    "a folder": (WRITES, "trajectory.mkdir(); str(", "the system left a folder; write a file"),
    "is deaf": ("    lines = []\n", "    lines = []\n    import signal, time\n"
                "    signal.signal(15, signal.SIG_IGN)\n    time.sleep(3)\n", None),
}  # fmt: skip


@pytest.mark.parametrize("defect", READERS_DEFECTS)
def test_a_planted_defect_of_a_system_that_reads_a_folder_is_red(
    tmp_path: Path, defect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if defect == "never ends":
        monkeypatch.setattr("slambed.campaign.check_system.END_PATIENCE_S", 8.0)
    good, bad, expected = READERS_DEFECTS[defect]
    folder = copied_example("visual_odometry", tmp_path)
    program = folder / "read_folder.py"
    assert good in program.read_text()
    program.write_text(program.read_text().replace(good, bad))
    red = red_lines(folder / "folder_odometry.yaml")
    # A program that ignores SIGTERM is killed 2 s later, as the contract says.
    assert red == [] if expected is None else red and expected in red[0], red


ALONG_A_LINE = {
    "kitti": (
        "mono",
        "ls $SLAMBED_FRAMES/image_0 | awk '{print 1,0,0,NR/99, 0,1,0,0, 0,0,1,0}'",
    ),
    "euroc": (
        "stereo",
        "awk -F, '!/^#/ {printf \"%.9f %f 0 0 0 0 0 1\\n\", $1 / 1e9, NR / 99}' "
        "$SLAMBED_FRAMES/mav0/cam0/data.csv",
    ),
}


@pytest.mark.parametrize("layout", ALONG_A_LINE)
def test_programs_that_know_nothing_of_slambed_read_the_other_layouts(
    layout: str, tmp_path: Path
) -> None:
    """The program is a shell line that assumes constant velocity. KITTI's poses have no times,
    EuRoC's times are nanoseconds."""
    sensor, line = ALONG_A_LINE[layout]
    form = "kitti" if layout == "kitti" else "tum"
    description = {
        "name": "line", "title": "Straight on", "roles": ["mobile"], "sensors": [sensor],
        "runtime": {
            "reads": layout, "trajectory": "poses.txt", "trajectory_format": form,
            "mobile": {"command": ["sh", "-c", f"{line} >$SLAMBED_TRAJECTORY"]},
        },
    }  # fmt: skip
    (tmp_path / "line").mkdir()
    system = tmp_path / "line" / "system.yaml"
    system.write_text(yaml.safe_dump(description))
    assert red_lines(system) == []
    description["runtime"]["mobile"]["command"][2] = f"{line} | head -n 7 >$SLAMBED_TRAJECTORY"
    system.write_text(yaml.safe_dump(description))
    red = red_lines(system)
    # Seven poses of twenty frames: KITTI's lines do not identify their frames.
    assert [x for x in red if "7 x 12 numbers" in x] == red and bool(red) == (layout == "kitti")


def ended_with(folder: Path, mobile: int | None, edge: int | None) -> Any:
    """A trial of a program whose nodes ended with these codes; None: not in time."""
    codes = {"mobile": mobile, "edge": edge}
    runtime = SimpleNamespace(has_client=lambda role: False)
    return SimpleNamespace(
        system=SimpleNamespace(runtime=runtime, has_edge=True, metrics={}),
        run_dir=folder,
        recording=None,
        nodes={role: SimpleNamespace(send_signal=lambda number: None) for role in codes},
        ready=lambda: True,
        start_clock=lambda: None,
        wait=lambda over, patience_s: None,
        code=lambda role, patience_s: codes[role],
        last_words=lambda role: "stuck",
    )


@pytest.mark.parametrize(
    ("edge", "how"),
    [(None, "it had to be killed"), (3, "exit code 3"), (139, "exit code 139 (SIGSEGV)")],
)
def test_how_a_node_ended_is_said_in_words(tmp_path: Path, edge: int | None, how: str) -> None:
    found = Checked()
    _plays(ended_with(tmp_path, 1, edge), found)
    assert found.lines[1] == (False, f"edge: ends with the run: {how}")
    _stops(ended_with(tmp_path, 0, edge), found)
    assert found.lines[2] == (False, f"stops when asked: mobile: exit code 0, edge: {how}")


def test_inverted_poses_are_red(tmp_path: Path) -> None:
    """World to camera instead of camera to world, a common mistake."""
    folder = copied_example("visual_odometry", tmp_path)
    text = (folder / "remote_mobile.py").read_text()
    sent = 'np.array(answer["T_wc"])'
    assert sent in text
    (folder / "remote_mobile.py").write_text(text.replace(sent, f"np.linalg.inv({sent})"))
    assert [line.split(":")[0] for line in red_lines(folder / "remote_odometry.yaml")] == [
        "no  poses are camera to world"
    ]


def test_a_system_of_ours_is_not_checked() -> None:
    code, _, err = slambed("check-system", "edgeslam")
    assert code == 2 and "is built in" in err
