# SPDX-License-Identifier: Apache-2.0
"""Creates prepared sequences with a reader or with the synthetic generator."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from slambed.data.model import Frame, beside_picture, implausible
from slambed.data.prepared import PreparedWriter, stride_bytes
from slambed.data.readers.base import FolderReader, SequenceReader
from slambed.data.recipe import CameraRecipe, Dataset
from slambed.data.stamps import check_times
from slambed.data.trajectory import Trajectory
from slambed.data.truth_times import fitting_truth
from slambed.errors import ExitCode, SlambedError
from slambed.native import find_program

#: Called with the number of finished frames and the total.
Progress = Callable[[int, int], None]
#: Called with a progress line for the user.
Notify = Callable[[str], None]

#: To be incremented when a change of this code requires sequences to be prepared again.
PREPARATION_VERSION = 5
#: A median depth outside this range indicates a wrong unit.
DEPTH_MEDIAN_RANGE_M = (0.1, 50.0)
_DEPTH_SAMPLE_EVERY = 25
#: Assumed length if the path determines it; only for the check of free space.
_USUAL_SYNTHETIC_S = 90.0


class Job(Protocol):
    """Creates one sequence."""

    def key(self) -> str:
        """Hash of recipe and source."""

    def size_bytes(self) -> int:
        """Returns the approximate size of the output."""

    def write(self, path: Path, progress: Progress | None, notify: Notify) -> None:
        """Creates the folder atomically; `notify` receives remarks on skipped data and detected
        formats."""


class SourceJob:
    """A recorded dataset with its reader."""

    def __init__(self, dataset: Dataset, reader: SequenceReader) -> None:
        self._dataset, self._reader = dataset, reader

    def key(self) -> str:
        digest = hashlib.sha256(f"{PREPARATION_VERSION} {self._dataset.content_key()}".encode())
        for file in self._reader.files():
            try:
                stat = file.stat()
            except OSError as missing:
                raise SlambedError(f"{file}: {missing.strerror}; complete the dataset") from missing
            name = os.path.relpath(file, self._reader.path)
            digest.update(f"{name} {stat.st_size} {stat.st_mtime_ns}\n".encode())
        return digest.hexdigest()

    def size_bytes(self) -> int:
        return len(self._reader) * stride_bytes(self._dataset.sensor, *self._reader.size())

    def write(self, path: Path, progress: Progress | None, notify: Notify) -> None:
        dataset, reader = self._dataset, self._reader
        width, height = reader.size()
        times_ns = reader.times_ns()
        check_times(times_ns, reader.place, reader.max_gap_s)
        truth = self._trajectory(times_ns)
        later_s = _seconds_to_zero(reader, times_ns)
        for note in reader.notes:
            notify(f"note: {note}")
        straighten = _straightener(dataset.camera)
        camera = reader.camera()
        baseline_m = camera.bf / camera.fx
        if wrong := implausible(camera.cx, camera.cy, baseline_m, (width, height)):
            raise SlambedError(f"{reader.path}: {wrong}; correct the calibration")
        if beside := beside_picture(camera.cx, camera.cy, (width, height)):
            notify(f"note: {reader.path}: {beside}")
        with PreparedWriter(
            path,
            id=dataset.id,
            title=dataset.title,
            sensor=dataset.sensor,
            width=width,
            height=height,
            fps=dataset.fps,
            camera=camera,
            depth_unit_m=dataset.depth_unit_m if dataset.sensor == "rgbd" else 0.0,
            close_depth_baselines=dataset.close_depth_baselines,
            source={
                "dataset": dataset.id,
                "recipe": dataset.content_key(),
                "reader": dataset.reader,
                "preparation_version": PREPARATION_VERSION,
            },
        ) as writer:
            depths = DepthSample()
            for i, frame in enumerate(_read_ahead(reader)):
                time_ns = frame.timestamp_ns + later_s * 1_000_000_000
                writer.add(replace(straighten(frame), timestamp_ns=time_ns))
                if dataset.sensor == "rgbd" and i % _DEPTH_SAMPLE_EVERY == 0:
                    depths.add(frame)
                if progress:
                    progress(i + 1, len(reader))
            if dataset.sensor == "rgbd":
                check_depth_scale(dataset, depths)
            if truth is not None:
                writer.set_groundtruth(replace(truth, stamps_s=truth.stamps_s + later_s))

    def _trajectory(self, times_ns: list[int]) -> Trajectory | None:
        truth = self._reader.trajectory()
        if truth is None:
            return None
        fitted, notes = fitting_truth(times_ns, truth, str(self._reader.path))
        self._reader.notes += notes
        return fitted


def _seconds_to_zero(reader: SequenceReader, times_ns: list[int]) -> int:
    """Returns the seconds to add to all times: programs that read trajectories reject negative
    times."""
    later_s = -(min(times_ns, default=0) // 1_000_000_000)
    if later_s <= 0:
        return 0
    reader.notes.append(
        f"{reader.place(0)}: times begin at {times_ns[0] * 1e-9:.6f} s; {later_s} s are added to "
        "those of frames and ground truth"
    )
    return later_s


def _straightener(camera: CameraRecipe | None) -> Callable[[Frame], Frame]:
    """Returns a function that removes distortion that nodes do not support. Depth has the same
    pixels, and is remapped without interpolation."""
    if camera is None or not camera.is_straightened:
        return lambda frame: frame
    import cv2  # slow to import

    lens = camera.lens()
    maps = lens.maps(np.eye(3), lens.matrix, (camera.width, camera.height))

    def straighten(frame: Frame) -> Frame:
        gray = np.asarray(cv2.remap(frame.gray, *maps, cv2.INTER_LINEAR), np.uint8)
        second = frame.second
        if second is not None:
            second = np.asarray(cv2.remap(second, *maps, cv2.INTER_NEAREST), np.uint16)
        return Frame(frame.timestamp_ns, gray, second)

    return straighten


class SynthJob:
    """A generated dataset; slambed-synth writes the prepared form directly."""

    def __init__(self, dataset: Dataset, path_file: Path | None = None) -> None:
        assert dataset.synthetic is not None
        self._dataset, self._options, self._path_file = dataset, dataset.synthetic, path_file
        self._program = find_program("slambed-synth")

    def key(self) -> str:
        version = subprocess.run(
            [self._program, "--version"], capture_output=True, text=True, check=True
        ).stdout.strip()
        digest = hashlib.sha256(f"{version} {self._dataset.content_key()}".encode())
        if self._path_file is not None:
            digest.update(self._path_file.read_bytes())
        return digest.hexdigest()

    def size_bytes(self) -> int:
        options = self._options
        seconds = options.seconds or _USUAL_SYNTHETIC_S
        width, height = options.width or 640, options.height or 480
        return round(seconds * self._dataset.fps) * stride_bytes(
            self._dataset.sensor, width, height
        )

    def command(self, path: Path) -> list[str]:
        """Returns the command line that generates this sequence."""
        dataset = self._dataset
        source = {"dataset": dataset.id, "recipe": dataset.content_key()}
        command = [str(self._program), "--out", str(path), "--id", dataset.id]
        command += ["--title", dataset.title, "--sensor", dataset.sensor]
        command += ["--fps", str(dataset.fps), "--source", json.dumps(source), "--progress"]
        options = self._options.model_dump(exclude_none=True)
        if self._path_file is not None:
            options["trajectory"] = self._path_file.resolve()
        for name, value in options.items():
            if value is not False:
                command.append(f"--{name.replace('_', '-')}")
            if not isinstance(value, bool):
                command.append(str(value))
        return command

    def write(
        self, path: Path, progress: Progress | None, notify: Notify = lambda line: None
    ) -> None:
        process = subprocess.Popen(
            self.command(path), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        with process:
            try:
                assert process.stdout is not None and process.stderr is not None
                for line in process.stdout:
                    words = line.split()
                    if progress and len(words) == 3 and words[0] == "progress":
                        progress(int(words[1]), int(words[2]))
                error = process.stderr.read().strip()
            except BaseException:
                process.terminate()
                raise
        if process.returncode != 0:
            code = process.returncode
            line = error.splitlines()[-1].removeprefix("error: ") if error else f"status {code}"
            known = code in set(ExitCode)
            raise SlambedError(
                f"{self._dataset.id}: {line}", ExitCode(code) if known else ExitCode.INTERNAL
            )


@dataclass
class DepthSample:
    """Raw depth statistics of some frames."""

    medians: list[float] = field(default_factory=list)
    largest: int = 0

    def add(self, frame: Frame) -> None:
        assert frame.second is not None
        known = frame.second[frame.second > 0]
        if known.size:
            self.medians.append(float(np.median(known)))
            self.largest = max(self.largest, int(known.max()))


def check_depth_scale(dataset: Dataset, depths: DepthSample) -> None:
    """Raises SlambedError if the depth unit must be wrong."""
    low, high = DEPTH_MEDIAN_RANGE_M
    if not depths.medians:
        raise SlambedError(f"dataset '{dataset.id}': no depth in any image; check the depth files")
    median_m = float(np.median(depths.medians)) * dataset.depth_unit_m
    if not low <= median_m <= high:
        raise SlambedError(
            f"dataset '{dataset.id}': wrong depth scale: the median depth is {median_m:.4g} m with "
            f"depth_unit_m {dataset.depth_unit_m:g}, not within {low:g} to {high:g} m (the largest "
            f"value is {depths.largest}); set depth_unit_m in its dataset file (TUM 0.0002, "
            "millimeters 0.001)"
        )


def _read_ahead(reader: SequenceReader) -> Iterator[Frame]:
    """Yields frames in order, decoded on all cores if the reader allows it."""
    if not isinstance(reader, FolderReader):
        yield from reader
        return
    workers = os.cpu_count() or 1
    with ThreadPoolExecutor(workers) as pool:
        waiting: deque[Future[Frame]] = deque()
        for i in range(len(reader)):
            waiting.append(pool.submit(reader.__getitem__, i))
            if len(waiting) > 2 * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
