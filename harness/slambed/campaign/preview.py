# SPDX-License-Identifier: Apache-2.0
"""Which cells of a plan a campaign is about, and what it would do about them."""

from collections.abc import Iterable
from fnmatch import fnmatchcase

from slambed.campaign.progress import duration
from slambed.campaign.store import RunStore
from slambed.errors import SlambedError
from slambed.spec.run_spec import RunSpec


def chosen(specs: list[RunSpec], only: Iterable[str], option: str = "--only") -> list[RunSpec]:
    """The runs of the cells named, patterns included; all where none is named. Raises SlambedError
    for a name that is no cell."""
    names = list(only)
    cells = list(dict.fromkeys(spec.cell for spec in specs))
    for name in names:
        if not any(fnmatchcase(cell, name) for cell in cells):
            raise SlambedError(f"{option} {name} is no cell; cells: {', '.join(cells)}")
    return [s for s in specs if not names or any(fnmatchcase(s.cell, name) for name in names)]


def preview(
    specs: list[RunSpec],
    store: RunStore,
    again: tuple[str, ...],
    run_s: float,
    jobs: int,
    forced: frozenset[str] = frozenset(),
) -> list[str]:
    """One line per cell with what is there of it, and one with how long the rest would take."""
    lines, todo = [], 0
    for cell in dict.fromkeys(spec.cell for spec in specs):
        own = [spec for spec in specs if spec.cell == cell]
        keys = [spec.run_key for spec in own if spec.run_key not in forced]
        there = sum(store.state(key) in again for key in keys)
        todo += len(own) - there
        lines.append(f"{cell}: {there} of {len(own)} runs there")
    return [*lines, f"{todo} runs to execute, about {duration(run_s * todo / jobs)}"]
