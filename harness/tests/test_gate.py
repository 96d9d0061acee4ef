# SPDX-License-Identifier: Apache-2.0
"""The gate over simulated nights: how often it cries wolf, what it misses, what it must refuse."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from slambed.metrics.comparison import holm
from slambed.report import cli
from slambed.report.catalog import metric
from slambed.report.gate import ALPHA, append_history, is_relevant, judge, read_runs, worsening_p

NIGHTS, CELLS, RUNS = 1000, 6, 10
# Metric and the spread of one run in a quiet lab (share of the value).
NOISE = {"ate_rmse_m": 0.08, "track_ms_median": 0.06, "mobile_cpu_percent_mean": 0.03,
         "mobile_mem_mb_peak": 0.02, "update_delay_ms_median": 0.10}  # fmt: skip
TYPICAL = {"ate_rmse_m": 0.02, "track_ms_median": 30.0, "mobile_cpu_percent_mean": 60.0,
           "mobile_mem_mb_peak": 150.0, "update_delay_ms_median": 300.0}  # fmt: skip


def nights_with_alarm(worse: dict[str, float], seed: int, runs: int = RUNS) -> float:
    """Share of simulated nights that raise an alarm. `worse`: factor on the first cell's metrics.

    Every night draws its own baseline: all tests of a night go through Holm together.
    """
    rng = np.random.default_rng(seed)
    p_values, relevant = [], []
    for key, noise in NOISE.items():
        item = metric(key)
        shape = (NIGHTS, CELLS, runs)
        # Log-normal: times and errors are skewed.
        baseline = TYPICAL[key] * rng.lognormal(0, noise, shape)
        tonight = TYPICAL[key] * rng.lognormal(0, noise, shape)
        tonight[:, 0] *= worse.get(key, 1.0)
        p_values.append(worsening_p(baseline, tonight, item.better))
        relevant.append(is_relevant(baseline, tonight, item))
    p, big = np.concatenate(p_values, axis=1), np.concatenate(relevant, axis=1)
    adjusted = np.array([holm(row) for row in p])
    return float(np.mean(np.any((adjusted <= ALPHA) & big, axis=1)))


def test_false_alarms_over_1000_quiet_nights() -> None:
    assert nights_with_alarm({}, seed=1) <= 0.05


@pytest.mark.parametrize(
    "worse", [{"ate_rmse_m": 1.5}, {"track_ms_median": 1.25}, {"mobile_cpu_percent_mean": 1.2}]
)
def test_few_real_worsenings_are_missed(worse: dict[str, float]) -> None:
    assert 1 - nights_with_alarm(worse, seed=2) <= 0.05


def test_too_small_to_matter_stays_silent() -> None:
    """Significant with many runs, but below the minimum effect of 10 %."""
    assert nights_with_alarm({"mobile_cpu_percent_mean": 1.04}, seed=3, runs=40) <= 0.05


def some_runs(rng: np.random.Generator, runs: int = 12, **changed: object) -> pd.DataFrame:
    """Two cells as summary.csv has them; `changed` replaces columns of the first cell."""
    rows = []
    for cell in ("alone/room/none", "offloaded/room/ramp"):
        for repetition in range(runs):
            row = {
                "cell": cell, "repetition": repetition, "experiment": "x",
                "run_key": f"{cell}{repetition}", "valid": True,
                "lost": bool(rng.random() < 0.05), "coverage": 0.99 + 0.001 * rng.random(),
            } | {key: TYPICAL[key] * rng.lognormal(0, NOISE[key]) for key in NOISE}  # fmt: skip
            if cell.startswith("alone"):
                row |= {k: v(repetition) if callable(v) else v for k, v in changed.items()}
            rows.append(row)
    return pd.DataFrame(rows)


def test_a_quiet_night_passes() -> None:
    rng = np.random.default_rng(5)
    result = judge(some_runs(rng), some_runs(rng))
    assert result.passed
    assert len(result.findings) == 2 * (len(NOISE) + 3)


def test_more_track_losses_are_told_even_if_survivors_look_better() -> None:
    rng = np.random.default_rng(6)
    half = {"lost": lambda i: i % 2 == 0, "coverage": lambda i: 0.3 if i % 2 == 0 else 1.0}
    tonight = some_runs(rng, 30, ate_rmse_m=0.015, **half)
    result = judge(some_runs(rng, 30), tonight)
    told = " ".join(result.failures)
    assert "alone/room/none: runs with a track loss" in told
    assert "offloaded" not in told


def test_failed_runs_are_told_whatever_the_survivors_ate() -> None:
    rng = np.random.default_rng(7)
    tonight = some_runs(rng, 20, coverage=lambda i: 0.2 if i < 14 else 1.0, ate_rmse_m=0.015)
    failures = " ".join(judge(some_runs(rng, 20), tonight).failures)
    assert "alone/room/none: runs that tracked less than 90 % 0 -> 70 %" in failures


def test_better_is_never_an_alarm() -> None:
    rng = np.random.default_rng(8)
    assert judge(some_runs(rng), some_runs(rng, track_ms_median=10.0, coverage=1.0)).passed


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda runs: runs.iloc[:0], "nothing was measured tonight"),
        (lambda runs: runs.assign(valid=False), "nothing was measured tonight"),
        (lambda runs: runs[~runs["cell"].str.startswith("alone")], "alone/room/none: nothing"),
        (lambda runs: runs.assign(ate_rmse_m=None), "ATE RMSE was not measured"),
        (lambda runs: runs.assign(valid=[i % 2 == 0 for i in range(len(runs))]), "runs not valid"),
    ],
)
def test_unmeasured_nights_fail(spoil, reason: str) -> None:
    rng = np.random.default_rng(9)
    result = judge(some_runs(rng, 20), spoil(some_runs(rng, 20)))
    assert not result.passed
    assert any(reason in line for line in result.failures)


def test_too_few_runs_are_said_to_be_blind() -> None:
    rng = np.random.default_rng(10)
    result = judge(some_runs(rng, 3), some_runs(rng, 3))
    assert any("can never raise an alarm" in line for line in result.notes)


def test_gate_on_an_empty_directory_fails(tmp_path: Path) -> None:
    (tmp_path / "results" / "x").mkdir(parents=True)
    (tmp_path / "baseline" / "x").mkdir(parents=True)
    result = CliRunner().invoke(
        cli.app,
        ["gate", "x", "--baseline", str(tmp_path / "baseline"), "--results",
         str(tmp_path / "results")],
    )  # fmt: skip
    assert result.exit_code != 0
    assert "nothing was measured tonight" in result.output
    assert "baseline has no valid run" in result.output


def test_history_keeps_nights_and_serves_as_baseline(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    history = tmp_path / "history" / "runs.parquet"
    assert append_history(history, some_runs(rng), "2026-01-01", True) == 24
    assert append_history(history, some_runs(rng), "2026-01-02", True) == 48
    assert append_history(history, some_runs(rng), "2026-01-02", True) == 48
    slow = some_runs(rng, track_ms_median=60.0)
    assert append_history(history, slow, "2026-01-03", False) == 72  # kept, but no baseline
    baseline, _ = read_runs(history, "x")
    assert len(baseline) == 48
    assert judge(baseline, some_runs(rng)).passed
    assert not judge(baseline, some_runs(rng, track_ms_median=60.0)).passed
