# SPDX-License-Identifier: Apache-2.0
"""Checks a paper's file: every number is mapped or has a reason why not, and everything that a
mapping names exists.

A wrong mapping is worse than a missing one, because its verdict is about something else.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

from slambed.papers.lint.checkout import Checkout, fits_any
from slambed.papers.lint.lint_names import name_problems
from slambed.papers.lint.lint_open import open_problems
from slambed.papers.lint.lint_plan import plan_problems
from slambed.papers.lint.problem import Problem
from slambed.papers.published.cells import PublishedCell, cells_of, resolution_of, table_cells
from slambed.papers.published.claims import Claim, Configured
from slambed.papers.published.contrasts import Contrast
from slambed.papers.published.paper import Paper
from slambed.papers.published.paper_plan import read_plan
from slambed.papers.published.quantities import At, Operand, Quantity, computed

SET_UP = ("setup", "parameter", "background")
"""Kinds of claims that are not results."""


def lint(papers: Iterable[Paper], checkout: Checkout) -> list[Problem]:
    """Returns all problems of these papers, in the order of their files."""
    found: list[Problem] = []
    chosen = [paper for paper in papers if paper.kind == "paper"]
    for paper in chosen:
        mistakes = lint_paper(paper, checkout)
        # Unresolved names cannot be looked up in experiments.
        found += mistakes or open_problems(paper, checkout)
        if (plan := read_plan(paper.id, checkout.root / "papers")) is not None:
            found += plan_problems(plan, paper, checkout)
    cells = {name: cell for paper in chosen for name, cell in cells_of(paper).items()}
    known = {name.split(".")[0] for name in cells}
    for fit, patterns in checkout.fits.items():
        for pattern in patterns:
            about = pattern.split(".")[0]
            if about in known and not fits_any(pattern, set(cells)):
                found.append(
                    Problem(f"catalog/devices/fits/{fit}.yaml", f"fits: no cell {pattern}")
                )
    return found


def lint_paper(paper: Paper, checkout: Checkout) -> list[Problem]:
    look = _Look(paper, checkout, cells_of(paper))
    parts = (look.ids(), name_problems(paper, checkout), look.tables(), look.figures(),
             look.claims(), look.contrasts())  # fmt: skip
    return [problem for part in parts for problem in part]


@dataclass(frozen=True)
class _Look:
    paper: Paper
    checkout: Checkout
    cells: dict[str, PublishedCell]

    def ids(self) -> Iterator[Problem]:
        paper = self.paper
        given = [table.id for table in paper.tables] + [figure.id for figure in paper.figures]
        given += [claim.id for claim in paper.claims] + [item.id for item in paper.contrasts]
        for name, times in Counter(given).items():
            if times > 1:
                yield Problem(name, "an id is given twice")

    def tables(self) -> Iterator[Problem]:
        for cell in table_cells(self.paper).values():
            yield from self._comparability(cell)
            if not cell.comparability.judged:
                continue
            if cell.value is None:
                yield Problem(cell.id, "words, and no reason why they are not judged: unmappable?")
                continue
            yield from self._mapped(cell)

    def figures(self) -> Iterator[Problem]:
        claims = {claim.id for claim in self.paper.claims}
        for figure in self.paper.figures:
            for name in figure.stated:
                if name not in claims:
                    yield Problem(figure.id, f"stated: no claim {name}")
            for name in figure.drawn.cells if figure.drawn else []:
                if name not in self.cells:
                    yield Problem(figure.id, f"drawn: no cell, claim or point {name}")
            if not figure.stated and not figure.series and not figure.unmappable:
                yield Problem(figure.id, "nothing of it is stated or compared: unmappable: why?")
            for cell in self.cells.values():
                if cell.source == figure.id and cell.comparability.judged:
                    yield from self._mapped(cell)

    def claims(self) -> Iterator[Problem]:
        judged = {claim for contrast in self.paper.contrasts for claim in contrast.claims}
        for claim in self.paper.claims:
            cell = self.cells[claim.id]
            yield from self._comparability(cell)
            if claim.configured is not None:
                yield from self._configured(claim, claim.configured)
            elif not claim.judged:
                continue
            elif claim.kind in SET_UP:
                yield Problem(
                    claim.id,
                    f"{claim.kind} that is not compared: configured, "
                    "parameter or unmappable: where, or why?",
                )
            elif claim.quantity is not None:
                for operand in claim.quantity.operands():
                    yield from self._operand(claim.id, operand)
                yield from self._computed(claim, claim.quantity)
            elif claim.kind == "qualitative":
                if claim.id not in judged:
                    yield Problem(claim.id, "stated in words, and no contrast names it in claims")
            elif isinstance(claim.value, list):
                yield Problem(claim.id, "several numbers need a quantity, or unmappable: why?")
            else:
                yield from self._mapped(cell)

    def contrasts(self) -> Iterator[Problem]:
        claims = {claim.id: claim for claim in self.paper.claims}
        for contrast in self.paper.contrasts:
            for name in contrast.ids():
                cell = self.cells.get(name)
                if cell is None:
                    yield Problem(contrast.id, f"cells: no cell, claim or point {name}")
                elif cell.comparability.parameter:
                    yield Problem(contrast.id, f"cells: {name} is a setting, not a result")
            yield from self._flat(contrast)
            for name in contrast.claims:
                if name not in claims:
                    yield Problem(contrast.id, f"claims: no claim {name}")
                elif claims[name].kind != "qualitative":
                    yield Problem(contrast.id, f"claims: {name} has a number of its own")

    def _flat(self, contrast: Contrast) -> Iterator[Problem]:
        """Yields a problem if cells that shall be equal have no ratio of one metric."""
        if contrast.kind != "flat":
            return
        names = {self.cells[i].metric for i in contrast.ids() if i in self.cells}
        if len(names) > 1:
            yield Problem(contrast.id, f"flat, of several metrics: {', '.join(sorted(names))}")
        for name in names & set(self.paper.metrics):
            written = self.paper.margins.get(name)
            if self.paper.metrics[name].statistic == "share" or not (written and written.ratio):
                yield Problem(contrast.id, f"flat needs a margin as a ratio, {name} has none")

    def _mapped(self, cell: PublishedCell) -> Iterator[Problem]:
        for what in _unresolved(self.paper, cell):
            yield Problem(cell.id, what)
        if cell.metric in self.paper.metrics and cell.metric not in self.paper.margins:
            yield Problem(cell.id, f"margins: none for '{cell.metric}', write one before the runs")

    def _comparability(self, cell: PublishedCell) -> Iterator[Problem]:
        target = cell.comparability.duplicate_of
        if target is not None:
            other = self.cells.get(target)
            if other is None:
                yield Problem(cell.id, f"duplicate_of: no cell or claim {target}")
            elif other.comparability.duplicate_of is not None:
                yield Problem(cell.id, f"duplicate_of: {target} is a duplicate itself")
            elif cell.value != other.value:
                yield Problem(cell.id, f"duplicate_of: {target} is {other.value}, not {cell.value}")
        erratum = cell.comparability.erratum
        if erratum and isinstance(erratum.judge_as, str) and erratum.judge_as not in self.cells:
            yield Problem(cell.id, f"erratum: no cell or claim {erratum.judge_as}")

    def _operand(self, where: str, operand: Operand) -> Iterator[Problem]:
        if isinstance(operand, At):
            at = PublishedCell(
                where,
                where,
                "",
                "",
                operand.metric,
                "",
                None,
                system=operand.system,
                conditions=operand.conditions,
            )
            for what in _unresolved(self.paper, at):
                yield Problem(where, f"quantity: {what}")
        elif operand not in self.cells:
            yield Problem(where, f"quantity: no cell, claim or point {operand}")

    def _computed(self, claim: Claim, quantity: Quantity) -> Iterator[Problem]:
        """Yields a problem if the number computed from the paper's own cells differs from the
        printed one without an erratum."""
        ours = computed(quantity, self._value)
        judged = claim.erratum.judge_as if claim.erratum else None
        numbers = [n for n in (judged, claim.recomputed, claim.value) if isinstance(n, int | float)]
        if ours is None or not numbers:
            return
        expected = numbers[0]
        agrees = abs(ours - expected) <= (resolution_of(expected) or 0.0)
        bounds = {"lt": ours < expected, "le": ours <= expected,
                  "gt": ours > expected, "ge": ours >= expected}  # fmt: skip
        if not agrees and not bounds.get(str(claim.op), False):
            yield Problem(claim.id, f"quantity: the paper's cells give {ours:.4g}, not {expected}")

    def _value(self, operand: Operand) -> float | None:
        cell = None if isinstance(operand, At) else self.cells.get(operand)
        return cell.value if cell else None

    def _configured(self, claim: Claim, at: Configured) -> Iterator[Problem]:
        if at.system is not None and at.param is not None:
            system = self.checkout.systems.get(at.system)
            if system is None:
                yield Problem(claim.id, f"configured: no system {at.system}")
                return
            if at.variant is not None and at.variant not in system.variants:
                yield Problem(claim.id, f"configured: {at.system} has no variant {at.variant}")
                return
            ours = system.resolve(at.variant or "", {}).get(at.param)
        else:
            kind, name = ("profile", at.profile) if at.profile else ("dataset", at.dataset)
            known = self.checkout.profiles if at.profile else self.checkout.datasets
            if name not in known:
                yield Problem(claim.id, f"configured: no {kind} {name}")
                return
            ours = self.checkout.value_of(kind, str(name), str(at.key))
        value = self.cells[claim.id].value
        if not isinstance(ours, int | float) or value != ours * at.scale:
            yield Problem(claim.id, f"configured: the paper has {value}, we have {ours}")


def _unresolved(paper: Paper, cell: PublishedCell) -> Iterator[str]:
    """Yields a line for each coordinate of a published number that leads to no runs of ours."""
    if cell.metric not in paper.metrics:
        yield f"metric '{cell.metric}' has no number of ours: metrics, or unmappable: why?"
    if cell.system is None:
        yield "no system is named: unmappable?"
    elif cell.system not in paper.systems:
        yield f"system '{cell.system}' has no counterpart of ours: systems, or unmappable: why?"
    left = dict(cell.conditions)
    dataset = left.pop("dataset", None)
    if dataset is None:
        yield "no dataset is named: say which in read_as, or unmappable: why?"
    elif dataset not in paper.datasets:
        yield f"dataset '{dataset}' has no counterpart of ours: datasets, or unmappable: why?"
    for name, value in left.items():
        if not _expressible(paper, cell.system, name, value):
            yield f"condition {name} = {value} cannot be expressed: conditions, or unmappable: why?"


def _expressible(paper: Paper, system: str | None, name: str, value: Any) -> bool:
    """Returns whether a condition selects runs, or is marked as irrelevant (`ignore`)."""
    rule = paper.conditions.get(name)
    if rule == "ignore":
        return True
    if not isinstance(rule, dict):
        return False
    if "column" in rule:
        only = rule.get("systems")
        applies = not only or any(fnmatchcase(str(system), pattern) for pattern in only)
        return not applies or isinstance(value, int | float)
    return value in rule or "*" in rule
