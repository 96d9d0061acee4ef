#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""bench_summary.py JSON...: median CPU time and spread of every benchmark, as a Markdown table."""

import json
import sys
from pathlib import Path

TO_US = {"ns": 1e-3, "us": 1.0, "ms": 1e3, "s": 1e6}


def rounded(value: float) -> str:
    """Three digits that mean something, never in powers of ten."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def main() -> None:
    print("| program | benchmark | CPU, us: median | spread, % |\n|---|---|---|---|")
    for path in map(Path, sys.argv[1:]):
        found: dict[str, dict[str, float]] = {}
        rows = json.loads(path.read_text(encoding="utf-8"))["benchmarks"]
        # They ran and were written in random order.
        rows.sort(key=lambda row: (row["family_index"], row["per_family_instance_index"]))
        for row in rows:
            # The coefficient of variation is a share, everything else a time.
            scale = 100 if row["aggregate_name"] == "cv" else TO_US[row["time_unit"]]
            found.setdefault(row["run_name"], {})[row["aggregate_name"]] = row["cpu_time"] * scale
        for name, line in found.items():
            print(f"| {path.stem} | {name} | {rounded(line['median'])} | {line['cv']:.0f} |")


if __name__ == "__main__":
    main()
