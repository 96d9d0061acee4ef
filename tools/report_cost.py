#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""report_cost.py RESULTS RUNS [CELLS]: CPU and wall seconds of the report of a large experiment.

Makes RUNS runs in CELLS cells (100) out of the runs of an experiment's results folder, each under a
key, repetition, seed and link name of its own and with measured numbers a few percent apart, in a
scratch folder; then times `slambed report` on it twice. Only tables and trajectories are links to
the same files.
"""

import hashlib
import json
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

SPREAD = 0.03
"""Measured numbers of a copy are so far from its original's (standard deviation)."""
COPIED = ("summary.json", "manifest.json")


def moved(spec: dict[str, Any], cell: int, repetition: int, key: str) -> dict[str, Any]:
    """A RunSpec as JSON in another cell."""
    profile = f"{spec['profile']}_{cell:03d}"
    name = f"{spec['cell'].rsplit('/', 1)[0]}/{profile}"
    seed = spec["seed"] + repetition
    own = {"cell": name, "profile": profile, "repetition": repetition, "seed": seed}
    return spec | own | ({"run_key": key} if "run_key" in spec else {})


def copy_run(source: Path, target: Path, cell: int, repetition: int) -> dict[str, Any]:
    """A run of its own with the content of another; returns its RunSpec."""
    target.mkdir()
    for path in source.glob("*"):
        if path.is_file() and path.name not in COPIED:
            os.link(path, target / path.name)
    summary = json.loads((source / "summary.json").read_text())
    manifest = json.loads((source / "manifest.json").read_text())
    spec = moved(manifest["spec"], cell, repetition, target.name)
    draw = random.Random(target.name)
    for key, value in summary.items():
        if isinstance(value, float) and key != "coverage":
            summary[key] = value * draw.gauss(1.0, SPREAD)
    own = {
        name: spec[name] for name in ("cell", "profile", "repetition", "seed") if name in summary
    }
    (target / "summary.json").write_text(json.dumps(summary | own, indent=1) + "\n")
    facts = {"run_key": target.name, "spec": spec, "cell": spec["cell"], "seed": spec["seed"]}
    facts |= {"repetition": repetition}
    (target / "manifest.json").write_text(json.dumps(manifest | facts, indent=1) + "\n")
    return {"run_key": target.name, **spec}


def multiply(source: Path, results: Path, runs: int, cells: int) -> Path:
    """A results folder with so many runs; returns that of the experiment."""
    folder, store = results / source.name, results / "runs"
    (folder / "runs").mkdir(parents=True)
    store.mkdir()
    originals = sorted(path.resolve() for path in (source / "runs").iterdir())
    listed = []
    for number in range(runs):
        key = hashlib.sha256(str(number).encode()).hexdigest()[:16]
        original = originals[number % len(originals)]
        listed.append(copy_run(original, store / key, number % cells, number // cells))
        (folder / "runs" / key).symlink_to(Path("../../runs") / key)
    content = json.loads((source / "experiment.json").read_text())
    content["experiment"]["link"]["profiles"] = list(dict.fromkeys(s["profile"] for s in listed))
    (folder / "experiment.json").write_text(json.dumps(content | {"runs": listed}, indent=1))
    for truth in (source / "groundtruth").glob("*"):
        (folder / "groundtruth").mkdir(exist_ok=True)
        os.link(truth, folder / "groundtruth" / truth.name)
    return folder


def main() -> None:
    source, runs = Path(sys.argv[1]), int(sys.argv[2])
    cells = int(sys.argv[3]) if len(sys.argv) > 3 else 100
    # Beside the original, for links go no further than their file system.
    with tempfile.TemporaryDirectory(dir=source.parent) as scratch:
        folder = multiply(source, Path(scratch), runs, cells)
        for which in ("first", "again"):
            before = os.times()
            called = [
                sys.executable,
                "-c",
                "from slambed.commands.main import main; main()",
                "report",
            ]
            subprocess.run([*called, str(folder)], check=True, stdout=subprocess.DEVNULL)
            after = os.times()
            cpu_s = after.children_user + after.children_system
            cpu_s -= before.children_user + before.children_system
            figures = len(list((folder / "report").glob("*.png")))
            print(
                f"{which}: {runs} runs in {cells} cells, CPU {cpu_s:.1f} s, "
                f"wall {after.elapsed - before.elapsed:.1f} s, {figures} figures",
                flush=True,
            )


if __name__ == "__main__":
    main()
