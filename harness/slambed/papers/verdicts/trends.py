# SPDX-License-Identifier: Apache-2.0
"""One-sided tests of an ordering: two groups, a trend along groups, systems over sequences.

Every function tests whether values *rise* in the given order and returns that p value; for a fall,
reverse the order. Fisher, Mann-Whitney and Page are scipy's.
"""

from collections.abc import Sequence
from math import fsum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.special import gammaln

from slambed.papers.verdicts.model import Floats, Mean, Share

EXACT_BELOW = 5
"""With fewer losses (or runs without one) than this in total, the test is exact."""
EXACT_UP_TO = 60
"""Up to this many runs in total, the test is exact too: for five groups of five with half of them
lost, the normal approximation errs in 6.1 % instead of 5 %."""


def fisher_rising(
    low: ArrayLike, low_runs: ArrayLike, high: ArrayLike, high_runs: ArrayLike
) -> Any:
    """Returns p of Fisher's exact test that the second share is larger, for arrays of counts."""
    k, n = np.asarray(high), np.asarray(high_runs)
    bad, total = k + np.asarray(low), n + np.asarray(low_runs)
    return stats.hypergeom.sf(k - 1, total, bad, n)


def pair_rising(low: Share | Floats, high: Share | Floats) -> float:
    """Tests shares by Fisher's exact test, values by Mann-Whitney."""
    if isinstance(low, Share) and isinstance(high, Share):
        return float(fisher_rising(low.bad, low.runs, high.bad, high.runs))
    first, second = np.asarray(low), np.asarray(high)
    if np.ptp(np.concatenate([first, second])) == 0:
        return 1.0
    return float(stats.mannwhitneyu(second, first, alternative="greater").pvalue)


def means_rising(means: Sequence[Mean]) -> float:
    """Tests a linear contrast of means with Welch's degrees of freedom; for two means, Welch's t
    test.

    It is for published means without single runs; every mean has count and spread.
    """
    weight = np.arange(len(means)) - (len(means) - 1) / 2
    parts = np.array([(m.sd or 0.0) ** 2 / max(m.count or 1, 1) for m in means])
    freedom = np.array([max((m.count or 1) - 1, 1) for m in means], dtype=np.float64)
    variance = weight**2 * parts + (weight * [m.digit for m in means]) ** 2 / 12
    effect = float(weight @ [m.value for m in means])
    total = float(variance.sum())
    if total == 0:
        return 0.0 if effect > 0 else 1.0
    loss = float(((weight**2 * parts) ** 2 / freedom).sum())
    z = effect / np.sqrt(total)
    return float(stats.t.sf(z, total**2 / loss) if loss > 0 else stats.norm.sf(z))


def cochran_armitage(bad: ArrayLike, runs: ArrayLike) -> Any:
    """Returns p that shares rise along the last axis with equal steps (normal approximation).

    Cochran (1954), Armitage (1955). p is 1 if no run or every run was lost.
    """
    k, n = np.asarray(bad, dtype=np.float64), np.asarray(runs, dtype=np.float64)
    step = np.arange(k.shape[-1], dtype=np.float64)
    total, lost = n.sum(-1), k.sum(-1)
    share = lost / total
    effect = (step * (k - n * share[..., None])).sum(-1)
    spread = (n * step**2).sum(-1) - (n * step).sum(-1) ** 2 / total
    variance = share * (1 - share) * spread
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(variance > 0, stats.norm.sf(effect / np.sqrt(variance)), 1.0)


def shares_rising(shares: Sequence[Share]) -> float:
    """Tests by Cochran-Armitage, or by the exact conditional test if runs, losses or their absence
    are few."""
    bad, runs = np.array([s.bad for s in shares]), np.array([s.runs for s in shares])
    lost, kept = int(bad.sum()), int((runs - bad).sum())
    if min(lost, kept) >= EXACT_BELOW and runs.sum() > EXACT_UP_TO:
        return float(cochran_armitage(bad, runs))
    if min(lost, kept) == 0:
        return 1.0
    if lost <= kept:
        return _exact_trend(bad, runs)
    return _exact_trend((runs - bad)[::-1], runs[::-1])


def _exact_trend(bad: Any, runs: Any) -> float:
    """Returns P(sum of step * losses at least as large), given the total number of losses."""
    lost = int(bad.sum())
    seen = int((np.arange(len(bad)) * bad).sum())
    ways = {(0, 0): 1.0}
    for step, count in enumerate(runs):
        grown: dict[tuple[int, int], float] = {}
        for (used, score), weight in ways.items():
            for k in range(min(lost - used, int(count)) + 1):
                key = (used + k, score + step * k)
                grown[key] = grown.get(key, 0.0) + weight * float(np.exp(_log_choose(count, k)))
        ways = grown
    whole = {score: weight for (used, score), weight in ways.items() if used == lost}
    return fsum(w for score, w in whole.items() if score >= seen) / fsum(whole.values())


def _log_choose(n: int, k: int) -> float:
    return float(gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1))


def jonckheere(groups: Sequence[Floats]) -> float:
    """Returns p of Jonckheere-Terpstra that values rise from group to group (normal, corrected for
    ties).

    Jonckheere (1954); variance with ties as in Hollander and Wolfe (1999), 6.19.
    """
    values = np.concatenate(groups)
    sizes = np.array([len(g) for g in groups], dtype=np.float64)
    total = float(sizes.sum())
    count = 0.0
    for i, low in enumerate(groups):
        for high in groups[i + 1 :]:
            difference = high[None, :] - low[:, None]
            count += float((difference > 0).sum() + 0.5 * (difference == 0).sum())
    ties = np.unique(values, return_counts=True)[1].astype(np.float64)
    mean = (total**2 - (sizes**2).sum()) / 4

    def first(n: Any) -> Any:
        return n * (n - 1) * (2 * n + 5)

    def second(n: Any) -> Any:
        return n * (n - 1) * (n - 2)

    def third(n: Any) -> Any:
        return n * (n - 1)

    variance = (first(total) - first(sizes).sum() - first(ties).sum()) / 72
    if total > 2:
        variance += (
            second(sizes).sum() * second(ties).sum() / (36 * total * (total - 1) * (total - 2))
        )
    if total > 1:
        variance += third(sizes).sum() * third(ties).sum() / (8 * total * (total - 1))
    return float(stats.norm.sf((count - mean) / np.sqrt(variance))) if variance > 0 else 1.0


def page(blocks: ArrayLike) -> float:
    """Returns p of Page's L that the columns rise in order within the rows (sequences x
    systems); 1 for a table with gaps."""
    table = np.asarray(blocks, dtype=np.float64)
    if table.shape[0] < 2 or table.shape[1] < 3 or not np.isfinite(table).all():
        return 1.0
    return float(stats.page_trend_test(table).pvalue)
