# SPDX-License-Identifier: Apache-2.0
"""`slambed check-system`: plays twenty generated frames to a system and reports which parts of
the contract hold. It needs no privileges: no namespaces, no limits, the edge on this host."""

import json
import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from slambed.campaign.foreign_trajectory import (
    check_rotations,
    frames_of,
    read_poses,
    record_poses,
)
from slambed.campaign.recordings import Recording
from slambed.data.prepared import PreparedSequence
from slambed.data.trajectory import Trajectory, read_tum
from slambed.engines.base import LONGEST_LINE, NodePlan, last_line
from slambed.engines.foreign import PLAYER, clients_folder, environment, host_path, player_arguments
from slambed.engines.python_packages import make_environment, must_have_debian_packages
from slambed.engines.result import RunResult
from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.files.json_file import object_or_empty
from slambed.metrics.accuracy import MINIMUM_PAIRS, absolute_error, relative_error
from slambed.metrics.catalog import metrics_of
from slambed.metrics.declared import fits
from slambed.metrics.events import Event, read_jsonl
from slambed.metrics.tracking import values_of
from slambed.native import find_program
from slambed.records.run_config import Network, RunConfig
from slambed.spec.device import Limits
from slambed.spec.experiment import Playback
from slambed.spec.inputs import FROM_DATASET, find_input
from slambed.spec.library import Library
from slambed.spec.system import OwnMetric, Role, Scalar, System

FRAMES, FPS = 20, 5.0
STOPPED_AFTER_S = 1.0
READER_STOPPED_AFTER_S = 0.1
"""Shorter, because a system that reads a folder may finish at any time."""
STOP_PATIENCE_S, END_PATIENCE_S = 15.0, 30.0
PRINTED_LINES = 20
INVERSE_IS_BETTER = 0.5
"""If inverted poses or steps have less than this share of the original error, they were sent so."""


@dataclass
class Checked:
    """The findings, line by line."""

    lines: list[tuple[bool, str]] = field(default_factory=list)
    printed: dict[Role, str] = field(default_factory=dict)
    """Role -> the last lines that a program printed which failed."""

    def report(self, good: bool, line: str) -> bool:
        """Adds a line; returns `good`."""
        self.lines.append((good, line))
        return good

    @property
    def good(self) -> bool:
        """True if the whole contract holds."""
        return all(good for good, _ in self.lines)


@dataclass
class Trial:
    """One start of a system on the generated frames."""

    system: System
    folder: Path
    """Folder of the system."""
    sequence: Path
    run_dir: Path
    recording: Recording | None = None
    """For a system that reads a folder."""
    nodes: dict[Role, subprocess.Popen[bytes]] = field(default_factory=dict)

    @contextmanager
    def started(self) -> Iterator[None]:
        """Starts all nodes, the edge first; ends all of them on exit."""
        self.run_dir.mkdir()
        (self.run_dir / "run.json").write_text(json.dumps(self._config().as_json()))
        with ExitStack() as cleanup:
            for role in sorted(self.system.roles):
                node = self._start(role)
                cleanup.callback(_end, node)
                self.nodes[role] = node
            yield

    def _config(self) -> RunConfig:
        variant = self.system.choose_variant(None)
        network = None
        if self.system.has_edge:
            ports = {name: _free_port() for name in self.system.channels}
            network = Network(edge_address="127.0.0.1", ports=ports)
        return RunConfig(
            format="slambed-run",
            version=1,
            run_key="check",
            seed=1,
            system=self.system.name,
            variant=variant,
            params=self._params(variant),
            sequence=str(self.sequence),
            playback=Playback(mode="every_frame"),
            network=network,
            output=str(self.run_dir),
            connect_timeout_s=20.0,
        )

    def _params(self, variant: str) -> dict[str, Scalar]:
        params = self.system.for_nodes(self.system.resolve(variant, {}))
        for name, value in params.items():
            # The generated frames have no prior map, and a program takes an empty path for none.
            if self.system.params[name].type == "path" and value:
                given = value != FROM_DATASET
                params[name] = str(find_input(str(value), self.folder)) if given else ""
        return params

    def _start(self, role: Role) -> subprocess.Popen[bytes]:
        plan = NodePlan(
            role,
            "check",
            self.run_dir,
            self.sequence,
            Limits(),
            [],
            False,
            self.system.runtime,
            self.folder,
        )
        (self.run_dir / role).mkdir()
        config = str(self.run_dir / "run.json")
        frames = "" if self.recording is None else str(self.recording.folder())
        arguments = player_arguments(plan, config, str(self.folder), frames)
        with self._log(role).open("wb") as log:
            return subprocess.Popen(
                [str(find_program(PLAYER)), *arguments],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=environment(plan, str(clients_folder()), host_path(), config, frames),
                start_new_session=True,
            )

    def _log(self, role: str) -> Path:
        return self.run_dir / role / "log.txt"

    def wait(self, over: Callable[[], bool], patience_s: float) -> bool:
        """Waits until `over` holds, a node has exited, or the timeout; returns whether `over`
        holds."""
        deadline = time.monotonic() + patience_s
        while not over():
            ended = any(node.poll() is not None for node in self.nodes.values())
            if ended or time.monotonic() > deadline:
                return over()
            time.sleep(0.02)
        return True

    def ready(self) -> bool:
        """Returns whether every node reported in time that it is ready."""
        assert self.system.runtime is not None
        files = [self.run_dir / role / "ready.json" for role in self.nodes]
        return self.wait(lambda: all(f.exists() for f in files), self.system.runtime.ready_s)

    def start_clock(self) -> None:
        """Starts the run clock (run time 0 in 100 ms)."""
        with replacing(self.run_dir / "start.json") as start:
            start.write_text(json.dumps({"t0_ns": time.monotonic_ns() + 100_000_000}))

    def code(self, role: Role, patience_s: float) -> int | None:
        """Returns the exit code; None after the timeout."""
        try:
            return self.nodes[role].wait(patience_s)
        except subprocess.TimeoutExpired:
            return None

    def last_words(self, role: Role) -> str:
        """Returns the last log line of a node."""
        return last_line(self._log(role)).removeprefix("error: ")

    def printed(self) -> dict[Role, str]:
        """Returns the last lines of the log of each node that printed something."""
        texts = {role: self._log(role).read_text(errors="replace").strip() for role in self.nodes}
        return {
            role: "\n".join(line[:LONGEST_LINE] for line in text.splitlines()[-PRINTED_LINES:])
            for role, text in texts.items()
            if text
        }

    def events(self, role: Role = "mobile") -> list[Event]:
        """Returns the recorded events of a node."""
        path = self.run_dir / role / "events.jsonl"
        return read_jsonl(path)[0] if path.exists() else []


def check_system(named: str, library: Library, notify: Callable[[str], None]) -> Checked:
    """Checks a system, and installs its Python packages if they are missing. Raises SlambedError
    for an unknown or built-in system, and for packages that cannot be had."""
    system = library.system(named)
    if system.runtime is None:
        raise SlambedError(f"system {system.name} is built in; only programs of others are checked")
    folder = library.system_file(named).parent
    metrics_of(library.system_file(named))  # raises for metrics that are not as they must be
    for name in system.runtime.files:
        if not (folder / name).exists():
            raise SlambedError(f"{folder / name}: no such file, which runtime.files names")
    found = Checked()
    found.report(True, f"system.yaml: {system.name}, {' and '.join(system.roles)}")
    if (python := system.runtime.python) is not None:
        must_have_debian_packages(python, folder)
        installed = make_environment(python, folder, notify)
        versions = ", ".join(f"{name} {v}" for name, v in installed.versions.items())
        found.report(True, f"its Python packages are installed: {versions}")
    with tempfile.TemporaryDirectory(prefix="slambed-check-") as place:
        first, *others = system.sensors
        trial = _trial(system, folder, first, Path(place))
        if trial.recording is not None:
            reads = system.runtime.reads
            found.report(True, f"is given {FRAMES} frames as a folder of layout {reads}")
        with trial.started():
            if _begins(trial, found):
                _plays(trial, found)
        if not found.good:
            found.printed = trial.printed()
        again = replace(trial, run_dir=Path(place) / "stopped", nodes={})
        if found.good:
            with again.started():
                _stops(again, found)
        for sensor in others:
            if found.good:
                _plays_another(_trial(system, folder, sensor, Path(place)), sensor, found)
    return found


def _trial(system: System, folder: Path, sensor: str, place: Path) -> Trial:
    """Generates frames of a sensor for one start of the system."""
    assert system.runtime is not None
    own = place / sensor
    own.mkdir()
    sequence = _generate(sensor, own / "sequence")
    recording = None
    if system.runtime.reads is not None:
        prepared = PreparedSequence.open(sequence)
        recording = Recording.of(prepared, Playback(), system.runtime.reads, own)
        recording.folder()
    return Trial(system, folder, sequence, own / "run", recording)


def _plays_another(trial: Trial, sensor: str, found: Checked) -> None:
    """Checks that a further sensor of the system is played to the end. How good its path is stays
    open: one camera may need more frames for its first map."""
    assert trial.system.runtime is not None
    line = f"sensor {sensor}: plays to the end, and answers every frame"
    with trial.started():
        if not trial.ready():
            found.report(False, f"{line}: not ready, {trial.last_words('mobile')}")
        else:
            bad = {role: code for role, code in _codes_at_the_end(trial).items() if code != 0}
            frames = [e for e in trial.events() if e["type"] == "frame_tracked"]
            answered = sum("track_ms" in e for e in frames)
            every = answered == FRAMES or not trial.system.runtime.has_client("mobile")
            why = "" if every else f": {answered} of {FRAMES} answered"
            for role, code in bad.items():
                why = f": {role}, {_how_it_ended(code)}, {trial.last_words(role)}"
            found.report(not bad and every, line + why)
    if not found.good:
        found.printed = trial.printed()


def _codes_at_the_end(trial: Trial) -> dict[Role, int | None]:
    """Starts the clock, and returns how each node ended: the edge first, the mobile node last."""
    trial.start_clock()
    mobile = trial.code("mobile", FRAMES / FPS + END_PATIENCE_S)
    codes: dict[Role, int | None] = {}
    if trial.system.has_edge:
        codes["edge"] = trial.code("edge", END_PATIENCE_S)
    return codes | {"mobile": mobile}


def _how_it_ended(code: int | None) -> str:
    """Returns a phrase for an exit code, with the name of the signal that it stands for; None: it
    did not end in time."""
    if code is None:
        return "it had to be killed"
    try:
        name = f" ({signal.Signals(code - 128).name})" if code > 128 else ""
    except ValueError:
        name = ""
    return f"exit code {code}{name}"


def _begins(trial: Trial, found: Checked) -> bool:
    assert trial.system.runtime is not None
    ready = trial.ready()
    for role in sorted(trial.nodes):
        if not trial.system.runtime.has_client(role):
            continue
        is_ready = (trial.run_dir / role / "ready.json").exists()
        why = (
            ""
            if is_ready
            else f" within {trial.system.runtime.ready_s:g} s: {trial.last_words(role)}"
        )
        found.report(is_ready, f"{role}: starts and says that it is ready{why}")
    return ready


def _plays(trial: Trial, found: Checked) -> None:
    codes = _codes_at_the_end(trial)
    code = codes["mobile"]
    does = "plays" if trial.recording is None else "reads the folder"
    ends = f"mobile: {does} to the end and then ends by itself, exit code 0"
    if code != 0:
        found.report(False, f"{ends}: {_how_it_ended(code)}, {trial.last_words('mobile')}")
    else:
        found.report(True, ends)
    if trial.system.has_edge:
        how = "" if codes["edge"] == 0 else f": {_how_it_ended(codes['edge'])}"
        found.report(codes["edge"] == 0, f"edge: ends with the run{how}")
    _answers(trial, found)
    if code == 0 and (trial.recording is None or _leaves(trial, found)):
        _path(trial, found)
    for key, item in trial.system.metrics.items():
        finding = _about_metric(item, trial.events(item.node or "mobile"), FRAMES)
        found.report(True, f"metric {key} ({item.doc}): {finding}")


def _about_metric(item: OwnMetric, recorded: Sequence[Event], frames: int) -> str:
    """Reports whether the events of a metric occur. They are optional: a loss or a loop closure
    may not happen in so few frames, nor in every run."""
    events = [event for event in recorded if event["type"] == item.event]
    chosen = [event for event in events if fits(item, event)]
    if item.field and chosen and not len(values_of(chosen, item.field)):
        return f"event '{item.event}' comes, but none has a number '{item.field}'"
    if chosen:
        return f"event '{item.event}' comes, {len(chosen)} times"
    none = "0" if item.take == "count" else "empty"
    which = f"an event '{item.event}'" + (" with what it asks for" if events else "")
    return (
        f"optional, and there is none here: {which} did not come in these {frames} frames; in a "
        f"run without one the metric is {none}"
    )


def _answers(trial: Trial, found: Checked) -> None:
    assert trial.system.runtime is not None
    if not trial.system.runtime.has_client("mobile"):
        return
    frames = [e for e in trial.events() if e["type"] == "frame_tracked"]
    found.report(len(frames) == FRAMES, f"takes every frame: {len(frames)} of {FRAMES}")
    answered = [e for e in frames if "track_ms" in e]
    line = f"answers every frame with a pose or a state: {len(answered)} of {len(frames)}"
    if found.report(bool(answered) and len(answered) == len(frames), line):
        median = float(np.median([e["track_ms"] for e in answered]))
        found.report(True, f"a frame takes {median:.1f} ms (median, without limits)")


def _leaves(trial: Trial, found: Checked) -> bool:
    """Checks the trajectory file that the system wrote; returns whether frames and poses can be
    read."""
    runtime, recording = trial.system.runtime, trial.recording
    assert runtime is not None and recording is not None
    path = trial.run_dir / "mobile" / runtime.trajectory
    line = f"leaves {path.name} in $SLAMBED_OUTPUT, as {runtime.trajectory_format} has it"
    try:
        poses = read_poses(path, runtime, recording)
        found.report(True, line)
        line = "its poses are rotations"
        check_rotations(path, poses)
        found.report(True, line)
        line = "its time stamps are those of the frames"
        frames_of(path, poses, recording)
        found.report(True, f"{line}: {len(poses)} of {FRAMES} have a pose")
    except SlambedError as error:
        return found.report(False, f"{line}: {error}")
    result = record_poses(RunResult("completed", None), runtime, recording, trial.run_dir)
    return result.outcome == "completed"


def _path(trial: Trial, found: Checked) -> None:
    path = trial.run_dir / "mobile" / "trajectory.txt"
    estimate = read_tum(path) if path.exists() else None
    count = 0 if estimate is None else len(estimate)
    line = f"reports where the camera was: {count} poses"
    if count < MINIMUM_PAIRS:
        line += f", {MINIMUM_PAIRS} are needed to compare them"
    if not found.report(count >= MINIMUM_PAIRS, line):
        return
    assert estimate is not None
    truth = read_tum(trial.sequence / "groundtruth.txt")
    with_scale = trial.system.sensors[0] == "mono"
    try:
        error = absolute_error(estimate, truth, with_scale=with_scale).rmse
    except SlambedError as none:
        found.report(False, f"its path can be compared with the true one: {none}")
        return
    inverse = absolute_error(_inverted(estimate), truth, with_scale=with_scale).rmse
    turned = inverse < INVERSE_IS_BETTER * error
    line = "poses are camera to world"
    if turned:
        line += f": no, inverted they fit ({100 * error:.1f} cm as sent, {100 * inverse:.1f} cm)"
    found.report(not turned, line)
    if not turned and not with_scale:
        _steps(estimate, truth, found)
    found.report(True, f"ATE over these frames {100 * error:.1f} cm")


def _steps(estimate: Trajectory, truth: Trajectory, found: Checked) -> None:
    """Reports an odometry that chains the motions of its frames the wrong way round. Over so few
    frames its path is hardly worse for it, but its steps are."""
    sent, inverted = (
        relative_error(path, truth, 1 / FPS).translation_m.rmse
        for path in (estimate, _with_inverted_steps(estimate))
    )
    if inverted < INVERSE_IS_BETTER * sent:
        found.report(
            False,
            f"motions from frame to frame are chained as T_wc[k] = T_wc[k-1] T[k-1,k]: no, each "
            f"inverted fits ({1000 * sent:.1f} mm a frame as sent, {1000 * inverted:.1f} mm)",
        )


def _stops(trial: Trial, found: Checked) -> None:
    if not trial.ready():
        found.report(False, "starts a second time")
        return
    trial.start_clock()
    trial.wait(
        lambda: False, STOPPED_AFTER_S if trial.recording is None else READER_STOPPED_AFTER_S
    )
    for node in trial.nodes.values():
        node.send_signal(signal.SIGTERM)
    codes = {role: trial.code(role, STOP_PATIENCE_S) for role in trial.nodes}
    stopped = object_or_empty(trial.run_dir / "mobile" / "node.json").get("stopped")
    over = trial.recording is not None and stopped is False
    good = set(codes.values()) == {0} and (stopped is True or over)
    how = ": it had ended before" if over else ""
    if not good:
        ends = (f"{role}: {_how_it_ended(code)}" for role, code in codes.items())
        how = f": {', '.join(ends)}"
    found.report(good, f"stops when asked{how}")


def _inverted(path: Trajectory) -> Trajectory:
    """Returns the inverse of each pose."""
    inverse = path.rotations().inv()
    return Trajectory(path.stamps_s, -inverse.apply(path.positions_m), inverse.as_quat())


def _with_inverted_steps(path: Trajectory) -> Trajectory:
    """Returns the path whose motions from pose to pose are the inverse of this one's."""
    rotations, positions = [path.rotations()[0]], [path.positions_m[0]]
    turned = path.rotations()
    for k in range(1, len(path)):
        back = turned[k].inv()
        step = back.apply(path.positions_m[k - 1] - path.positions_m[k])
        positions.append(positions[-1] + rotations[-1].apply(step))
        rotations.append(rotations[-1] * (back * turned[k - 1]))
    quaternions = np.array([rotation.as_quat() for rotation in rotations])
    return Trajectory(path.stamps_s, np.array(positions), quaternions)


def _generate(sensor: str, path: Path) -> Path:
    """Generates a fixed part of a walk through a room."""
    command = [
        *(str(find_program("slambed-synth")), "--out", str(path), "--id", "check", "--seed", "3"),
        *("--sensor", sensor, "--fps", str(FPS), "--seconds", str(FRAMES / FPS)),
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return path


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def _end(node: subprocess.Popen[bytes]) -> None:
    if node.poll() is None:
        # The player ends its program, which has a group of its own.
        node.terminate()
        with suppress(subprocess.TimeoutExpired):
            node.wait(STOP_PATIENCE_S)
    if node.poll() is None:
        os.killpg(node.pid, signal.SIGKILL)
    node.wait()
