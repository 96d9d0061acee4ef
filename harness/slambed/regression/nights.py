# SPDX-License-Identifier: Apache-2.0
"""Selects what may be compared between two nights: which runs, which pairs, and which test."""

from dataclasses import dataclass
from itertools import count
from math import comb
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from slambed.metrics.comparison import fisher, mcnemar, rank_method, signed_rank
from slambed.metrics.metric import Metric
from slambed.metrics.statistics import finite
from slambed.report.contrast import paired_by_seed, values_to_rank
from slambed.spec.device import VIRTUAL

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Test:
    """One metric of a cell on both sides; if `paired`, run by run of equal seed."""

    cell: str
    metric: Metric
    baseline: Floats
    tonight: Floats
    paired: bool

    def p_value(self) -> float:
        """Returns the one-sided p value that tonight is worse."""
        a, b = self.baseline, self.tonight
        if self.metric.kind == "share":
            if self.paired:
                return mcnemar(a > 0, b > 0, "greater")
            return fisher(int((a > 0).sum()), len(a), int((b > 0).sum()), len(b), "greater")
        if self.paired:
            return float(paired_p(a, b, self.metric.better))
        return float(worsening_p(a, b, self.metric.better))

    def least_p(self) -> float:
        """Returns the smallest p value that this many runs can give."""
        if self.paired:
            return 2.0 ** -len(self.tonight) if self.metric.kind == "share" else 0.0
        return 1 / comb(len(self.baseline) + len(self.tonight), len(self.tonight))

    def runs_needed(self, level: float) -> int:
        """Returns the fewest runs per night (and in the baseline) with which p can reach
        `level`."""
        before = len(self.baseline)
        floors = (
            (n, 2.0**-n if self.paired else 1 / comb(max(before, n) + n, n)) for n in count(2)
        )
        return next(n for n, floor in floors if floor <= level)


def comparable(baseline: pd.DataFrame, tonight: pd.DataFrame) -> tuple[pd.DataFrame, str]:
    """Returns the baseline's runs that may be compared with tonight's, and a line about the others.

    The same program repeats a virtual run with the same result. So only the newest night of a cell
    counts, and a run that is stored twice counts once. Runs of another version of the metrics do
    not count.
    """
    note = ""
    if "metrics_version" in baseline and "metrics_version" in tonight:
        versions = set(tonight["metrics_version"].dropna())
        old = ~baseline["metrics_version"].isin(versions) if versions else baseline["cell"].isna()
        if old.any():
            baseline = baseline[~old]
            note = f"{int(old.sum())} runs of the baseline are of another metrics version, left out"
    if "engine" not in baseline:
        return baseline, note
    virtual = baseline["engine"].eq(VIRTUAL)
    if "night_utc" in baseline:
        newest = baseline.groupby("cell")["night_utc"].transform("max")
        virtual_kept = virtual & baseline["night_utc"].eq(newest)
    else:
        virtual_kept = virtual
    kept = baseline[~virtual | virtual_kept]
    if "run_key" in kept:
        named = kept["run_key"].notna()
        kept = kept[~(named & kept.duplicated(["cell", "run_key"], keep="last"))]
    return kept, note


def values_of_nights(
    before: pd.DataFrame, after: pd.DataFrame, item: Metric
) -> tuple[Floats, Floats, bool]:
    """Returns a metric on both sides, and whether the values are pairs: virtual runs aligned by
    seed."""
    sides = before, after
    if not all(len(_measured(side, item)) for side in sides):
        return _measured(before, item), _measured(after, item), False
    has_seeds = {"engine", "seed"} <= set(before) & set(after)
    pairs = paired_by_seed(before, after) if has_seeds else None
    a, b = values_to_rank(*(pairs or sides), item)
    both = ~np.isnan(a) & ~np.isnan(b) if pairs is not None else np.zeros(0, bool)
    if both.any():
        return a[both], b[both], True
    return finite(a), finite(b), False


def _measured(rows: pd.DataFrame, item: Metric) -> Floats:
    return finite(rows[item.key].to_numpy()) if item.key in rows else np.zeros(0)


def worsening_p(baseline: Floats, tonight: Floats, better: str) -> Floats:
    """Returns p of a one-sided rank test along the last axis that tonight is worse; exact without
    ties, and of few runs.

    Leading axes are independent tests; values of failed runs are infinite.
    """
    alternative: Literal["less", "greater"] = "less" if better == "higher" else "greater"
    both = np.sort(np.concatenate([baseline, tonight], axis=-1), axis=-1)
    with np.errstate(invalid="ignore"):
        ties = bool(np.any(both[..., 1:] == both[..., :-1]))
    method = rank_method(baseline, tonight, "asymptotic" if ties else "exact")
    result = stats.mannwhitneyu(tonight, baseline, alternative=alternative, axis=-1, method=method)
    # With all values equal there is no spread, so nothing is shown.
    return np.nan_to_num(np.asarray(result.pvalue, dtype=np.float64), nan=1.0)


def paired_p(baseline: Floats, tonight: Floats, better: str) -> Floats:
    """Returns p of a one-sided paired t-test along the last axis; 1 if no pair differs.

    Two nights of one system differ only in their programs, so without a regression the differences
    are symmetric, where a t-test is at most too conservative. With few runs it can pass Holm, which
    no paired rank test can. With failed runs (infinite) a signed-rank test replaces it.
    """
    alternative: Literal["less", "greater"] = "less" if better == "higher" else "greater"
    if not (np.isfinite(baseline).all() and np.isfinite(tonight).all()):
        return np.asarray(signed_rank(baseline, tonight, alternative))
    change = tonight - baseline
    if not np.any(change):
        return np.ones(change.shape[:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        result = stats.ttest_1samp(change, 0.0, axis=-1, alternative=alternative)
    return np.nan_to_num(np.asarray(result.pvalue, dtype=np.float64), nan=1.0)
