# SPDX-License-Identifier: Apache-2.0
"""Which cells of a plan a campaign is about, and what it would do about them."""

from collections.abc import Iterable

from slambed.campaign.progress import duration
from slambed.campaign.store import RunStore
from slambed.spec.run_spec import RunSpec
from slambed.spec.selection import facts_of, meant


def chosen(specs: list[RunSpec], only: Iterable[str], option: str = "--only") -> list[RunSpec]:
    """The runs of the cells that are selected (slambed.spec.selection); all where nothing is.
    Raises SlambedError for what is no cell."""
    runs = [
        facts_of(
            s.cell,
            s.system,
            s.variant,
            [s.label],
            s.dataset,
            s.profile,
            s.device_mobile.name,
            s.device_edge.name if s.device_edge is not None else None,
            s.engine,
            s.pace,
            s.params,
        )
        for s in specs
    ]
    return [s for s, ours in zip(specs, meant([*runs], only, option), strict=True) if ours]


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
