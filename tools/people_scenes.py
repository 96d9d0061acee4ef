#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Generates pictures with labeled people for tools/train_people.py: one generated clip per seed.

    tools/people_scenes.py FOLDER FIRST_SEED SCENES [FRAMES]

The seed determines room, camera path, number of people, their activity, sizes and clothes, blur,
noise and JPEG quality. About one clip in six has no people. Writes into FOLDER gray.npy
(n, 256, 320), people.npy (n, 128, 160; 0: background, i: i-th instance), keypoints.npy
(n, 6, 17, 3; pixels of 320x256 and visibility) and scenes.json.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from slambed.data.prepared import PreparedSequence
from slambed.native import find_program
from slambed.segment.mask_cache import LABELS_FILE, LABELS_KEY, MaskCache

WIDTH, HEIGHT = 320, 256
MOST_PEOPLE = 6
FPS = 3.0
PATHS = ("spline", "spline", "spline", "xyz", "halfsphere", "office", "two_laps")


def options(seed: int) -> dict[str, str | int | float]:
    """Returns the generator's options for this seed."""
    draw = random.Random(seed)
    people = 0 if draw.random() < 1 / 6 else draw.choice((1, 1, 2, 2, 3, 4))
    trajectory = draw.choice(PATHS)
    near = trajectory in ("xyz", "halfsphere")
    activities = ("walking", "crossing", "crossing", "sitting", "mixed") if near else ("mixed",)
    return {
        "seed": seed,
        "trajectory": trajectory,
        "people": people,
        "activity": draw.choice(activities),
        "moving-objects": 0,
        "motion-blur-s": round(draw.uniform(0, 0.03), 4),
        "noise": round(draw.uniform(0, 6), 2),
        "texel-scale": round(draw.uniform(2.5, 5), 2),
    }


def degrade(gray: NDArray[np.uint8], draw: random.Random) -> NDArray[np.uint8]:
    """Varies brightness, contrast and JPEG quality as a camera and a link do."""
    gain, lift, gamma = draw.uniform(0.6, 1.4), draw.uniform(-25, 25), draw.uniform(0.7, 1.4)
    ramp = 255 * (np.arange(256) / 255) ** gamma
    table = np.clip((ramp - 128) * gain + 128 + lift, 0, 255).astype(np.uint8)
    _, jpeg = cv2.imencode(".jpg", table[gray], [cv2.IMWRITE_JPEG_QUALITY, draw.randint(30, 95)])
    return np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


class Pile:
    """Pictures and labels of all clips."""

    def __init__(self) -> None:
        self.gray: list[NDArray[np.uint8]] = []
        self.people: list[NDArray[np.uint8]] = []
        self.keypoints: list[NDArray[np.float32]] = []

    def add_clip(self, sequence: PreparedSequence, labels: MaskCache, draw: random.Random) -> None:
        stretch = np.array([WIDTH / sequence.info.width, HEIGHT / sequence.info.height, 1])
        center = np.array([0.5, 0.5, 0])
        for i in range(len(sequence)):
            gray = degrade(sequence.gray(i), draw)
            ids = np.zeros(gray.shape, np.uint8)
            points = np.zeros((MOST_PEOPLE, 17, 3), np.float32)
            for number, person in enumerate(labels.frame(i).instances[:MOST_PEOPLE]):
                ids[person.mask] = number + 1
                assert person.keypoints is not None
                points[number] = (person.keypoints + center) * stretch - center
            size, half = (WIDTH, HEIGHT), (WIDTH // 2, HEIGHT // 2)
            self.gray.append(cv2.resize(gray, size, interpolation=cv2.INTER_LINEAR))
            self.people.append(cv2.resize(ids, half, interpolation=cv2.INTER_NEAREST))
            self.keypoints.append(points)

    def save(self, folder: Path) -> None:
        np.save(folder / "gray.npy", np.stack(self.gray))
        np.save(folder / "people.npy", np.stack(self.people))
        np.save(folder / "keypoints.npy", np.stack(self.keypoints))


def clips(
    first: int, scenes: int, frames: int
) -> Iterator[tuple[PreparedSequence, MaskCache, random.Random, dict[str, str | int | float]]]:
    """Yields per seed a clip, its labels, a random generator for degradation, and its options.

    Seeds whose room has no place for the people are skipped."""
    program = str(find_program("slambed-synth"))
    for seed in range(first, first + scenes):
        asked = options(seed)
        with tempfile.TemporaryDirectory() as scratch:
            clip = Path(scratch) / "clip"
            command = [program, "--out", str(clip), "--sensor", "mono", "--labels"]
            command += ["--width", "320", "--height", "240", "--fps", str(FPS)]
            command += ["--seconds", str(frames / FPS), "--threads", "1"]
            for name, value in asked.items():
                command += [f"--{name}", str(value)]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode != 0:
                print(f"seed {seed} left out: {done.stderr.strip()}", file=sys.stderr)
                continue
            labels = MaskCache.open(clip / LABELS_FILE, LABELS_KEY)
            yield PreparedSequence.open(clip), labels, random.Random(-seed), asked


def draw_scenes(folder: Path, first: int, scenes: int, frames: int) -> None:
    """Generates all clips and writes them into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    pile, output = Pile(), []
    for sequence, labels, draw, asked in clips(first, scenes, frames):
        pile.add_clip(sequence, labels, draw)
        output.append(asked)
    pile.save(folder)
    (folder / "scenes.json").write_text(json.dumps(output, indent=1) + "\n")
    print(f"{folder}: {len(pile.gray)} pictures of {len(output)} scenes")


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    draw_scenes(Path(sys.argv[1]), *(int(a) for a in (*sys.argv[2:], "20")[:3]))
