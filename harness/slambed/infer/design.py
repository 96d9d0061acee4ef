# SPDX-License-Identifier: Apache-2.0
"""Chooses the points, spread over the open items, and the runs per round."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice, product
from math import prod

import numpy as np
from scipy.stats import qmc

from slambed.infer.inference_plan import Form, OpenItem
from slambed.spec.system import Scalar

DIGITS = 3
"""Significant digits of values in a range: enough to distinguish points, few enough to read."""
MORE = 2
"""Factor of runs from one round to the next."""
MOST_DRAWS = 64
"""Batches of draws after which the space is taken to have no more points."""


@dataclass(frozen=True)
class Point:
    """A value for every open item, in the plan's order."""

    values: tuple[tuple[str, Scalar], ...]

    @property
    def named(self) -> dict[str, Scalar]:
        return dict(self.values)

    def at(self, item: str, value: Scalar) -> "Point":
        return Point(tuple((n, value if n == item else v) for n, v in self.values))

    def words(self) -> str:
        """Returns text such as `first_update 2.5, codec binary`."""
        return ", ".join(f"{name} {shown(value)}" for name, value in self.values)


def shown(value: Scalar) -> str:
    """Returns a value as tables show it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.12g}" if isinstance(value, int | float) else value


def printed_point(items: Mapping[str, OpenItem]) -> Point:
    """Returns the point where every item has its printed value."""
    return Point(tuple((name, item.printed) for name, item in items.items()))


def spread(items: Mapping[str, OpenItem], count: int, seed: int) -> list[Point]:
    """Returns the printed point and others that fill the space evenly (scrambled Halton sequence),
    without duplicates; fewer than `count` if there are no more. A small discrete space is
    enumerated."""
    found = dict.fromkeys([printed_point(items)])
    sizes = [len(item.choices) for item in items.values()]
    if all(sizes) and prod(sizes) <= count:
        lists = [[(name, value) for value in item.choices] for name, item in items.items()]
        found |= dict.fromkeys(Point(values) for values in product(*lists))
        return list(found)
    sequence = qmc.Halton(len(items), scramble=True, seed=seed)
    for _ in range(MOST_DRAWS):
        for row in sequence.random(count):
            pairs = zip(items.items(), row, strict=True)
            found[Point(tuple((name, _value(item, float(u))) for (name, item), u in pairs))] = None
        if len(found) >= count:
            break
    return list(islice(found, count))


def _value(item: OpenItem, u: float) -> Scalar:
    if item.range is None:
        return item.choices[int(u * len(item.choices))]
    low, high = item.range
    if isinstance(low, int) and isinstance(high, int):
        return low + int(u * (high - low + 1))
    step = 10.0 ** (np.floor(np.log10(high - low)) - DIGITS + 1)
    rounded = float(f"{low + round(u * (high - low) / step) * step:.12g}")
    return min(float(high), rounded)


def rounds_of(form: Form) -> list[int]:
    """Returns the runs of every fitted cell in each round: doubled each time, up to the final
    number."""
    found = [form.first_runs]
    while found[-1] < form.final_runs:
        found.append(min(MORE * found[-1], form.final_runs))
    return found
