# SPDX-License-Identifier: Apache-2.0
"""Selects cells of a plan, and previews what a campaign would execute."""

from collections.abc import Iterable

from slambed.campaign.progress import duration
from slambed.campaign.store import RunStore
from slambed.spec.run_spec import RunSpec
from slambed.spec.selection import facts_of, meant


def chosen(specs: list[RunSpec], only: Iterable[str], option: str = "--only") -> list[RunSpec]:
    """Returns the runs that match the selections (slambed.spec.selection); all without
    selections. Raises SlambedError for a selection without a match."""
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
    virtual: bool = False,
) -> list[str]:
    """Returns one line per cell with its existing runs, and one with the expected time for the
    rest."""
    lines, todo = [], 0
    for cell in dict.fromkeys(spec.cell for spec in specs):
        own = [spec for spec in specs if spec.cell == cell]
        keys = [spec.run_key for spec in own if spec.run_key not in forced]
        there = sum(store.state(key) in again for key in keys)
        todo += len(own) - there
        lines.append(f"{cell}: {there} of {len(own)} runs there")
    return [*lines, f"{todo} runs to execute, {about(run_s * todo / jobs, virtual)}"]


def about(seconds: float, virtual: bool) -> str:
    """Returns an expected duration, made before any run was timed. Other work on the machine
    delays virtual runs; live ones take the time of their sequences."""
    idle = " on an idle machine" if virtual and seconds else ""
    return f"about {duration(seconds)}{idle}"
