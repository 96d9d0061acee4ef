# SPDX-License-Identifier: Apache-2.0
"""Fits the cost of a stage, a + b*n1 + c*n2, to the CPU times of live runs."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import nnls

from slambed.spec.device import StageCost

Values = NDArray[np.float64]

LEAST_COUNT = 5
"""Fewest executions of a stage for a fit."""
LEAST_US = 1.0
"""Times below this are dominated by the clock's own cost and are left out."""
ROUNDS = 3
"""Rounds of reweighting, because the spread of a time is proportional to the time."""
DIGITS = 4
MAD_TO_SD = 1.4826
"""For a normal distribution."""


@dataclass(frozen=True)
class StageFit:
    """A fitted stage and its residuals."""

    name: str
    cost: StageCost
    count: int
    mean_us: float
    """Mean of the measured times."""
    mean_error_percent: float
    """Predicted mean (with jitter) relative to the measured mean."""
    median_error_percent: float
    p95_error_percent: float
    """95 % quantile of the absolute relative residuals, measured against the fit without jitter."""


def fit_stages(stages: pd.DataFrame) -> list[StageFit]:
    """Fits every stage of a table with the columns name, n1, n2, cpu_ms, sorted by name."""
    fits = []
    for name, group in stages.dropna(subset=["cpu_ms"]).groupby("name", sort=True):
        measured = group[group["cpu_ms"] * 1e3 >= LEAST_US]
        if len(measured) >= LEAST_COUNT:
            fits.append(
                fit_stage(
                    str(name),
                    measured["n1"].fillna(0.0).to_numpy(np.float64),
                    measured["n2"].fillna(0.0).to_numpy(np.float64),
                    measured["cpu_ms"].to_numpy(np.float64) * 1e3,
                )
            )
    return fits


def fit_stage(name: str, n1: Values, n2: Values, measured_us: Values) -> StageFit:
    """Fits a stage by non-negative least squares on relative residuals.

    The charged time is the fit times a log-normal factor of median 1, whose spread is that of the
    log residuals. The fit is scaled so that the mean charged equals the mean measured: a device's
    load is a sum of times, not of medians.
    """
    # A constant n2 cannot be distinguished from a fixed time, so it counts as one.
    columns = np.column_stack([np.ones_like(n1), n1, n2 if np.ptp(n2) > 0 else 0 * n2])
    predicted = np.full_like(measured_us, measured_us.mean())
    solution = np.zeros(columns.shape[1])
    for _ in range(ROUNDS):
        weights = 1.0 / np.maximum(predicted, LEAST_US)
        solution, _ = nnls(columns * weights[:, None], measured_us * weights)
        predicted = np.maximum(columns @ solution, LEAST_US)
    jitter = _spread(np.log(measured_us / predicted))
    scale = measured_us.mean() / (predicted.mean() * np.exp(jitter**2 / 2))
    cost = StageCost(
        a_us=_short(solution[0] * scale),
        b_us=_short(solution[1] * scale),
        c_us=_short(solution[2] * scale),
        jitter=_short(jitter),
    )
    charged = np.maximum(columns @ np.array([cost.a_us, cost.b_us, cost.c_us]), 1e-3)
    error = 100 * (measured_us / charged - 1)
    mean_charged = charged.mean() * np.exp(cost.jitter**2 / 2)
    return StageFit(
        name=name,
        cost=cost,
        count=len(measured_us),
        mean_us=float(measured_us.mean()),
        mean_error_percent=float(100 * (mean_charged / measured_us.mean() - 1)),
        median_error_percent=float(np.median(error)),
        p95_error_percent=float(np.quantile(np.abs(error), 0.95)),
    )


def _spread(residuals: Values) -> float:
    """Returns the standard deviation from the median absolute deviation, so that outliers do not
    count: a run's first keyframe finds nothing to do and takes a thousandth of the usual time."""
    return float(MAD_TO_SD * np.median(np.abs(residuals - np.median(residuals))))


def _short(value: float) -> float:
    """Rounds to four digits: more are noise and hard to read."""
    return float(f"{value:.{DIGITS}g}")
