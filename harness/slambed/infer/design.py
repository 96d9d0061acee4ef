# SPDX-License-Identifier: Apache-2.0
"""Which points are looked at, and how often: spread over what is open, in rounds of more runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice, product
from math import prod

import numpy as np
from scipy.stats import qmc

from slambed.infer.inference_plan import Form, OpenItem
from slambed.spec.system import Scalar

DIGITS = 3
"""Of the values of a range: enough to distinguish points, few enough to read."""
MORE = 2
"""Each round has so many times the runs of the one before."""
MOST_DRAWS = 64
"""Per point wanted: where so many draws give no new one there is none."""


@dataclass(frozen=True)
class Point:
    """A value for everything that is open, in the plan's order."""

    values: tuple[tuple[str, Scalar], ...]

    @property
    def named(self) -> dict[str, Scalar]:
        """By item."""
        return dict(self.values)

    def at(self, item: str, value: Scalar) -> "Point":
        """The same with one value changed."""
        return Point(tuple((n, value if n == item else v) for n, v in self.values))

    def words(self) -> str:
        """`first_update 2.5, codec binary`."""
        return ", ".join(f"{name} {shown(value)}" for name, value in self.values)


def shown(value: Scalar) -> str:
    """A value as tables have it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.12g}" if isinstance(value, int | float) else value


def printed_point(items: Mapping[str, OpenItem]) -> Point:
    """Where everything is as printed."""
    return Point(tuple((name, item.printed) for name, item in items.items()))


def spread(items: Mapping[str, OpenItem], count: int, seed: int) -> list[Point]:
    """The printed point and others that fill the space evenly (Halton's sequence, scrambled), each
    once; fewer than `count` where there are no more. A space of few values only is taken whole."""
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
    return float(f"{low + round(u * (high - low) / step) * step:.12g}")


def rounds_of(form: Form) -> list[int]:
    """Runs of every fitted cell in each round: twice as many each time, up to the final number."""
    found = [form.first_runs]
    while found[-1] < form.final_runs:
        found.append(min(MORE * found[-1], form.final_runs))
    return found
