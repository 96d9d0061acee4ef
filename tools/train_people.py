#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Trains catalog/networks/slambed_people.onnx with Debian's python3-torch (1.13) on one core.

    tools/train_people.py SCENES OUT.onnx [--seed N] [--minutes M] [--check CHECK] [--pictures N]

SCENES is the output folder of tools/people_scenes.py. The input of the network is a gray picture of
320x256 (0 to 1). Its outputs are `mask` (1, 128, 160: person or not) and `maps` (22, 64, 80): heat
map of persons' centers; offset to the center, right and down (in 64 px); logarithms of width and
height over 64 px; heat maps of COCO's 17 key points. slambed.segment.people decodes them.

Training ends after a given time, and the learning rate falls with the elapsed share of it. It uses
windows of 160x128 first and whole pictures at the end. The weights depend on the seed and on the
number of steps, which is printed. OUT.state is written every minute; the same command resumes from
it. CHECK is a folder of other seeds whose overlap is printed with every state but selects nothing.
`--pictures 32` overfits on 32 pictures: if that fails, something is broken.

Products are in bfloat16 (sums, weights and losses in single precision), which is four times as fast
on processors with AMX and correct on all.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F  # noqa: N812

WIDTH, HEIGHT = 320, 256
REACH_PX = 64.0
WHOLE_FROM = 0.7
"""Share of the time after which whole pictures are used."""
TOP_RATE = 3e-3
WINDOW_BATCH, WHOLE_BATCH = 12, 4
WITH_PEOPLE = 0.85
"""Share of training samples with a person; in the data it is half of all pictures."""
STATE_PERIOD_S = 60.0


def block(inputs: int, outputs: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, dilation, dilation, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class Residual(nn.Module):
    def __init__(self, channels: int, dilation: int = 1) -> None:
        super().__init__()
        self.first = block(channels, channels, dilation=dilation)
        self.second = block(channels, channels)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x + self.second(self.first(x))


class People(nn.Module):
    """Encoder to 1/16 of the resolution, and decoder with skip connections and two heads."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = block(1, 16, 2)
        self.quarter = nn.Sequential(block(16, 24, 2), Residual(24))
        self.eighth = nn.Sequential(block(24, 56, 2), Residual(56))
        self.deep = nn.Sequential(block(56, 96, 2), Residual(96, 2), Residual(96, 2))
        self.up_eighth = block(96 + 56, 56)
        self.up_quarter = nn.Sequential(block(56 + 24, 32), block(32, 32))
        self.maps = nn.Conv2d(32, 22, 1)
        self.narrow = nn.Conv2d(32, 12, 1)
        self.mask = nn.Sequential(block(12 + 16, 12), nn.Conv2d(12, 1, 1))
        # Initialize heat maps near 0, because centers and key points are rare.
        nn.init.constant_(self.maps.bias, 0.0)
        with torch.no_grad():
            self.maps.bias[0] = self.maps.bias[5:] = -4.0

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        half = self.stem(x - 0.45)
        quarter = self.quarter(half)
        eighth = self.eighth(quarter)
        y = F.interpolate(self.deep(eighth), scale_factor=2.0, mode="nearest")
        y = self.up_eighth(torch.cat([y, eighth], 1))
        y = F.interpolate(y, scale_factor=2.0, mode="nearest")
        y = self.up_quarter(torch.cat([y, quarter], 1))
        maps = self.maps(y)
        y = F.interpolate(self.narrow(y), scale_factor=2.0, mode="nearest")
        return self.mask(torch.cat([y, half], 1)), maps


class ForUse(nn.Module):
    """The exported network, which gives probabilities instead of logits."""

    def __init__(self, people: People) -> None:
        super().__init__()
        self.people = people

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        mask, maps = self.people(x)
        heat = torch.sigmoid(maps)
        return torch.sigmoid(mask), torch.cat([heat[:, :1], maps[:, 1:5], heat[:, 5:]], 1)


def add_bell(heat: np.ndarray, u: float, v: float, sigma: float, peak: float) -> None:
    """Raises a map to at least a Gaussian, within three standard deviations of its center."""
    reach = int(np.ceil(3 * sigma))
    left, top = max(0, int(u) - reach), max(0, int(v) - reach)
    window = heat[top : max(0, int(v) + reach + 2), left : max(0, int(u) + reach + 2)]
    if window.size == 0:
        return
    y, x = np.ogrid[top : top + window.shape[0], left : left + window.shape[1]]
    value = peak * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * sigma**2))
    np.maximum(window, value.astype(np.float32), out=window)


def targets(ids: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Returns target maps (22 + 1, h/2, w/2) for ids of shape (h, w), at 1/4 of full resolution.

    The last map marks where offsets and sizes count. ids: instances at half resolution; points: key
    points at full resolution."""
    small = ids[::2, ::2]
    height, width = small.shape
    maps = np.zeros((23, height, width), np.float32)
    y, x = np.mgrid[:height, :width]
    for number in np.unique(small[small > 0]):
        here = small == number
        rows, columns = np.nonzero(here)
        u, v = columns.mean(), rows.mean()
        wide, tall = np.ptp(columns) + 1, np.ptp(rows) + 1
        sigma = float(np.clip(0.06 * np.sqrt(wide * tall), 1.0, 5.0))
        add_bell(maps[0], u, v, sigma, 1.0)
        maps[1][here], maps[2][here] = (u - x[here]) * 4 / REACH_PX, (v - y[here]) * 4 / REACH_PX
        maps[3][here], maps[4][here] = np.log(wide * 4 / REACH_PX), np.log(tall * 4 / REACH_PX)
        maps[22][here] = 1
        for k, (pu, pv, seen) in enumerate(points[number - 1]):
            if seen > 0:
                peak = 1.0 if seen == 2 else 0.7
                add_bell(maps[5 + k], (pu - 1.5) / 4, (pv - 1.5) / 4, min(sigma, 2.0), peak)
    return maps


class Album:
    """Pictures in random order with random mirroring, cropping, brightness and noise."""

    SIDES = np.array([0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15])

    def __init__(self, folder: Path, seed: list[int], most: int | None = None) -> None:
        """most: limits the pictures to this number, all with people."""
        self.gray = np.load(folder / "gray.npy", mmap_mode="r")
        self.people = np.load(folder / "people.npy", mmap_mode="r")
        self.points = np.load(folder / "keypoints.npy")
        self.random = np.random.default_rng(seed)
        shares = np.array([np.count_nonzero(ids) / ids.size for ids in self.people])
        self.with_people, self.empty = np.nonzero(shares > 0.002)[0], np.nonzero(shares == 0)[0]
        self.by_heart = most is not None
        if self.by_heart:
            self.with_people = self.with_people[:: len(self.with_people) // most][:most]

    def batch(self, size: int, whole: bool) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        pictures, masks, maps = [], [], []
        for _ in range(size):
            some = self.by_heart or self.random.random() < WITH_PEOPLE
            i = self.random.choice(self.with_people if some else self.empty)
            gray, ids, points = np.array(self.gray[i]), np.array(self.people[i]), self.points[i]
            points = points.copy()
            if self.random.random() < 0.5:
                gray, ids = gray[:, ::-1], ids[:, ::-1]
                points = points[:, self.SIDES]
                points[..., 0] = WIDTH - 1 - points[..., 0]
            if not whole:
                u, v = self._corner(ids)
                gray, ids = gray[v : v + 128, u : u + 160], ids[v // 2 :, u // 2 :][:64, :80]
                points[..., :2] -= (u, v)
            noise = self.random.normal(0, self.random.uniform(0, 4), gray.shape)
            gain, lift = self.random.uniform(0.75, 1.25), self.random.uniform(-20, 20)
            seen = np.clip((gray.astype(np.float32) - 128) * gain + 128 + lift + noise, 0, 255)
            pictures.append(seen.astype(np.float32)[None] / 255)
            masks.append((ids > 0).astype(np.float32)[None])
            maps.append(targets(ids, points))
        return tuple(torch.from_numpy(np.stack(each)) for each in (pictures, masks, maps))

    def _corner(self, ids: np.ndarray) -> tuple[int, int]:
        """Returns the corner of a random window; three of four windows are near a person."""
        rows, columns = np.nonzero(ids)
        u, v = self.random.integers(0, 161), self.random.integers(0, 129)
        if len(rows) and self.random.random() < 0.75:
            at = self.random.integers(0, len(rows))
            u = 2 * columns[at] - self.random.integers(20, 140)
            v = 2 * rows[at] - self.random.integers(16, 112)
        return int(np.clip(u, 0, 160)) // 4 * 4, int(np.clip(v, 0, 128)) // 4 * 4


def heat_loss(logits: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """Focal loss for heat maps (CornerNet, Law and Deng 2018), divided by the number of peaks."""
    p = torch.sigmoid(logits).clamp(1e-4, 1 - 1e-4)
    peak = wanted > 0.6
    hit = -torch.log(p) * (wanted - p).abs() ** 2 * peak
    miss = -torch.log(1 - p) * p**2 * (1 - wanted) ** 4 * ~peak
    return (hit.sum() + miss.sum()) / (peak.sum() + 10)


def loss(outputs: tuple, mask: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    seen, maps = outputs
    p = torch.sigmoid(seen)
    overlap = (2 * (p * mask).sum() + 50) / ((p + mask).sum() + 50)
    where = wanted[:, 22:]
    far = (F.smooth_l1_loss(maps[:, 1:5], wanted[:, 1:5], reduction="none", beta=0.2) * where).sum()
    return (
        2 * F.binary_cross_entropy_with_logits(seen, mask)
        + (1 - overlap)
        + 0.5 * heat_loss(maps[:, :1], wanted[:, :1])
        + 0.5 * heat_loss(maps[:, 5:], wanted[:, 5:22])
        + 0.5 * far / (where.sum() + 100)
    )


@torch.no_grad()
def overlap_of(people: People, folder: Path | Album) -> float:
    """Returns the mean intersection over union of pictures with at least 0.5 % person pixels."""
    if isinstance(folder, Album):
        gray, ids = folder.gray[folder.with_people], folder.people[folder.with_people]
    else:
        gray, ids = np.load(folder / "gray.npy"), np.load(folder / "people.npy")
    counted = np.count_nonzero(ids, axis=(1, 2)) >= 0.005 * ids[0].size
    overlaps = []
    for picture, truth in zip(gray[counted], ids[counted] > 0, strict=True):
        seen = people(torch.from_numpy(picture[None, None].astype(np.float32) / 255))[0][0, 0] > 0
        marked = seen.numpy()
        overlaps.append((marked & truth).sum() / (marked | truth).sum())
    return float(np.mean(overlaps))


class Training:
    """The state of a training: weights, their running mean, the optimizer, and its progress."""

    def __init__(self, state: Path) -> None:
        self.file, self.people = state, People().to(memory_format=torch.channels_last)
        self.mean = People()
        self.mean.load_state_dict(self.people.state_dict())
        self.optimizer = torch.optim.AdamW(self.people.parameters(), lr=TOP_RATE, weight_decay=1e-3)
        self.taken_s, self.cpu_s, self.steps, self.shown = 0.0, 0.0, 0, 0
        if state.is_file():
            held = torch.load(state)
            self.people.load_state_dict(held["people"])
            self.mean.load_state_dict(held["mean"])
            self.optimizer.load_state_dict(held["optimizer"])
            self.taken_s, self.cpu_s, self.steps, self.shown = held["progress"]

    def save(self) -> None:
        """Writes the state atomically."""
        partial = self.file.with_suffix(".partial")
        progress = (self.taken_s, self.cpu_s, self.steps, self.shown)
        torch.save(
            {
                "people": self.people.state_dict(),
                "mean": self.mean.state_dict(),
                "optimizer": self.optimizer.state_dict(),
                "progress": progress,
            },
            partial,
        )
        partial.replace(self.file)

    def step(self, batch: tuple, rate: float) -> float:
        """Makes one optimization step and returns its loss."""
        pictures, mask, wanted = batch
        self.optimizer.param_groups[0]["lr"] = rate
        with torch.autocast("cpu", dtype=torch.bfloat16):
            seen, maps = self.people(pictures.to(memory_format=torch.channels_last))
        cost = loss((seen.float(), maps.float()), mask, wanted)
        self.optimizer.zero_grad()
        cost.backward()
        nn.utils.clip_grad_norm_(self.people.parameters(), 5.0)
        self.optimizer.step()
        self.steps, self.shown = self.steps + 1, self.shown + len(pictures)
        # Running mean over about the last tenth of all steps, at most 500.
        keep = 1 - 1 / min(500, 1 + self.steps / 10)
        with torch.no_grad():
            now = self.people.state_dict()
            for name, value in self.mean.state_dict().items():
                if value.dtype.is_floating_point:
                    value.lerp_(now[name], 1 - keep)
        return float(cost)


def train(
    folder: Path, out: Path, seed: int, minutes: float, check: Path | None, pictures: int | None
) -> None:
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    run = Training(out.with_suffix(".state"))
    # A resumed training must not get the same windows again.
    album = Album(folder, [seed, run.steps], pictures)
    looked_at: Path | Album | None = album if pictures else check
    print(
        f"{sum(p.numel() for p in run.people.parameters())} parameters, {len(album.gray)} pictures"
    )
    saved, sums = time.monotonic(), []
    while (share := run.taken_s / (60 * minutes)) < 1:
        begin, cpu = time.monotonic(), time.process_time()
        whole = share > WHOLE_FROM
        size = WHOLE_BATCH if whole else WINDOW_BATCH
        rate = TOP_RATE * min(1, (run.steps + 1) / 100) * (0.5 + 0.5 * np.cos(np.pi * share))
        sums.append(run.step(album.batch(size, whole), max(rate, 2e-5)))
        if begin - saved > STATE_PERIOD_S:
            run.save()
            run.mean.eval()
            message = f", overlap {overlap_of(run.mean, looked_at):.4f}" if looked_at else ""
            print(
                f"{run.taken_s:.0f} s, {run.steps} steps, {run.shown} pictures: "
                f"{np.mean(sums):.4f}{message}",
                flush=True,
            )
            saved = time.monotonic()
            sums.clear()
        run.taken_s += time.monotonic() - begin
        run.cpu_s += time.process_time() - cpu
    run.save()
    run.mean.eval()
    if looked_at:
        print(f"overlap {overlap_of(run.mean, looked_at):.4f}")
    export(run.mean, out)
    print(
        f"{run.steps} steps, {run.shown} pictures, {run.cpu_s:.0f} s of CPU in "
        f"{run.taken_s / 60:.1f} minutes, seed {seed}: {out}"
    )


def export(people: People, out: Path) -> None:
    people.eval()
    torch.onnx.export(
        ForUse(people),
        torch.zeros(1, 1, HEIGHT, WIDTH),
        str(out),
        opset_version=12,
        input_names=["picture"],
        output_names=["mask", "maps"],
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--check", type=Path, help="pile of other seeds to watch")
    parser.add_argument("--pictures", type=int, help="learn only so many by heart")
    asked = parser.parse_args()
    train(asked.scenes, asked.out, asked.seed, asked.minutes, asked.check, asked.pictures)
