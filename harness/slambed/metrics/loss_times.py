# SPDX-License-Identifier: Apache-2.0
"""Times of track losses, and how many fall into a window of the sequence."""

import math
from collections.abc import Iterable


def loss_times_text(times_s: Iterable[float]) -> str:
    """Formats sequence times in seconds for a summary, "22.4 31.07"; empty without a loss."""
    return " ".join(f"{time:.3f}".rstrip("0").rstrip(".") for time in times_s)


def loss_times_of(text: object) -> list[float]:
    """Parses a value of a summary or a table, where empty text is NaN and a single time is a
    number."""
    if isinstance(text, int | float) and not isinstance(text, bool):
        return [] if math.isnan(text) else [float(text)]
    return [float(part) for part in text.split()] if isinstance(text, str) else []


def in_window(times_s: Iterable[float], from_s: float, to_s: float) -> int:
    """Returns how many losses begin within [from_s, to_s]."""
    return sum(from_s <= time <= to_s for time in times_s)
