#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""bench_summary.py [--history FILE] JSON...: median CPU time and spread of every benchmark.

Prints a Markdown table and appends one line per benchmark to the history.
"""

import argparse
import json
from datetime import UTC, datetime
from pathlib import Path

from bench_against import TO_US, this_commit
from bench_pairs import append_history, processor, rounded


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--history", type=Path)
    parser.add_argument("json", type=Path, nargs="+")
    asked = parser.parse_args()
    kept = []
    print("| program | benchmark | CPU, us: median | spread, % |\n|---|---|---|---|")
    for path in asked.json:
        found: dict[str, dict[str, float]] = {}
        rows = json.loads(path.read_text(encoding="utf-8"))["benchmarks"]
        # Benchmarks ran and were written in random order.
        rows.sort(key=lambda row: (row["family_index"], row["per_family_instance_index"]))
        for row in rows:
            # The coefficient of variation is a ratio; all other values are times.
            scale = 100 if row["aggregate_name"] == "cv" else TO_US[row["time_unit"]]
            found.setdefault(row["run_name"], {})[row["aggregate_name"]] = row["cpu_time"] * scale
        for name, line in found.items():
            print(f"| {path.stem} | {name} | {rounded(line['median'])} | {line['cv']:.0f} |")
            measured = {"median_us": line["median"], "spread": line["cv"] / 100}
            kept.append({"benchmark": f"{path.stem}/{name}", **measured})
    if asked.history:
        date = datetime.now(UTC).isoformat(timespec="seconds")
        shared = {"commit": this_commit(), "date": date, "processor": processor()}
        append_history(asked.history, [{**shared, **line} for line in kept])


if __name__ == "__main__":
    main()
