#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""growth_summary.py CSV [PNG]: prints how times and memory grow with the map; with PNG also plots
them (needs matplotlib)."""

import csv
import statistics
import sys
from pathlib import Path

WARM_UP = 200
"""Keyframes until the local window is full."""
COLUMNS = ("yardstick_ms", "track_ms", "map_ms", "bundle_ms", "detect_ms")


def main() -> None:
    with Path(sys.argv[1]).open(encoding="utf-8") as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    late = [row for row in rows if row["keyframes"] >= WARM_UP]
    if len(late) < 8:
        sys.exit(f"error: {sys.argv[1]}: too few rows beyond {WARM_UP} keyframes; let it grow")
    third = len(late) // 3
    first, last = late[:third], late[-third:]
    print(f"{'':12} {'first third':>12} {'last third':>12} {'ratio':>7} {'per yardstick':>12}")
    for name in COLUMNS:
        a, b = (statistics.median(row[name] for row in part) for part in (first, last))
        # Relative to work of constant size, which cancels changes of the host's speed.
        x, y = (
            statistics.median(row[name] / row["yardstick_ms"] for row in part)
            for part in (first, last)
        )
        print(f"{name:12} {a:12.3f} {b:12.3f} {ratio(b, a):7.2f} {ratio(y, x):12.2f}")
    grown = late[-1]["keyframes"] - late[0]["keyframes"]
    heap_kb = 1e3 * (late[-1]["heap_mb"] - late[0]["heap_mb"]) / grown
    points = late[-1]["points"] / late[-1]["keyframes"]
    print(f"{heap_kb:.0f} KB of heap per keyframe, {points:.0f} points")
    if len(sys.argv) > 2:
        draw(rows, sys.argv[2])


def ratio(later: float, earlier: float) -> float:
    return later / earlier if earlier else float("nan")


def draw(rows: list[dict[str, float]], path: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 2, figsize=(8, 5), sharex=True, constrained_layout=True)
    for axis, name in zip(axes.flat, ("track_ms", "map_ms", "detect_ms", "heap_mb"), strict=True):
        axis.plot([row["keyframes"] for row in rows], [row[name] for row in rows])
        axis.set_ylim(bottom=0)
        axis.set_ylabel(name)
        axis.set_xlabel("keyframes")
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
