# SPDX-License-Identifier: Apache-2.0
"""Coverage of intervals and false alarm rates of tests by seeded simulation, compared with the
methods used before. Run as a program it prints the table of
docs/logbook/2026-11-22-statistics-simulated.md."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from slambed.metrics.catalog import metric
from slambed.metrics.changes import paired_share_change, share_change, shift
from slambed.metrics.comparison import holm, signed_rank
from slambed.metrics.statistics import Interval, interval
from slambed.papers.verdicts.means import Effect, decide, effects, margin_bound
from slambed.regression.gate import ALPHA, is_relevant
from slambed.regression.nights import paired_p, worsening_p

Floats = NDArray[np.float64]

SAMPLES = 600
MEANS = 1500  # samples of cheaper methods
VERDICTS = 20_000
MARGIN = 0.2
SKEW = 0.5  # of the log-normal distribution: errors and times in one cell
NIGHTS, CELLS, OLD_NIGHTS, RUNS = 200, 6, 30, 6
NOISE = {"ate_rmse_m": 0.08, "track_ms_median": 0.06, "update_computed_ms_median": 0.10}
TYPICAL = {"ate_rmse_m": 0.02, "track_ms_median": 30.0, "update_computed_ms_median": 300.0}
COMPARISONS, EXPERIMENTS = 12, 200


def before(sample: Floats, statistic: str) -> tuple[float, float]:
    """The percentile bootstrap."""
    draws = np.random.default_rng(3).integers(0, len(sample), (800, len(sample)))
    function = np.mean if statistic == "mean" else np.median
    spread = function(sample[draws], axis=1)
    low = float(np.quantile(spread, 0.025, method="lower"))
    return low, float(np.quantile(spread, 0.975, method="higher"))


def bca(sample: Floats, statistic: str) -> tuple[float, float]:
    """The bias-corrected and accelerated bootstrap, which was expected to improve means."""
    function = np.mean if statistic == "mean" else np.median
    found = stats.bootstrap((sample,), function, n_resamples=800, rng=np.random.default_rng(3))
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


def students(sample: Floats, statistic: str) -> tuple[float, float]:
    """The plain t interval of a mean, which a skewed sample distorts."""
    assert statistic == "mean"
    reach = float(stats.t.ppf(0.975, len(sample) - 1) * stats.sem(sample))
    return float(sample.mean()) - reach, float(sample.mean()) + reach


def now(sample: Floats, statistic: str) -> tuple[float, float]:
    """The interval of a median in reports, and of a mean in verdicts: t on the logarithm."""
    if statistic == "median":
        found = interval(sample)
        return found.low, found.high
    mean, sd = float(sample.mean()), float(sample.std(ddof=1))
    value, se, df = effects(mean, sd, len(sample), 1.0, 0.0, 1, "ratio")
    low, high = Effect(float(value), float(se), float(df)).interval(0.95)
    return float(np.exp(low)), float(np.exp(high))


def coverage(
    method: Callable[[Floats, str], tuple[float, float]],
    statistic: str,
    runs: int,
    skew: float = 0.0,
    samples: int = SAMPLES,
) -> float:
    """Share of samples whose interval contains the true value; normal, or log-normal with this
    skew."""
    rng = np.random.default_rng(1)
    drawn = rng.lognormal(0, skew, (samples, runs)) if skew else rng.normal(5, 1, (samples, runs))
    truth = (np.exp(skew**2 / 2) if statistic == "mean" else 1.0) if skew else 5.0
    ends = np.array([method(sample, statistic) for sample in drawn])
    return float(np.mean((ends[:, 0] <= truth) & (truth <= ends[:, 1])))


def reproduced_off_by_margin(skew: float, runs: int, paper_runs: int, log: bool) -> float:
    """Share of published means judged as reproduced although ours is off by the margin of 20 %,
    the larger of both directions; log-normal runs. Without `log`: Welch's t of the difference."""
    rng = np.random.default_rng(7)
    found = []
    for factor in (1 + MARGIN, 1 / (1 + MARGIN)):
        ours = factor * rng.lognormal(0, skew, (VERDICTS, runs))
        paper = rng.lognormal(0, skew, (VERDICTS, paper_runs))
        parts = [(x.mean(1), x.std(1, ddof=1), x.shape[1]) for x in (ours, paper)]
        value, se, df = effects(*parts[0], *parts[1], "ratio" if log else "difference")
        if log:
            same, _ = decide(value, se, df, margin_bound(MARGIN, "ratio"))
        else:
            half, mean = se * stats.t.ppf(0.95, df), parts[1][0]
            low, high = mean / (1 + MARGIN) - mean, mean * MARGIN
            same = (value - half > low) & (value + half < high)
        found.append(float(np.mean(same)))
    return max(found)


Change = Callable[[Floats, Floats], Interval]


def resampled_shift(a: Floats, b: Floats) -> Interval:
    """The percentile bootstrap of the difference of the medians."""
    rng = np.random.default_rng(3)
    rows, columns = (rng.integers(len(x), size=(500, len(x))) for x in (a, b))
    drawn = np.median(b[columns], axis=1) - np.median(a[rows], axis=1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return Interval(float(np.median(b) - np.median(a)), float(low), float(high), len(a))


def resampled_share(a: Floats, b: Floats) -> Interval:
    """The percentile bootstrap of the difference of two shares."""
    rng = np.random.default_rng(3)
    rows, columns = (rng.integers(len(x), size=(500, len(x))) for x in (a, b))
    low, high = np.quantile(b[columns].mean(1) - a[rows].mean(1), [0.025, 0.975])
    return Interval(float(b.mean() - a.mean()), float(low), float(high), len(a))


def coverage_of_shift(method: Change, runs: int, shifted: float = 0.5) -> float:
    """Share of pairs of folders whose interval contains the true shift; log-normal runs."""
    rng = np.random.default_rng(8)
    drawn = rng.lognormal(0, SKEW, (SAMPLES, 2, runs))
    found = [method(a, b + shifted) for a, b in drawn]
    return float(np.mean([change.low <= shifted <= change.high for change in found]))


def coverage_of_share(
    method: Change, runs: int, a_share: float, b_share: float, alike: float = 0.0
) -> float:
    """The same for two shares; a share `alike` of the runs depends only on the seed in both
    folders."""
    rng = np.random.default_rng(9)
    shape = (SAMPLES, runs)
    seeds, others = rng.random(shape), rng.random(shape)
    a = (seeds < a_share).astype(np.float64)
    b = (np.where(rng.random(shape) < alike, seeds, others) < b_share).astype(np.float64)
    found = [method(x, y) for x, y in zip(a, b, strict=True)]
    return float(np.mean([c.low <= b_share - a_share <= c.high for c in found]))


def quiet_nights_with_alarm(copies_count: bool) -> float:
    """Share of quiet nights with an alarm: 30 earlier nights had the same runs, and tonight's
    program draws each one again. `copies_count`: each earlier night counts as independent."""
    rng = np.random.default_rng(4)
    shape = (NIGHTS, CELLS, RUNS)
    p_values, relevant = [], []
    for key, noise in NOISE.items():
        item = metric(key)
        baseline, tonight = (TYPICAL[key] * rng.lognormal(0, noise, shape) for _ in range(2))
        if copies_count:
            many = np.tile(baseline, OLD_NIGHTS)
            p_values.append(worsening_p(many, tonight, item.better))
        else:
            p_values.append(paired_p(baseline, tonight, item.better))
        relevant.append(is_relevant(baseline, tonight, item))
    p, big = np.concatenate(p_values, axis=1), np.concatenate(relevant, axis=1)
    adjusted = np.array([holm(row) for row in p])
    return float(np.mean(np.any((adjusted <= ALPHA) & big, axis=1)))


def nights_with_alarm(factor: float, runs: int = RUNS) -> float:
    """Share of virtual nights with an alarm if one cell's tracking takes `factor` times as long;
    seeds differ by 6 %, the same seed in two programs by 2 %."""
    rng = np.random.default_rng(5)
    item = metric("track_ms_median")
    seeds = TYPICAL[item.key] * rng.lognormal(0, 0.06, (NIGHTS, CELLS, runs))
    baseline, tonight = (seeds * rng.lognormal(0, 0.02, seeds.shape) for _ in range(2))
    tonight[:, 0] *= factor
    adjusted = np.array([holm(row) for row in paired_p(baseline, tonight, item.better)])
    alarms = (adjusted <= ALPHA) & is_relevant(baseline, tonight, item)
    return float(np.mean(np.any(alarms, axis=1)))


def experiments_with_difference(paired: bool, factor: float, runs: int = 12) -> float:
    """Share of experiments of 12 comparisons that show any difference, if runs of one seed share
    most of their error."""
    rng = np.random.default_rng(6)
    shown = 0
    for _ in range(EXPERIMENTS):
        seeds = rng.lognormal(0, 0.3, (COMPARISONS, runs))
        a, b = (seeds * rng.lognormal(0, 0.08, seeds.shape) for _ in range(2))
        b = factor * b
        tests = zip(a, b, strict=True)
        if paired:
            p = [signed_rank(x, y) for x, y in tests]
        else:
            p = [float(stats.mannwhitneyu(x, y).pvalue) for x, y in tests]
        shown += bool((holm(p) <= ALPHA).any())
    return shown / (EXPERIMENTS)


def table() -> str:
    """Returns the table as Markdown."""
    lines = ["| what, nominally | before | now |", "|---|---|---|"]
    for statistic, runs, skew in (
        ("median", 3, 0.0), ("median", 5, SKEW), ("median", 6, SKEW), ("median", 10, SKEW),
        ("mean", 5, 0.0), ("mean", 5, SKEW), ("mean", 10, SKEW), ("mean", 30, SKEW),
        ("mean", 10, 2 * SKEW), ("mean", 100, 2 * SKEW),
    ):  # fmt: skip
        kind = {0.0: "normal", SKEW: "skewed"}.get(skew, "strongly skewed")
        called = "95 % interval" if statistic == "mean" or runs >= 6 else "range"
        other = ""
        if statistic == "mean":
            straight = coverage(students, statistic, runs, skew, MEANS)
            other = (
                f" (BCa {coverage(bca, statistic, runs, skew, 200):.0%}, plain t {straight:.1%})"
            )
        lines.append(
            f"| {called} of a {statistic} of {runs} {kind} runs holds the true one (95 %) | "
            f"{coverage(before, statistic, runs, skew):.1%}{other} | "
            f"{coverage(now, statistic, runs, skew, MEANS if other else SAMPLES):.1%} |"
        )
    lines += [
        f"| verdicts: a mean off by its margin of 20 % is called reproduced, log-normal {skew}, "
        f"ours {runs} runs, the paper's {paper_runs} (at most 6 %) | "
        f"{reproduced_off_by_margin(skew, runs, paper_runs, False):.1%} (plain t) | "
        f"{reproduced_off_by_margin(skew, runs, paper_runs, True):.1%} |"
        for skew, runs, paper_runs in ((0.2, 20, 20), (SKEW, 100, 100), (SKEW, 300, 100))
    ]
    lines += [
        f"| gate: quiet virtual nights with an alarm, {OLD_NIGHTS} identical nights kept (at most "
        f"5 %) | {quiet_nights_with_alarm(True):.1%} | {quiet_nights_with_alarm(False):.1%} |",
        "| gate: virtual nights of 6 runs in which one of 6 cells tracks 15 % slower, found | - | "
        f"{nights_with_alarm(1.15):.1%} |",
        *(
            f"| diff: 95 % interval of a shift, {runs} against {runs} skewed runs, holds the true "
            f"one{' (range)' if runs < 4 else ''} | {coverage_of_shift(resampled_shift, runs):.1%} "
            f"| {coverage_of_shift(shift, runs):.1%} |"
            for runs in (3, 4, 6, 10, 30)
        ),
        *(
            f"| diff: the same of two shares, {a:.0%} and {b:.0%} of {runs} runs | "
            f"{coverage_of_share(resampled_share, runs, a, b):.1%} | "
            f"{coverage_of_share(share_change, runs, a, b):.1%} |"
            for runs, a, b in ((6, 0.3, 0.1), (10, 0.3, 0.1), (30, 0.1, 0.1), (30, 0.8, 0.5))
        ),
        *(
            f"| diff: the same, {a:.0%} and {b:.0%} of {runs} pairs of which 80% are alike | - | "
            f"{coverage_of_share(paired_share_change, runs, a, b, 0.8):.1%} |"
            for runs, a, b in ((10, 0.3, 0.1), (30, 0.8, 0.5))
        ),
        "| differences: experiments of 12 comparisons that show one where there is none (at most "
        f"5 %) | {experiments_with_difference(False, 1.0):.1%} | "
        f"{experiments_with_difference(True, 1.0):.1%} |",
        "| differences: 12 runs of paired seeds show one of 20 % | "
        f"{experiments_with_difference(False, 1.2):.1%} | "
        f"{experiments_with_difference(True, 1.2):.1%} |",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
