#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the benchmarks of this checkout with those of another commit, the yardstick.

Both alternate, so that each pair meets the same load of the host. docs/how-to/benchmark.md
describes how a slow-down is judged.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

from bench_pairs import (
    SLOWER,
    BadInputError,
    Finding,
    Times,
    alternating,
    append_history,
    compare,
    newest_other,
    only_one_side,
    processor,
    read_history,
    table,
)

ROOT = Path(__file__).resolve().parents[1]
TO_US = {"ns": 1e-3, "us": 1.0, "ms": 1e3, "s": 1e6}
MIN_TIME = "0.05"
"""Seconds per benchmark and round: short, because many pairs tell more than long ones."""
OLDEST = 20
"""Commits back to the yardstick if there is neither a history nor a release."""
ONE_OF = "--benchmark_filter=^({})$"


def git(*arguments: str, check: bool = True) -> str:
    try:
        done = subprocess.run(
            ["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise BadInputError(f"git: {error.strerror}; commits are compared by it") from None
    if check and done.returncode:
        raise BadInputError(done.stderr.strip().splitlines()[-1])
    return done.stdout.strip() if done.returncode == 0 else ""


def resolved(name: str) -> str:
    if commit := git("rev-parse", "--verify", "--quiet", f"{name}^{{commit}}", check=False):
        return commit[:12]
    raise BadInputError(f"{name} is not a commit of this repository; fetch it or name another BASE")


def this_commit() -> str:
    """Returns the checkout's commit, with "-changed" appended if compiled files differ from it."""
    changed = git("status", "--porcelain", "--", "systems", "cmake", "CMakeLists.txt")
    return resolved("HEAD") + ("-changed" if changed else "")


def default_base(history: Path) -> str:
    """Returns the newest other commit of the history, else the latest release, else HEAD~20."""
    found = newest_other(read_history(history), resolved("HEAD"))
    found = found or git("describe", "--tags", "--abbrev=0", "HEAD^", check=False)
    return found or f"HEAD~{OLDEST}"


def build(source: Path, folder: Path) -> list[Path]:
    """Builds the benchmark programs of a source tree and returns their paths."""
    command = ["cmake", "-S", str(source), "-B", str(folder), "-G", "Ninja"]
    command += ["-DSLAMBED_TESTS=OFF", "-DSLAMBED_BENCHMARKS=ON"]
    if shutil.which("ccache"):
        command.append("-DCMAKE_CXX_COMPILER_LAUNCHER=ccache")
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    ninja = ["ninja", "-C", str(folder)]
    known = subprocess.run(
        [*ninja, "-t", "targets", "all"], check=True, capture_output=True, text=True
    ).stdout
    programs = sorted(re.findall(r"^(bin/\w+_bench):", known, re.MULTILINE))
    flags = os.environ.get("SLAMBED_NINJA_FLAGS", "").split()
    subprocess.run([*ninja, "--quiet", *flags, *programs], check=True, stdout=sys.stderr)
    return [folder / program for program in programs]


def build_yardstick(commit: str) -> list[Path]:
    """Builds and keeps a commit's programs. The path of its temporary tree is fixed for ccache."""
    beside = ROOT / "build-bench" / "yardstick"
    kept, source = beside / commit, beside / "source"
    if not kept.is_dir():
        git("worktree", "remove", "--force", str(source), check=False)
        try:
            git("worktree", "add", "--detach", "--force", str(source), commit)
            programs = build(source, beside / "build")
            kept.with_suffix(".part").mkdir(exist_ok=True)
            for program in programs:
                shutil.copy2(program, kept.with_suffix(".part") / program.name)
            kept.with_suffix(".part").rename(kept)
        finally:
            git("worktree", "remove", "--force", str(source), check=False)
    return sorted(kept.glob("*_bench"))


def names_of(programs: list[Path]) -> list[str]:
    """Returns program/benchmark for all benchmarks of the programs."""
    found = []
    for program in programs:
        listed = subprocess.run(
            [program, "--benchmark_list_tests"], check=True, capture_output=True, text=True
        ).stdout
        found += [f"{program.name}/{line}" for line in listed.splitlines()]
    return found


def times_of(program: Path, names: list[str]) -> Times:
    """Measures CPU times of the named benchmarks in one process."""
    command = [str(program), ONE_OF.format("|".join(map(re.escape, names)))]
    command += [f"--benchmark_min_time={MIN_TIME}", "--benchmark_format=json"]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    rows = json.loads(done.stdout)["benchmarks"]
    return {
        f"{program.name}/{row['name']}": row["cpu_time"] * TO_US[row["time_unit"]]
        for row in rows
        if not row.get("error_occurred")
    }


class Sides:
    """Programs of the yardstick and of this checkout."""

    def __init__(self, base: list[Path], now: list[Path]) -> None:
        self.base = {program.name: program for program in base}
        self.now = {program.name: program for program in now}

    def measure(self, names: list[str], rounds: int) -> list[tuple[Times, Times]]:
        """Alternates program by program within a round, so that a pair is only seconds apart."""
        chosen: dict[str, list[str]] = {}
        for name in names:
            program, _, benchmark = name.partition("/")
            chosen.setdefault(program, []).append(benchmark)
        pairs = []
        for number, base_first in enumerate(alternating(rounds), 1):
            base: Times = {}
            now: Times = {}
            sides = [(base, self.base), (now, self.now)]
            for program, benchmarks in chosen.items():
                for times, programs in sides if base_first else sides[::-1]:
                    times |= times_of(programs[program], benchmarks)
            if missing := [name for name in names if name not in base or name not in now]:
                raise BadInputError(f"{missing[0]} ends with an error; leave it out with --filter")
            pairs.append((base, now))
            print(f"pair {number} of {rounds}: {len(names)} benchmarks", file=sys.stderr)
        return pairs


def history_rows(found: list[Finding], commit: str, base: str) -> list[dict[str, object]]:
    shared: dict[str, object] = {
        "commit": commit,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": processor(),
    }
    return [
        {
            **shared,
            "benchmark": one.name,
            "median_us": one.now_us,
            "spread": one.spread,
            "pairs": one.pairs,
            "ratio": one.ratio,
            "interval": [one.low, one.high] if one.low else None,
            "verdict": one.verdict,
            "yardstick": base,
        }
        for one in found
    ]


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("base", nargs="?", help="commit; else the history's newest other one")
    parser.add_argument("--rounds", type=int, default=7, help="pairs of each benchmark (7)")
    parser.add_argument("--filter", default="", metavar="REGEX", help="of program/benchmark")
    parser.add_argument("--history", type=Path, default=ROOT / "build-bench/history.jsonl")
    parser.add_argument("--limit", type=float, default=5, help="percent that count (5)")
    return parser.parse_args()


def main() -> int:
    asked = arguments()
    if asked.rounds < 1 or asked.limit <= 0:
        raise BadInputError("--rounds and --limit must be above 0")
    try:
        wanted = re.compile(asked.filter)
    except re.error as why:
        raise BadInputError(f"--filter {asked.filter}: {why}; give a regular expression") from why
    read_history(asked.history)
    commit, base = this_commit(), resolved(asked.base or default_base(asked.history))
    base_programs = build_yardstick(base)
    now_programs = build(ROOT, ROOT / "build-bench")
    has, had = names_of(now_programs), names_of(base_programs)
    both = [name for name in has if name in had and wanted.search(name)]
    if not both:
        raise BadInputError(
            f"no benchmark of both commits fits '{asked.filter}'; give another --filter"
        )
    sides = Sides(base_programs, now_programs)
    found = compare(both, sides.measure, asked.rounds, asked.limit / 100)
    print(f"{commit} over {base}, {processor()}, limit {asked.limit:g} %\n")
    print("\n".join(table(found)))
    print("".join(f"\n{line}" for line in only_one_side(had, has) if wanted.search(line)))
    append_history(asked.history, history_rows(found, commit, base))
    if slower := [one.name for one in found if one.verdict == SLOWER]:
        what = f"slower than {base} by more than {asked.limit:g} %: {', '.join(slower)}"
        print(f"error: {what}; see the table above", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except BadInputError as raised:
        sys.exit(print(f"error: {raised}", file=sys.stderr) or 2)
    except subprocess.CalledProcessError as failed:
        what = f"{Path(failed.cmd[0]).name} ended with {failed.returncode}"
        sys.exit(print(f"error: {what}; see the lines above", file=sys.stderr) or 3)
