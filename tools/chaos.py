# SPDX-License-Identifier: Apache-2.0
"""Plays campaigns of short runs with injected faults, until N faults have struck.

docs/how-to/run-sanitizers-and-fuzzers.md has examples.

    tools/chaos.py virtual|dask|live|docker --faults N [--seed N] [--jobs 2,8,32] [--clock]
        [--user root|other|both] [--log FILE]
    tools/chaos.py table FILE ...

Every campaign is one line in the log with its seed and result; `table` counts them. Exit status 1
if a campaign had problems.
"""

import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "harness" / "tests"))

from chaos_campaign import Outcome, Torment  # noqa: E402
from chaos_place import Place  # noqa: E402

from slambed.campaign.manifest import git_state  # noqa: E402

FAULTS_EACH = {"virtual": 50, "dask": 10, "live": 10, "docker": 14}
EVERY_S = {"virtual": 0.2, "dask": 1.5, "live": 2.0, "docker": 2.0}
DRAW_EVERY = 8
"""One in so many campaigns draws figures, which takes longer than its runs."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    commands = parser.add_subparsers(dest="kind", required=True)
    for kind in FAULTS_EACH:
        one = commands.add_parser(kind)
        one.add_argument("--faults", type=int, default=100)
        one.add_argument("--seed", type=int, default=1, help="of the first campaign")
        one.add_argument("--jobs", default="2,8,32", help="one after the other")
        one.add_argument("--runs", type=int, default=0, help="of a cell of each campaign")
        one.add_argument(
            "--each", type=int, default=FAULTS_EACH[kind], help="of a campaign at most"
        )
        one.add_argument("--only", default="", help="faults as they are reported, a comma list")
        one.add_argument("--clock", action="store_true", help="the host's clock may jump as well")
        one.add_argument(
            "--user",
            choices=("root", "other", "both"),
            default="both",
            help="who calls the command on engine docker",
        )
        one.add_argument("--log", type=Path)
    commands.add_parser("table").add_argument("files", type=Path, nargs="+")
    asked = parser.parse_args()
    if asked.kind == "table":
        return table(asked.files)
    with tempfile.TemporaryDirectory(prefix="slambed-chaos-") as folder:
        return torment_all(asked, Path(folder))


def torment_all(asked: argparse.Namespace, folder: Path) -> int:
    place = Place(folder, asked.kind, asked.runs)
    try:
        return _torment_all(asked, place)
    finally:
        place.close()


def _torment_all(asked: argparse.Namespace, place: Place) -> int:
    jobs = [int(number) for number in asked.jobs.split(",")]
    struck = bad = 0
    seed = asked.seed
    only = tuple(filter(None, asked.only.split(",")))
    while struck < asked.faults:
        other = asked.kind == "docker" and (
            asked.user == "other" or (asked.user == "both" and seed % 2)
        )
        torment = Torment(
            asked.kind,
            seed,
            jobs[seed % len(jobs)],
            asked.each,
            EVERY_S[asked.kind],
            seed % DRAW_EVERY == 0,
            only,
            asked.clock,
            bool(other),
        )
        outcome = place.play(torment)
        struck += len(outcome.struck)
        bad += bool(outcome.problems)
        show(outcome, struck, asked.log)
        seed += 1
    print(f"chaos: {struck} faults in {seed - asked.seed} campaigns, {bad} not as they must be")
    return 1 if bad else 0


def show(outcome: Outcome, struck: int, log: Path | None) -> None:
    t = outcome.torment
    print(
        f"{t.kind} seed {t.seed}, {t.jobs} jobs: {len(outcome.struck)} faults ({struck} in all), "
        f"{len(outcome.calls)} calls, {outcome.took_s} s, {len(outcome.problems)} problems",
        flush=True,
    )
    for problem in outcome.problems[:12]:
        print(f"  {problem}", flush=True)
    if log is not None:
        commit = (git_state()[0] or "")[:9]
        with log.open("a") as out:
            out.write(json.dumps({"commit": commit} | json.loads(outcome.line())) + "\n")


def table(files: list[Path]) -> int:
    """Prints a table of faults per kind of campaign, and the campaigns with problems."""
    lines = [json.loads(line) for file in files for line in file.read_text().splitlines()]
    kinds = sorted({line["torment"]["kind"] for line in lines})
    counts = {
        kind: Counter(f for x in lines if x["torment"]["kind"] == kind for f in x["struck"])
        for kind in kinds
    }
    print("| fault |" + "".join(f" {kind} |" for kind in kinds))
    print("|---|" + "---:|" * len(kinds))
    for fault in sorted({fault for counted in counts.values() for fault in counted}):
        print(f"| {fault} |" + "".join(f" {counts[kind][fault] or ''} |" for kind in kinds))
    print("| faults |" + "".join(f" {counts[kind].total()} |" for kind in kinds))
    for word, of in (
        ("campaigns", lambda x: 1),
        ("calls of the command", lambda x: len(x["calls"])),
        ("campaigns not as they must be", lambda x: bool(x["problems"])),
    ):
        sums = (sum(of(x) for x in lines if x["torment"]["kind"] == kind) for kind in kinds)
        print(f"| {word} |" + "".join(f" {number} |" for number in sums))
    return 0


if __name__ == "__main__":
    sys.exit(main())
