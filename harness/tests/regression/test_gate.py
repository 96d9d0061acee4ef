# SPDX-License-Identifier: Apache-2.0
"""The regression gate over simulated nights: its false alarms, misses and errors."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from command_line import refused, slambed

from slambed.errors import SlambedError
from slambed.metrics.catalog import metric
from slambed.metrics.comparison import holm
from slambed.metrics.robust_accuracy import LEAST_COVERAGE
from slambed.native import repository_root
from slambed.regression import nights
from slambed.regression.gate import ALPHA, append_history, is_relevant, judge, read_runs
from slambed.regression.nights import worsening_p

NIGHTS, CELLS, RUNS = 1000, 6, 10
# Relative spread of one run per metric on a quiet host.
NOISE = {"ate_rmse_m": 0.08, "track_ms_median": 0.06, "mobile_cpu_percent_mean": 0.03,
         "mobile_mem_mb_peak": 0.02, "update_computed_ms_median": 0.10}  # fmt: skip
TYPICAL = {"ate_rmse_m": 0.02, "track_ms_median": 30.0, "mobile_cpu_percent_mean": 60.0,
           "mobile_mem_mb_peak": 150.0, "update_computed_ms_median": 300.0}  # fmt: skip


def nights_with_alarm(worse: dict[str, float], seed: int, runs: int = RUNS) -> float:
    """Returns the share of simulated nights that raise an alarm. `worse`: factor on the first
    cell's metrics.

    Every night draws its own baseline; Holm covers all tests of a night.
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
    """Returns two cells as in summary.csv; `changed` replaces columns of the first cell."""
    rows = []
    for cell in ("alone/room/none", "offloaded/room/ramp"):
        for repetition in range(runs):
            row = {
                "cell": cell,
                "repetition": repetition,
                "experiment": "x",
                "run_key": f"{cell}{repetition}",
                "valid": True,
                "not_completed": False,
                "lost": bool(rng.random() < 0.05),
                "coverage": 0.99 + 0.001 * rng.random(),
            } | {key: TYPICAL[key] * rng.lognormal(0, NOISE[key]) for key in NOISE}
            if cell.startswith("alone"):
                row |= {k: v(repetition) if callable(v) else v for k, v in changed.items()}
            row["failed"] = row["coverage"] < LEAST_COVERAGE
            rows.append(row)
    return pd.DataFrame(rows)


def test_a_quiet_night_passes() -> None:
    rng = np.random.default_rng(5)
    result = judge(some_runs(rng), some_runs(rng))
    assert result.passed
    assert len(result.findings) == 2 * (len(NOISE) + 3)


def test_more_track_losses_are_reported_even_if_survivors_look_better() -> None:
    rng = np.random.default_rng(6)
    half = {"lost": lambda i: i % 2 == 0, "coverage": lambda i: 0.3 if i % 2 == 0 else 1.0}
    tonight = some_runs(rng, 30, ate_rmse_m=0.015, **half)
    result = judge(some_runs(rng, 30), tonight)
    message = " ".join(result.failures)
    assert "alone/room/none: runs with a track loss" in message
    assert "offloaded" not in message


def test_failed_runs_are_reported_whatever_the_survivors_ate() -> None:
    rng = np.random.default_rng(7)
    tonight = some_runs(rng, 20, coverage=lambda i: 0.2 if i < 14 else 1.0, ate_rmse_m=0.015)
    failures = " ".join(judge(some_runs(rng, 20), tonight).failures)
    assert "alone/room/none: runs that tracked less than 90 % 0 -> 70 %" in failures


def test_where_every_run_of_both_nights_failed_what_was_tracked_is_compared() -> None:
    """As on a sequence with a covered lens: all ranks would be equal."""
    rng = np.random.default_rng(8)
    covered = {"coverage": 0.5, "lost": True}
    before = some_runs(rng, 12, **covered)
    assert judge(before, some_runs(rng, 12, **covered)).passed
    worse = judge(before, some_runs(rng, 12, ate_rmse_m=0.5, **covered)).failures
    assert len(worse) == 1 and "alone/room/none: ATE RMSE" in worse[0]


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
        (
            lambda runs: runs.assign(valid=[i % 2 == 0 for i in range(len(runs))]),
            "invalid",
        ),
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
    code, out, err = slambed(
        "gate",
        "x",
        "--baseline",
        str(tmp_path / "baseline"),
        "--results",
        str(tmp_path / "results"),
    )
    assert code == 1 and "regression gate closed" in err
    assert "nothing was measured tonight" in out
    assert "baseline has no valid run" in out


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


def test_a_history_holds_experiments_whose_columns_differ(tmp_path: Path) -> None:
    """Only one experiment has the parameter; the third night has the first loop and reason."""
    history = tmp_path / "runs.parquet"
    rng = np.random.default_rng(13)
    for night, loop_s in (("2026-01-01", None), ("2026-01-02", None), ("2026-01-03", 4.5)):
        first, other = some_runs(rng), some_runs(rng).assign(experiment="y")
        first["params.contention"] = [None, False, True] * 8
        first["outcome_reason"] = ["edge gone" if loop_s else None, None] * 12
        first["load_reason"] = None
        append_history(history, first.assign(first_loop_s=loop_s), night, True)
        assert pd.read_parquet(history)["load_reason"].dtype == object
        append_history(history, other, night, True)
    stored = pd.read_parquet(history)
    assert list(stored["params.contention"].value_counts(dropna=False)) == [96, 24, 24]
    assert list(stored["outcome_reason"].dropna()) == ["edge gone"] * 12
    assert list(stored["first_loop_s"].dropna()) == [4.5] * 24
    assert stored["load_reason"].isna().all()
    assert judge(read_runs(history, "x")[0], some_runs(rng)).passed


def virtual_night(runs: int = 6, seed: int = 20, **changed: object) -> pd.DataFrame:
    """Returns virtual runs like `some_runs`: a program makes the same runs every night."""
    rows = some_runs(np.random.default_rng(seed), runs, **changed)
    return rows.assign(engine="virtual", seed=rows["repetition"], metrics_version="2")


def history_of(tmp_path: Path, nights: int, **changed: object) -> pd.DataFrame:
    path = tmp_path / "runs.parquet"
    for day in range(1, nights + 1):
        append_history(path, virtual_night(**changed), f"2026-02-{day:02}", True)
    return read_runs(path, "x")[0]


def test_identical_virtual_nights_count_once(tmp_path: Path) -> None:
    baseline = history_of(tmp_path, 20)
    assert len(baseline) == 240
    result = judge(baseline, virtual_night())
    assert result.passed
    assert {f.runs for f in result.findings} == {(6, 6)}
    assert {f.p_value for f in result.findings} == {1.0}


def test_what_every_seed_shows_raises_an_alarm(tmp_path: Path) -> None:
    slower = virtual_night(track_ms_median=lambda i: 40.0 + 0.1 * i)
    before = history_of(tmp_path, 20, track_ms_median=lambda i: 30.0 + 0.2 * i)
    failures = judge(before, slower).failures
    assert len(failures) == 1 and "tracking, median" in failures[0]
    assert "6 / 6 runs" in failures[0]


def test_the_newest_night_is_the_program_to_compare_with(tmp_path: Path) -> None:
    path = tmp_path / "runs.parquet"
    slow = {"track_ms_median": lambda i: 60.0 + i}
    append_history(path, virtual_night(**slow), "2026-02-01", True)
    append_history(path, virtual_night(), "2026-02-02", True)
    assert not judge(read_runs(path, "x")[0], virtual_night(**slow)).passed


def test_few_virtual_runs_are_said_to_be_blind_for_shares_only() -> None:
    night = virtual_night()
    (line, _) = judge(night, night).notes
    assert "can never raise an alarm about runs with a track loss, runs that tracked less" in line
    assert "tracking" not in line.split("about")[1].split(",")[0]
    assert "from 9 runs a night on" in line


def test_one_run_a_night_is_reported_how_many_would_do() -> None:
    """This also holds if the baseline has one run, which more runs tonight cannot compensate."""
    one = nights.Test("cell", metric("track_ms_median"), np.ones(1), np.ones(1), paired=False)
    assert one.runs_needed(0.01) == 5  # 1 / comb(10, 5) = 1 / 252
    assert one.runs_needed(1e-6) == 12  # 1 / comb(24, 12) = 1 / 2,704,156
    many = nights.Test("cell", metric("track_ms_median"), np.ones(50), np.ones(1), paired=False)
    assert many.runs_needed(0.01) == 2  # 1 / comb(52, 2) = 1 / 1,326


def test_a_new_cell_is_named_and_fails_when_it_measured_nothing() -> None:
    rng = np.random.default_rng(12)
    before, tonight = some_runs(rng), some_runs(rng)
    first = tonight["cell"].str.startswith("alone")
    before = before[~before["cell"].str.startswith("alone")]
    result = judge(before, tonight)
    assert result.passed
    message = "alone/room/none: new tonight, nothing to compare with (12 runs, 12 valid)"
    assert message in result.notes
    dead = judge(before, tonight.assign(valid=~first))
    assert dead.failures == [message.replace("12 valid", "0 valid")]


def test_what_an_accepted_night_lacks_is_not_missing(tmp_path: Path) -> None:
    rng, history = np.random.default_rng(12), tmp_path / "runs.parquet"
    for day in range(1, 4):
        append_history(history, some_runs(rng), f"2026-02-0{day}", True)
    less = some_runs(rng).drop(columns="mobile_mem_mb_peak")
    less = less[less["cell"].str.startswith("offloaded")]
    failures = judge(read_runs(history, "x")[0], less).failures
    assert len(failures) == 2 and all("accept one night with --first-night" in f for f in failures)
    append_history(history, less, "2026-02-04", True)  # accepted
    assert judge(read_runs(history, "x")[0], less).passed


def test_invalid_runs_of_one_of_many_cells_may_be_chance() -> None:
    """The chance of a false alarm is of all cells together."""
    rng = np.random.default_rng(12)
    before, tonight = some_runs(rng), some_runs(rng)
    first = tonight["cell"].str.startswith("alone") & (tonight["repetition"] < 7)
    few, one = tonight.assign(valid=~first), before["cell"].str.startswith("alone")
    many = [before.assign(cell=f"{n}/" + before["cell"]) for n in range(20)]
    assert any("runs invalid" in line for line in judge(before[one], few[one]).failures)
    assert judge(pd.concat([before, *many]), pd.concat([few, *many])).passed


def test_a_metric_that_is_new_tonight_is_named() -> None:
    rng = np.random.default_rng(13)
    result = judge(some_runs(rng).drop(columns="failed"), some_runs(rng))
    assert result.passed
    message = "alone/room/none: runs that tracked less than 90 % is new tonight, without a baseline"
    assert message in result.notes


def test_another_version_of_the_metrics_is_no_baseline() -> None:
    rng = np.random.default_rng(14)
    before, tonight = (some_runs(rng).assign(metrics_version=v) for v in ("1", "2"))
    result = judge(before, tonight)
    assert any("the baseline has no valid run" in line for line in result.failures)
    assert result.notes == ["24 runs of the baseline are of another metrics version, left out"]
    both = judge(pd.concat([before, tonight]), tonight)
    assert both.passed
    assert {f.runs for f in both.findings} == {(12, 12)}


def test_runs_of_other_experiments_are_none_of_this_one(tmp_path: Path) -> None:
    """`runs` of a results folder holds those of all experiments."""
    (tmp_path / "results" / "runs" / "0123456789abcdef").mkdir(parents=True)
    table, problems = read_runs(tmp_path / "results", "quikstart")
    assert table.empty and problems == [f"{tmp_path / 'results'}: no runs of quikstart in it"]
    history = tmp_path / "history.parquet"
    line = ("gate", "quikstart", "--first-night", "--results", str(tmp_path / "results"))
    code, out, _ = slambed(*line, "--history", str(history))
    assert code == 1 and "no runs of quikstart" in out and "FAIL: " in out
    assert not history.exists()


def test_a_baseline_in_csv_has_the_same_metrics_version(tmp_path: Path) -> None:
    tonight = some_runs(np.random.default_rng(5)).assign(metrics_version="9")
    tonight.to_csv(tmp_path / "summary.csv", index=False)
    baseline, _ = read_runs(tmp_path / "summary.csv")
    result = judge(baseline, tonight)
    assert result.passed and result.notes == []


def test_gated_metrics_of_a_system_in_a_file_are_judged(tmp_path: Path) -> None:
    file = tmp_path / "opencv_odometry" / "system.yaml"
    file.parent.mkdir()
    example = repository_root() / "examples" / "opencv_odometry" / "system.yaml"
    own = {"doc": "x", "event": "seen", "take": "count", "gated": True, "better": "higher"}
    file.write_text(example.read_text() + yaml.safe_dump({"metrics": {"seen_count": own}}))
    rng = np.random.default_rng(5)
    runs = some_runs(rng).assign(system="opencv_odometry", described=str(file), seen_count=3)
    result = judge(runs, runs)
    assert "seen_count" in {finding.metric.key for finding in result.findings}


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("runs.parquet", "x", "is no history of the regression gate"),
        ("runs.csv", "a,b\n1,2\n", "it has no column cell"),
        ("empty.csv", "", "is no history of the regression gate"),
    ],
)
def test_a_baseline_that_is_none_is_told_in_a_line(
    tmp_path: Path, name: str, content: str, reason: str
) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / name).write_text(content)
    line = ("gate", "x", "--results", str(tmp_path / "results"))
    assert reason in refused(2, *line, "--baseline", str(tmp_path / name))
    if name.endswith("parquet"):
        with pytest.raises(SlambedError, match=reason):
            append_history(tmp_path / name, virtual_night(), "2026-02-01", True)


@pytest.mark.parametrize("alpha", ["0", "-1", "0.6"])
def test_a_chance_that_is_none_is_refused(alpha: str) -> None:
    assert slambed("gate", "x", "--first-night", "--alpha", alpha)[0] == 2
