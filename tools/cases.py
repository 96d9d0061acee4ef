# SPDX-License-Identifier: Apache-2.0
"""Prints a table of what slambed says of a folder of awkward inputs, one line for each.

`python tools/cases.py FOLDER [PART...] [--against TABLE]` calls what a user would call:
`data prepare` for dataset files, `profiles show` for link profiles, `run --engine virtual` for
experiments. FOLDER's parent is searched for the data. Paths of a dataset file begin at that parent.
PART chooses files by a part of their path. With `--against` inputs whose exit code is not that of a
kept table are named at the end, and the exit code is 1.
"""

import argparse
import contextlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path

import numpy as np
import yaml

from slambed.commands.main import run_command
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.files.yaml_text import read_yaml

LONGEST = 420
TOLD = re.compile(r"note:|error:|warning", re.I)


def command_of(file: Path) -> list[str] | None:
    """Returns the command for this file; None for a file that another one names."""
    try:
        content = read_yaml(file.read_text(encoding="utf-8-sig", errors="replace"))
    except (yaml.YAMLError, SlambedError):
        return ["data", "prepare", str(file)]
    if not isinstance(content, dict) or "runtime" in content:
        return None
    if "reader" in content:
        return ["data", "prepare", str(file)]
    if "systems" in content:
        return ["run", str(file), "--engine", "virtual", "--no-figures"]
    return ["profiles", "show", str(file), "--output", f"{file.stem}.png"]


def said(command: list[str]) -> tuple[int, str]:
    """Returns the exit code, and notes and errors or else the last line."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run_command(command)
    lines = [line.strip() for line in (err.getvalue() + out.getvalue()).splitlines()]
    told = [line for line in lines if TOLD.search(line)]
    return int(code), " ".join(told or [line for line in lines if line][-1:])


def facts(cache: Path) -> str:
    """Returns what the newest prepared sequence holds."""
    made = sorted((cache / "prepared").glob("*/sequence.json"), key=lambda p: p.stat().st_mtime)
    if not made:
        return ""
    sequence = PreparedSequence.open(made[-1].parent)
    found = f"{len(sequence)} frames, {sequence.duration_s:.2f} s"
    found += f", {len(np.unique(sequence.gray(0)))} gray levels"
    second = sequence.second(0)
    if second is not None and second.dtype == np.uint16 and (second > 0).any():
        found += f", depth {np.median(second[second > 0]) * sequence.info.depth_unit_m:.3f} m"
    truth = sequence.groundtruth()
    return f"{found}, {len(truth)} poses" if truth is not None else f"{found}, no ground truth"


def row(root: Path, file: Path, work: Path) -> str | None:
    """Returns the line of the table for one file."""
    if (command := command_of(file)) is None:
        return None
    with tempfile.TemporaryDirectory(dir=work) as place, contextlib.chdir(place):
        os.environ["SLAMBED_CACHE"] = f"{place}/cache"
        if command[0] == "run":
            command += ["--results", f"{place}/results"]
        code, line = said(command)
        if command[:2] == ["data", "prepare"] and code == 0:
            line = f"{facts(Path(place) / 'cache')}. {line if TOLD.search(line) else ''}"
        line = line.replace(f"{place}/", "").replace(f"{root.parent}/", "")
    line = line.replace("|", "/").strip()
    shown = line if len(line) <= LONGEST else f"{line[:LONGEST]} ..."
    return f"| {file.relative_to(root)} | {code} | {shown} |"


def codes(table: str) -> dict[str, str]:
    """Returns input -> exit code of the lines of a table."""
    return dict(re.findall(r"^\| `?([^`|]+?)`? \| (\d+) \|", table, re.M))


def main() -> None:
    """Prints the table, and what differs from a kept one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("parts", nargs="*", metavar="part")
    parser.add_argument("--against", type=Path, metavar="TABLE")
    given = parser.parse_args()
    root = given.folder.resolve()
    kept = codes(given.against.read_text(encoding="utf-8")) if given.against else {}
    os.environ["SLAMBED_DATA"] = str(root.parent)
    os.environ["SLAMBED_DATASETS"] = ":".join(str(p) for p in sorted(root.iterdir()) if p.is_dir())
    print("| input | exit code | what it says |\n|---|---:|---|")
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as work:
        for file in sorted(root.glob("*/*.yaml")):
            wanted = not given.parts or any(part in str(file) for part in given.parts)
            if wanted and (line := row(root, file, Path(work))) is not None:
                print(line, flush=True)
                found |= codes(line)
    differing = [name for name, code in found.items() if kept.get(name, code) != code]
    for name in differing:
        print(f"{name}: exit code {found[name]}, but {kept[name]} in {given.against}")
    sys.exit(bool(differing))


if __name__ == "__main__":
    main()
