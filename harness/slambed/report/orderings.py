# SPDX-License-Identifier: Apache-2.0
"""The declared orderings of a paper, judged with our runs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slambed.metrics.comparison import holm
from slambed.report.judged import Judge
from slambed.report.margins import published_of
from slambed.report.measured import Measured
from slambed.report.papers import Cell, Contrast, Provenance
from slambed.report.verdicts.contrasts import (
    Ordering,
    Published,
    Step,
    judge_blocks,
    judge_contrast,
    paper_shows,
)
from slambed.report.verdicts.model import LEVEL, Floats
from slambed.report.verdicts.trends import page


@dataclass(frozen=True)
class JudgedOrdering:
    """One declared ordering beside ours."""

    contrast: Contrast
    ordering: Ordering
    provenance: Provenance
    chains: tuple[tuple[tuple[Cell, Measured], ...], ...]
    """In the declared order, every cell with what we have there."""
    systems: Mapping[str, str]
    """What a reader calls the paper's systems."""

    @property
    def stand_ins(self) -> list[str]:
        """Our sequences that stand in for the paper's."""
        found = {m.found.dataset for chain in self.chains for _, m in chain if m.found.stand_in}
        return sorted(found)

    def values(self, ours: bool) -> str:
        """`Relocate 446 < Edge-SLAM 474 ms`: the ends of the chain that decides, as printed or as
        ours; of a trend `rtt 0: 20 → rtt 80: 73 %`."""
        decides = self.ordering.decides
        chain = self.chains[decides or 0]
        ends = [chain[0], chain[-1]]
        if ours and not any(m.there for chain in self.chains for _, m in chain):
            return "not run"
        if ours:
            texts = [_value(m) for _, m in ends]
            numbers = [_number(m) for _, m in ends]
        else:
            texts = [NO_NUMBER if c.value is None else f"{c.value:g}" for c, _ in ends]
            numbers = [c.value for c, _ in ends]
        if set(texts) == {NO_NUMBER}:
            return "in words"
        between = " → " if len(chain) > 2 else f" {_relation(*numbers)} "
        names = _names(ends[0][0], ends[1][0], self.systems)
        told = between.join(
            f"{name} {text}".strip() for name, text in zip(names, texts, strict=True)
        )
        which = "first" if decides is None else "weakest"
        where = {str(c.conditions["dataset"]) for c, _ in ends if "dataset" in c.conditions}
        place = f", {where.pop()}" if len(where) == 1 else ""
        more = f" ({which} of {len(self.chains)} pairs{place})" if len(self.chains) > 1 else ""
        return f"{told} {ends[0][0].unit}{more}"


NO_NUMBER = "not printed"
"""Of an end of a chain that the paper draws or tells in words."""


def _names(first: Cell, last: Cell, systems: Mapping[str, str]) -> list[str]:
    """What distinguishes the two, in the paper's words."""
    found = []
    for cell, other in ((first, last), (last, first)):
        parts = []
        if cell.system != other.system and cell.system is not None:
            parts.append(systems.get(cell.system, cell.system))
        parts += [
            f"{name} {value}"
            for name, value in cell.conditions.items()
            if other.conditions.get(name) != value
        ]
        if not parts and cell.metric != other.metric:
            parts.append(cell.metric)
        found.append(", ".join(parts))
    return found


def _relation(first: float | None, last: float | None) -> str:
    if first is None or last is None:
        return "to"
    return "<" if first < last else ">" if first > last else "="


def _number(measured: Measured) -> float | None:
    if not measured.there:
        return None
    return measured.share.value if measured.is_share else measured.mean.value


def _value(measured: Measured) -> str:
    if not measured.there:
        return "-"
    if measured.is_share:
        return f"{measured.share.bad}/{measured.share.runs}"
    return f"{measured.mean.value:.3g}"


def judge_orderings(judge: Judge) -> list[JudgedOrdering]:
    """All contrasts of the paper, the paper's own p adjusted (Holm) over those of one table."""
    found = [OrderingCase(judge, contrast) for contrast in judge.paper.contrasts]
    by_table: dict[str, list[OrderingCase]] = {}
    for case in found:
        if case.testable:
            by_table.setdefault(case.source, []).append(case)
    adjusted: dict[str, float] = {}
    for cases in by_table.values():
        p_values = holm([case.p_paper() for case in cases])
        adjusted |= {c.contrast.id: float(p) for c, p in zip(cases, p_values, strict=True)}
    return [case.judged(adjusted.get(case.contrast.id)) for case in found]


class OrderingCase:
    """A contrast with the paper's numbers and ours, rising."""

    def __init__(self, judge: Judge, contrast: Contrast) -> None:
        self.contrast = contrast
        self.judge = judge
        self.chains = tuple(
            tuple((judge.cells[c], judge.measured(judge.cells[c])) for c in chain)
            for chain in contrast.chains
        )
        falling = contrast.direction == "falls"
        self.rising = [chain[::-1] if falling else chain for chain in self.chains]
        self.testable = contrast.basis == "data" and all(
            self._published(c) is not None for chain in self.chains for c, _ in chain
        )

    @property
    def source(self) -> str:
        """The table whose contrasts are adjusted together."""
        return self.chains[0][0][0].source

    def _published(self, cell: Cell) -> Published | None:
        metric = self.judge.paper.metrics.get(cell.metric)
        return published_of(cell, metric is not None and metric.statistic == "share")

    def steps(self) -> list[Step]:
        """What is to rise, chain by chain."""
        found = []
        for chain in self.rising:
            paper = [self._published(c) for c, _ in chain] if self.testable else []
            ours = tuple(m.ours for _, m in chain)
            label = f"{chain[0][0].id} and {chain[-1][0].id}"
            found.append(Step(ours, tuple(p for p in paper if p is not None), label))
        return found

    def table(self, ours: bool) -> Floats:
        """Means, one row per chain; NaN where there is nothing."""
        rows = [
            [
                (float(np.mean(m.values)) if m.there else np.nan) if ours else (c.value or np.nan)
                for c, m in chain
            ]
            for chain in self.rising
        ]
        return np.array(rows, dtype=np.float64)

    def p_paper(self) -> float:
        """By the paper's own numbers, not yet adjusted."""
        if self.contrast.kind == "blocks":
            return page(self.table(ours=False))
        return paper_shows(self.steps())[0]

    def judged(self, p_paper: float | None) -> JudgedOrdering:
        """`p_paper` is adjusted; None where it could not be tested."""
        used = [(c, m) for chain in self.chains for c, m in chain]
        provenance: Provenance = "measured"
        if any(c.id in self.judge.fitted for c, m in used):
            provenance = "fitted"
        elif any(m.found.stand_in for _, m in used):
            provenance = "stand_in"
        labels = {name: system.label for name, system in self.judge.paper.systems.items()}
        ordering = self._ordering(p_paper)
        return JudgedOrdering(self.contrast, ordering, provenance, self.chains, labels)

    def _ordering(self, p_paper: float | None) -> Ordering:
        if self.contrast.basis == "data" and p_paper is None:
            why = "the paper prints no numbers that could be tested"
            return Ordering("paper_cannot_tell", why)
        if missing := next((m for chain in self.chains for _, m in chain if not m.there), None):
            if p_paper is not None and p_paper > LEVEL:
                return judge_contrast(self.steps(), p_paper, self._assumed())
            return Ordering("inconclusive", f"not run: {missing.found.reason}")
        if mixed := self._mixed():
            return Ordering("inconclusive", mixed)
        if self.contrast.kind == "blocks":
            return judge_blocks(self.table(ours=True), self.table(ours=False), p_paper)
        steps = self.steps()
        if p_paper is None:
            return judge_contrast(steps, float("nan"))
        return judge_contrast(steps, p_paper, self._assumed())

    def _assumed(self) -> tuple[str, ...]:
        return () if self.contrast.kind == "blocks" else paper_shows(self.steps())[1]

    def _mixed(self) -> str:
        """A direction on stand-ins counts only within one of them."""
        ours: dict[str, set[str]] = {}
        for chain in self.chains:
            for cell, measured in chain:
                ours.setdefault(str(cell.conditions.get("dataset")), set()).add(
                    measured.found.dataset
                )
        for name, datasets in ours.items():
            if len(datasets) > 1:
                return (
                    f"its cells on {name} are on several sequences: {', '.join(sorted(datasets))}"
                )
        return ""
