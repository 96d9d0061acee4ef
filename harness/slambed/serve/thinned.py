# SPDX-License-Identifier: Apache-2.0
"""Reduces numbers for a browser: no more than a screen shows, and no NaN."""

import math
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MOST_POINTS = 3_000
DIGITS = 6
"""Significant digits; more are not visible."""


def decimated(t_s: Floats, values: Floats, most: int = MOST_POINTS) -> tuple[Floats, Floats]:
    """Returns a curve of at most `most` points that keeps the minimum and maximum of each part, so
    that peaks stay visible."""
    if len(t_s) <= most:
        return t_s, values
    chosen: list[int] = []
    for part in np.array_split(np.arange(len(t_s)), most // 2):
        ends = {int(part[np.argmin(values[part])]), int(part[np.argmax(values[part])])}
        chosen += sorted(ends)
    return t_s[chosen], values[chosen]


@overload
def numbers(value: list[Any]) -> list[Any]: ...
@overload
def numbers(value: float) -> float | None: ...
def numbers(value: Any) -> Any:
    """Rounds numbers; values that are not finite become None, because JSON has none."""
    if isinstance(value, list):
        return [numbers(item) for item in value]
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return (
            int(value) if value.is_integer() and abs(value) < 1e15 else float(f"{value:.{DIGITS}g}")
        )
    return value
