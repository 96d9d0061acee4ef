# SPDX-License-Identifier: Apache-2.0
"""Error rates of the rules: the tables of docs/logbook/2026-11-22-error-rates-of-verdicts.md,
printed by `slambed papers rates`.

Rates of shares are exact sums over both binomials; the others are simulated with a fixed seed.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from slambed.papers.verdicts.contrasts import Step, judge_contrast
from slambed.papers.verdicts.means import decide, effects, margin_bound
from slambed.papers.verdicts.model import LEVEL, Share
from slambed.papers.verdicts.prediction import inside, share_positions
from slambed.papers.verdicts.shares import margin_of, rate
from slambed.papers.verdicts.statements import REDUCTION_MARGIN
from slambed.papers.verdicts.trends import cochran_armitage, fisher_rising, jonckheere

SEED = 20262
DRAWS = 4000
MANY_DRAWS = 40_000
PAPER_RUNS = 100
PAPER_SHARES = (0.0, 0.03, 0.36, 0.73, 1.0)
RUNS = (10, 30, 100, 300)
CONVENTIONAL = (0.78, 0.79, 0.82, 0.92, 1.0)
ENHANCED = (0.0, 0.02, 0.10, 0.48, 0.73)
"""DynNetSLAM, Table 2: the loss rates for which powers of orderings are computed."""


@dataclass(frozen=True)
class Rate:
    """One simulated chance, and the limit that it must meet."""

    what: str
    at: str
    chance: float
    limit: str = ""


def share_same(paper: float, runs: int) -> tuple[float, float]:
    """Returns P(reproduced), P(differs) if the true shares are equal."""
    return rate(paper, paper, runs, PAPER_RUNS)


def share_off(paper: float, runs: int) -> float:
    """Returns the larger P(reproduced) of the two true shares that are off by the margin."""
    margin = margin_of(Share(round(paper * PAPER_RUNS), PAPER_RUNS))
    off = [p for p in (paper - margin, paper + margin) if 0 <= p <= 1]
    return max(rate(p, paper, runs, PAPER_RUNS, lambda _: margin)[0] for p in off)


def mean_same(ratio: float, runs: int, paper_runs: int, cv: float, margin: float) -> float:
    """Returns P(reproduced) of normal means with this true ratio."""
    generator = np.random.default_rng(SEED)
    a = generator.normal(ratio, cv * ratio, (DRAWS, runs))
    b = generator.normal(1.0, cv, (DRAWS, paper_runs))
    found = effects(
        a.mean(1), a.std(1, ddof=1), runs, b.mean(1), b.std(1, ddof=1), paper_runs, "ratio"
    )
    return float(decide(*found, margin_bound(margin, "ratio"))[0].mean())


def reduction_same(true: float, stated: float, runs: int, cv: float) -> float:
    """Returns P(reproduced) of a stated reduction; the statement has no spread of its own."""
    generator = np.random.default_rng(SEED)
    before = generator.normal(1.0, cv, (DRAWS, runs))
    after = generator.normal(1 - true, cv * (1 - true), (DRAWS, runs))
    value, se, df = effects(
        after.mean(1),
        after.std(1, ddof=1),
        runs,
        before.mean(1),
        before.std(1, ddof=1),
        runs,
        "ratio",
    )
    bound = margin_bound(REDUCTION_MARGIN, "ratio")
    return float(decide(value - np.log1p(-stated), se, df, bound)[0].mean())


def trend_rate(true: tuple[float, ...], runs: int) -> float:
    """Returns P(a trend of shares passes) for these true shares."""
    generator = np.random.default_rng(SEED)
    bad = generator.binomial(runs, true, (MANY_DRAWS, len(true)))
    return float((cochran_armitage(bad, np.full_like(bad, runs)) <= LEVEL).mean())


def values_trend_rate(means: tuple[float, ...], runs: int, draws: int = 1000) -> float:
    """Returns P(a trend of values passes): Jonckheere-Terpstra, standard deviation 1."""
    generator = np.random.default_rng(SEED)
    found = [
        jonckheere([generator.normal(m, 1.0, runs) for m in means]) <= LEVEL for _ in range(draws)
    ]
    return float(np.mean(found))


def conjunction_rate(low: tuple[float, ...], high: tuple[float, ...], runs: int) -> float:
    """Returns P(every pair passes Fisher's test at 5 %): an intersection-union test."""
    generator = np.random.default_rng(SEED)
    a = generator.binomial(runs, low, (DRAWS, len(low)))
    b = generator.binomial(runs, high, (DRAWS, len(high)))
    return float((fisher_rising(a, runs, b, runs) <= LEVEL).all(axis=1).mean())


def reversal_rate(low: tuple[float, ...], high: tuple[float, ...], runs: int) -> float:
    """Returns P(any opposite test passes after Holm) for these true shares."""
    generator = np.random.default_rng(SEED)
    a = generator.binomial(runs, low, (DRAWS, len(low)))
    b = generator.binomial(runs, high, (DRAWS, len(high)))
    return float((fisher_rising(b, runs, a, runs).min(axis=1) <= LEVEL / len(low)).mean())


def prediction_cover(true: float, runs: int) -> float:
    """Returns P(published count inside our 95 % prediction interval) if both have the same true
    share."""
    generator = np.random.default_rng(SEED)
    ours = generator.binomial(runs, true, DRAWS)
    paper = generator.binomial(PAPER_RUNS, true, DRAWS)
    positions = share_positions(ours, runs, paper, PAPER_RUNS)
    return float(np.mean([inside(p) for p in positions]))


def prediction_cover_overall(runs: int) -> float:
    """Returns `prediction_cover` averaged over uniformly distributed true shares."""
    generator = np.random.default_rng(SEED)
    true = generator.uniform(0, 1, DRAWS)
    positions = share_positions(
        generator.binomial(runs, true), runs, generator.binomial(PAPER_RUNS, true), PAPER_RUNS
    )
    return float(np.mean([inside(p) for p in positions]))


def mean_prediction_cover(runs: int, paper_runs: int) -> float:
    """Returns P(published mean inside our 95 % prediction interval) for normal values with the same
    true mean."""
    generator = np.random.default_rng(SEED)
    a = generator.normal(1, 0.2, (DRAWS, runs))
    b = generator.normal(1, 0.2, (DRAWS, paper_runs)).mean(1)
    z = (b - a.mean(1)) / (a.std(1, ddof=1) * np.sqrt(1 / runs + 1 / paper_runs))
    return float(np.mean([inside(p) for p in stats.t.cdf(z, runs - 1)]))


def one_contrast(low: float, high: float, runs: int, draws: int = 500) -> dict[str, float]:
    """Returns the share of each outcome of a declared pair that the paper shows, for these true
    shares of ours."""
    generator = np.random.default_rng(SEED)
    paper = (Share(0, PAPER_RUNS), Share(50, PAPER_RUNS))
    found: dict[str, float] = {}
    for a, b in generator.binomial(runs, (low, high), (draws, 2)):
        step = Step((Share(int(a), runs), Share(int(b), runs)), paper)
        outcome = judge_contrast([step], 0.0).outcome
        found[outcome] = found.get(outcome, 0.0) + 1 / draws
    return found


def rates() -> list[Rate]:
    """Returns all rates except those of shares, in the order of the rules."""
    found: list[Rate] = []
    for runs, paper_runs in ((20, 20), (20, 5), (100, 100)):
        at = f"spread 20 %, ours of {runs}, paper's of {paper_runs}, margin 20 %"
        for ratio in (1.2, 1 / 1.2):
            chance = mean_same(ratio, runs, paper_runs, 0.2, 0.2)
            found.append(Rate(f"mean {ratio:.2f} times: reproduced", at, chance, "at most 0.06"))
        chance = mean_same(1.0, runs, paper_runs, 0.2, 0.2)
        found.append(Rate("mean equal: reproduced", at, chance))
    for true, limit in ((0.942, ""), (0.9227, "at most 0.06"), (0.9565, "at most 0.06")):
        chance = reduction_same(true, 0.942, 20, 0.3)
        at = f"true {true:.1%}, spread 30 %, 20 runs each"
        found.append(Rate("reduction of 94.2 %: reproduced", at, chance, limit))
    for runs in (10, 30, 100):
        none = trend_rate((0.3,) * 5, runs)
        found.append(
            Rate("no trend of shares: holds", f"30 % in all, {runs} runs", none, "at most 0.06")
        )
        flat = values_trend_rate((0.0,) * 4, runs)
        found.append(
            Rate("no trend of values: holds", f"4 cells, {runs} runs", flat, "at most 0.06")
        )
        equal = conjunction_rate(ENHANCED, ENHANCED, runs)
        found.append(Rate("no effect in 5 pairs: all hold", f"{runs} runs", equal, "0"))
        found.append(
            Rate(
                "reversed in 5 pairs: all hold",
                f"{runs} runs",
                conjunction_rate(CONVENTIONAL, ENHANCED, runs),
                "0",
            )
        )
        found.append(
            Rate(
                "no effect in 5 pairs: reversed",
                f"{runs} runs",
                reversal_rate(ENHANCED, ENHANCED, runs),
                "at most 0.06",
            )
        )
        found.append(
            Rate(
                "reversed in 5 pairs: reversed",
                f"{runs} runs",
                reversal_rate(CONVENTIONAL, ENHANCED, runs),
            )
        )
        found.append(
            Rate("Table 2, enhanced loses more: holds", f"{runs} runs", trend_rate(ENHANCED, runs))
        )
        found.append(
            Rate(
                "Table 2, conventional loses more: holds",
                f"{runs} runs",
                trend_rate(CONVENTIONAL, runs),
            )
        )
        all_five = conjunction_rate(ENHANCED, CONVENTIONAL, runs)
        what = "Table 2, conventional above enhanced at all RTTs: holds"
        found.append(Rate(what, f"{runs} runs", all_five))
    for runs in (30, 100, 300):
        found.append(
            Rate(
                "published count predicted",
                f"any share, {runs} runs",
                prediction_cover_overall(runs),
                "0.93 to 0.98",
            )
        )
    for runs, paper_runs in ((20, 20), (100, 5)):
        found.append(
            Rate(
                "published mean predicted",
                f"{runs} runs, paper's of {paper_runs}",
                mean_prediction_cover(runs, paper_runs),
                "0.93 to 0.98",
            )
        )
    return found


def rates_markdown() -> str:
    lines = [
        "| share in the paper (of 100), margin | runs of ours | off by the margin: reproduced (at "
        "most 0.06) | equal: reproduced | equal: differs (at most 0.06) |",
        "|---|---:|---:|---:|---:|",
    ]
    for paper in PAPER_SHARES:
        margin = 100 * margin_of(Share(round(paper * PAPER_RUNS), PAPER_RUNS))
        for runs in RUNS:
            same, differs = share_same(paper, runs)
            off = share_off(paper, runs)
            where = f"{paper:.0%}, {margin:.0f} points"
            lines.append(f"| {where} | {runs} | {off:.3f} | {same:.3f} | {differs:.3f} |")
    lines += ["", "| chance of | at | chance | limit |", "|---|---|---:|---|"]
    lines += [f"| {r.what} | {r.at} | {r.chance:.3f} | {r.limit} |" for r in rates()]
    return "\n".join(lines)
