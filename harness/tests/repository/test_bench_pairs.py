# SPDX-License-Identifier: Apache-2.0
"""Simulated benchmarks against a reference: what is called slower, and how rarely wrongly."""

import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from checkout import needs_git

from slambed.native import repository_root

TOOLS = repository_root() / "tools"
PAIRS = runpy.run_path(str(TOOLS / "bench_pairs.py"))
BENCHMARKS = [f"stages_bench/Stage{n}" for n in range(60)]
LIMIT = 0.05


class Host:
    """Times of both sides with 3 % noise each and a common drift that is far larger."""

    def __init__(self, seed: int, slower: dict[str, float]) -> None:
        self.random, self.slower = np.random.default_rng(seed), slower

    def measure(self, names: list[str], rounds: int) -> list[tuple[dict, dict]]:
        pairs = []
        for _ in range(rounds):
            mood = np.exp(self.random.normal(0, 0.2))
            noise = np.exp(self.random.normal(0, 0.03, (len(names), 2)))
            base = {name: 100 * mood * noise[n, 0] for n, name in enumerate(names)}
            now = {
                name: 100 * mood * noise[n, 1] * self.slower.get(name, 1)
                for n, name in enumerate(names)
            }
            pairs.append((base, now))
        return pairs


def called_slower(seed: int, slower: dict[str, float]) -> list[str]:
    found = PAIRS["compare"](BENCHMARKS, Host(seed, slower).measure, 7, LIMIT)
    assert len(found) == len(BENCHMARKS)
    return [one.name for one in found if one.verdict == "slower"]


def test_no_change_is_hardly_ever_called_slower() -> None:
    assert sum(bool(called_slower(seed, {})) for seed in range(100)) <= 1


def test_ten_percent_of_one_stage_are_found_and_named() -> None:
    stage = BENCHMARKS[17]
    named = [called_slower(seed, {stage: 1.1}) for seed in range(40)]
    assert all(names in ([], [stage]) for names in named)
    assert sum(names == [stage] for names in named) >= 28


def test_two_percent_are_not_found() -> None:
    assert not any(called_slower(seed, {BENCHMARKS[17]: 1.02}) for seed in range(40))


def test_signed_ranks_have_the_chances_of_the_tables() -> None:
    assert PAIRS["tail"](5, 0) == 1 / 32
    assert PAIRS["tail"](7, 2) == 3 / 128
    assert PAIRS["tail"](10, 8) == 25 / 1024


def test_too_few_pairs_say_how_many_more() -> None:
    one = PAIRS["judge"]("a/b", [100.0] * 3, [130.0] * 3, LIMIT, 0.05)
    assert (one.verdict, one.more_pairs) == ("inconclusive", 3)
    assert "inconclusive: 3 more |" in PAIRS["table"]([one])[-1]


def test_the_order_alternates_and_a_lonely_benchmark_is_reported() -> None:
    assert PAIRS["alternating"](4) == [True, False, True, False]
    assert PAIRS["only_one_side"](["a", "b"], ["b", "c"]) == [
        "only now: c",
        "only in the yardstick: a",
    ]


def test_the_newest_other_commit_is_the_yardstick(tmp_path: Path) -> None:
    history = tmp_path / "history.jsonl"
    assert PAIRS["read_history"](history) == []
    rows = [
        {"commit": commit, "benchmark": "a/b", "date": "2026-01-01"}
        for commit in ("one", "two", "two-changed", "three")
    ]
    PAIRS["append_history"](history, rows)
    assert PAIRS["newest_other"](PAIRS["read_history"](history), "three") == "two"
    assert PAIRS["newest_other"](rows[3:], "three") is None


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--history", "HISTORY"], "line 2 is not a measurement"),
        (["--filter", "("], "regular expression"),
        (["--rounds", "0"], "must be above 0"),
        pytest.param(["no-such-commit"], "not a commit", marks=needs_git),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, options: list[str], expected: str) -> None:
    history = tmp_path / "history.jsonl"
    history.write_text('{"commit": "a", "benchmark": "b", "date": "c"}\n{"half\n')
    command = [sys.executable, str(TOOLS / "bench_against.py")]
    if "no-such-commit" in options:
        history.unlink()
        options = [*options, "--history", "HISTORY"]
    command += [str(history) if option == "HISTORY" else option for option in options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: ") and expected in done.stderr
