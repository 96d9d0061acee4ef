# SPDX-License-Identifier: Apache-2.0
"""Tests between the systems of an experiment: its own metrics, paired where seeds pair the runs."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.metrics.catalog import keys_for
from slambed.metrics.comparison import (
    USUAL_ALPHA,
    fisher,
    holm,
    least_p,
    mann_whitney,
    mcnemar,
    runs_to_show,
    signed_rank,
)
from slambed.metrics.metric import Metric, Use
from slambed.metrics.statistics import finite
from slambed.report.cells import metrics_asked, text
from slambed.report.load import Results
from slambed.report.tables import Table
from slambed.spec.device import VIRTUAL

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Difference:
    """One metric of one system against the baseline system, under equal conditions."""

    dataset: str
    profile: str
    metric: Metric
    baseline: str
    other: str
    baseline_value: float
    other_value: float
    effect: str
    p_value: float
    """Adjusted for all comparisons of the experiment (Holm)."""
    runs: int
    """Pairs, or the runs of the smaller side."""
    paired: bool
    possible: bool = True
    """Whether this many runs could have shown any difference among so many comparisons."""

    @property
    def verdict(self) -> str:
        """In words; equality is never claimed."""
        if self.p_value > USUAL_ALPHA:
            return "no difference shown" if self.possible else "too few runs to show any"
        rises = self.other_value > self.baseline_value
        if self.metric.better == "neither" or self.other_value == self.baseline_value:
            return "different"
        return "better" if rises == (self.metric.better == "higher") else "worse"


@dataclass(frozen=True)
class _Test:
    """What one test says: values of both sides, the effect in words, p, runs or pairs."""

    baseline: float
    other: float
    effect: str
    p_value: float
    runs: int
    paired: bool


def differences(results: Results, baseline: str | None = None) -> list[Difference]:
    """Every system against the first one (or `baseline`) with the same dataset and profile."""
    runs = results.trusted
    if not len(runs):
        return []
    numbers = results.numbers()
    asked = [key for key in metrics_asked(results) if key in numbers]
    metrics = [results.metric(key) for key in asked or keys_for(Use.TESTED)]
    found: list[Difference] = []
    # An engine is compared with itself: live and virtual numbers are different things.
    for (engine, dataset, profile), group in runs.groupby(
        ["engine", "dataset", "profile"], sort=False, dropna=False
    ):
        labels = list(dict.fromkeys(runs["label"][runs["engine"].astype(str) == str(engine)]))
        first = baseline if baseline is not None and baseline in labels else str(labels[0])
        base = group[group["label"] == first]
        for label in labels:
            other = group[group["label"] == label]
            if label == first or not len(base) or not len(other):
                continue
            for item in metrics:
                if (test := _test(base, other, item)) is None:
                    continue
                found.append(
                    Difference(
                        text(dataset), text(profile) or "no link", item, first, str(label),
                        test.baseline, test.other, test.effect, test.p_value, test.runs,
                        test.paired,
                    )
                )  # fmt: skip
    if not found:
        return []
    adjusted = holm([item.p_value for item in found])
    return [
        replace(d, p_value=float(p), possible=least_p(d.runs, d.paired) * len(found) <= USUAL_ALPHA)
        for d, p in zip(found, adjusted, strict=True)
    ]


def paired_by_seed(
    base: pd.DataFrame, other: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """The runs of either side that share a seed, in equal order; None where seeds pair nothing.

    Only in virtual time does a seed decide what happens to a run: live runs of equal seed are no
    more alike than others, and are compared unpaired.
    """
    both = pd.concat([base["engine"], other["engine"]])
    if not both.eq(VIRTUAL).all() or base["seed"].isna().any() or other["seed"].isna().any():
        return None
    if base["seed"].duplicated().any() or other["seed"].duplicated().any():
        return None
    shared = sorted(set(base["seed"]) & set(other["seed"]))
    if len(shared) < 2:
        return None
    return base.set_index("seed").loc[shared], other.set_index("seed").loc[shared]


def _test(base: pd.DataFrame, other: pd.DataFrame, item: Metric) -> _Test | None:
    if item.key not in base or item.key not in other:
        return None
    pairs = paired_by_seed(base, other)
    if pairs is not None:
        a, b = (_floats(side[item.key]) for side in pairs)
        measured = ~(np.isnan(a) | np.isnan(b))
        return _paired(a[measured], b[measured], item)
    return _unpaired(finite(base[item.key].to_numpy()), finite(other[item.key].to_numpy()), item)


def _paired(a: Floats, b: Floats, item: Metric) -> _Test | None:
    if len(a) < 2:
        return None
    if item.kind == "share":
        bad_a, bad_b = a > 0, b > 0
        effect = _points(bad_b.mean() - bad_a.mean())
        p_value = mcnemar(bad_a, bad_b)
        return _Test(float(bad_a.mean()), float(bad_b.mean()), effect, p_value, len(a), True)
    effect = f"higher in {int((b > a).sum())} of {len(a)} pairs"
    middle_a, middle_b = float(np.median(a)), float(np.median(b))
    return _Test(middle_a, middle_b, effect, signed_rank(a, b), len(a), True)


def _unpaired(a: Floats, b: Floats, item: Metric) -> _Test | None:
    fewer = min(len(a), len(b))
    if fewer < 2:
        return None
    if item.kind == "share":
        bad_a, bad_b = int((a > 0).sum()), int((b > 0).sum())
        share_a, share_b = bad_a / len(a), bad_b / len(b)
        p_value = fisher(bad_a, len(a), bad_b, len(b))
        return _Test(share_a, share_b, _points(share_b - share_a), p_value, fewer, False)
    test = mann_whitney(a, b)
    p_value = 1.0 if np.isnan(test.p_value) else test.p_value
    effect = f"delta {test.cliffs_delta:+.2f} ({test.size})"
    return _Test(float(np.median(a)), float(np.median(b)), effect, p_value, fewer, False)


def _floats(column: pd.Series) -> Floats:
    return pd.to_numeric(column.astype(object), errors="coerce").to_numpy(np.float64)


def _points(share: float) -> str:
    return f"{100 * share:+.0f} points"


def difference_table(found: list[Difference]) -> Table:
    """Every tested difference, the shown ones first; the caption says what the runs could show."""
    rows = [
        [
            d.dataset, d.profile, d.metric.heading, d.baseline, d.other,
            d.metric.show(d.baseline_value), d.metric.show(d.other_value),
            d.effect, f"{d.runs}{' pairs' if d.paired else ''}", f"{d.p_value:.2g}", d.verdict,
        ]
        for d in sorted(found, key=lambda d: d.p_value)
    ]  # fmt: skip
    headings = [
        "dataset", "link", "metric", "baseline", "other", "baseline value", "other value",
        "effect", "runs", "p (Holm)", "verdict",
    ]  # fmt: skip
    caption = (
        "Differences between systems under equal conditions. Virtual runs are paired by their seed "
        "(Wilcoxon's signed-rank test, shares McNemar's exact test), live runs are not "
        "(Mann-Whitney's test with Cliff's delta, shares Fisher's exact test)"
    )
    return Table("differences", caption + _power(found), headings, rows, words=5)


def _power(found: list[Difference]) -> str:
    """How many runs the comparisons that could show nothing would have needed."""
    blind = [d for d in found if not d.possible]
    if not blind:
        return ""
    needed = max(runs_to_show(len(found), d.paired) for d in blind)
    fewest = min(d.runs for d in blind)
    return (
        f". With {fewest} runs {len(blind)} of these {len(found)} comparisons could show no "
        f"difference, however large; from {needed} runs per cell on they can"
    )
