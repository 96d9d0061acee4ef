# SPDX-License-Identifier: Apache-2.0
"""Compares one metric between two groups of runs: both values, the change with its interval, one
test."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.metrics.changes import paired_share_change, paired_shift, share_change, shift
from slambed.metrics.comparison import fisher, least_p, mann_whitney, mcnemar, signed_rank
from slambed.metrics.metric import Metric
from slambed.metrics.robust_accuracy import failure_ranked
from slambed.metrics.statistics import Interval, finite
from slambed.spec.device import VIRTUAL

Floats = NDArray[np.float64]

RANKED_WITH_FAILURES = "ate_rmse_m"
"""Of a run that lost the camera early it is the error of the few poses before, so it would rank
such runs first."""


@dataclass(frozen=True)
class MetricContrast:
    """The contrast of a metric between runs A and runs B."""

    a: float
    b: float
    """Medians, or shares; infinite where the median run failed."""
    change: Interval
    """B - A."""
    effect: str
    """Effect size in words, without a unit."""
    p_value: float
    paired: bool
    least_p: float
    """The smallest p value that so many runs can give."""

    @property
    def runs(self) -> int:
        """Returns the number of pairs, or of runs on the smaller side."""
        return self.change.count


def contrast(item: Metric, a: pd.DataFrame, b: pd.DataFrame) -> MetricContrast | None:
    """Compares in pairs if seeds allow it; None if the metric was not measured twice on both
    sides."""
    if item.key not in a or item.key not in b:
        return None
    if not any(len(finite(side[item.key].to_numpy())) for side in (a, b)):
        return None
    pairs = paired_by_seed(a, b)
    sides = pairs or (a, b)
    x, y = values_to_rank(*sides, item)
    if pairs is not None:
        measured = ~(np.isnan(x) | np.isnan(y))
        x, y = x[measured], y[measured]
    else:
        x, y = finite(x), finite(y)
    if min(len(x), len(y)) < 2:
        return None
    if item.kind == "share":
        return _of_shares((x > 0).astype(np.float64), (y > 0).astype(np.float64), pairs is not None)
    if pairs is not None:
        effect = f"higher in {int((y > x).sum())} of {len(x)} pairs"
        p_value, change = signed_rank(x, y), paired_shift(x, y)
    else:
        test = mann_whitney(x, y)
        effect = f"delta {test.cliffs_delta:+.2f} ({test.size})"
        p_value, change = test.p_value, shift(x, y)
    p_value = 1.0 if np.isnan(p_value) else p_value
    middle = float(np.median(x)), float(np.median(y))
    least = least_p(len(x), pairs is not None, len(y))
    return MetricContrast(*middle, change, effect, p_value, pairs is not None, least)


def _of_shares(x: Floats, y: Floats, paired: bool) -> MetricContrast:
    if paired:
        p_value, change = mcnemar(x > 0, y > 0), paired_share_change(x, y)
    else:
        p_value = fisher(int(x.sum()), len(x), int(y.sum()), len(y))
        change = share_change(x, y)
    share_a, share_b = float(x.mean()), float(y.mean())
    effect = f"{100 * (share_b - share_a):+.0f} points"
    least = least_p(len(x), paired, len(y))
    return MetricContrast(share_a, share_b, change, effect, p_value, paired, least)


def paired_by_seed(a: pd.DataFrame, b: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame] | None:
    """Returns the runs of both sides with shared seeds in the same order; None if seeds cannot pair
    them.

    Only in virtual time does a seed determine a run. Live runs of equal seed are no more alike than
    others, and are compared unpaired.
    """
    both = pd.concat([a["engine"], b["engine"]])
    if not both.eq(VIRTUAL).all() or a["seed"].isna().any() or b["seed"].isna().any():
        return None
    if a["seed"].duplicated().any() or b["seed"].duplicated().any():
        return None
    shared = sorted(set(a["seed"]) & set(b["seed"]))
    if len(shared) < 2:
        return None
    return a.set_index("seed").loc[shared], b.set_index("seed").loc[shared]


def values_to_rank(a: pd.DataFrame, b: pd.DataFrame, item: Metric) -> tuple[Floats, Floats]:
    """Returns one value per run of each side, NaN where nothing was measured. The ATE of a failed
    run is infinite, unless every run of both sides failed: then it is that of what was tracked."""
    x, y = _ranked(a, item), _ranked(b, item)
    if not (np.isfinite(x).any() or np.isfinite(y).any()):
        # As on a sequence with a covered lens, where ranks would show nothing.
        return _floats(a[item.key]), _floats(b[item.key])
    return x, y


def _ranked(rows: pd.DataFrame, item: Metric) -> Floats:
    if item.key == RANKED_WITH_FAILURES and "coverage" in rows and rows["coverage"].notna().any():
        pairs = zip(_floats(rows[item.key]), _floats(rows["coverage"]), strict=True)
        return np.array([failure_ranked(ate, coverage) for ate, coverage in pairs])
    return _floats(rows[item.key])


def _floats(column: pd.Series) -> Floats:
    numbers = pd.to_numeric(column.astype(object), errors="coerce")
    return numbers.to_numpy(np.float64, na_value=np.nan)
