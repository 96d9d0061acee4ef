# SPDX-License-Identifier: Apache-2.0
"""Judges a published number: by provenance first, then by its rule
(docs/explanation/verdicts.md)."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, cast

import pandas as pd

from slambed.papers.fitted import OWN_DATA, SET_TO_MATCH, far_off
from slambed.papers.lookup import MISSING_WORDS, Found, Missing, Pool
from slambed.papers.margins import firm_contrasts, margin_of_cell, published_of
from slambed.papers.measured import NOTHING, Measured, alike, measure
from slambed.papers.published import BOUNDS, Contrast, Paper, Provenance, PublishedCell
from slambed.papers.quantities import judge_quantity
from slambed.papers.verdicts.means import judge_mean
from slambed.papers.verdicts.model import Mean, Share, Verdict, not_run
from slambed.papers.verdicts.prediction import enough, mean_position, share_position
from slambed.papers.verdicts.shares import judge_share
from slambed.papers.verdicts.statements import judge_about, judge_bound, judge_range, judge_set

Mark = Literal["R", "D", "I", "N", "E", "F", "S", "P"]
MARKS: dict[Mark, str] = {
    "R": "reproduced", "D": "differs", "I": "inconclusive", "N": "not run",
    "E": MISSING_WORDS["no_events"], "F": "fitted", "S": "stand-in", "P": "parameter or duplicate",
}  # fmt: skip
MARK_NAMES: dict[Mark, str] = MARKS | {
    "N": "no number of ours", "S": "substitute sequence",
}  # fmt: skip
"""The same for readers; `MARKS` are also the headings of a table that scripts read."""
NEVER_COUNTED: dict[Provenance, Mark] = {
    "fitted": "F", "same_data": "F", "stand_in": "S", "parameter": "P", "duplicate": "P",
    "erratum": "P",
}  # fmt: skip


@dataclass(frozen=True)
class Judged:
    """One published number compared with ours, for one kind of engine."""

    cell: PublishedCell
    provenance: Provenance
    verdict: Verdict
    measured: Measured
    why: str
    missing: Missing | None = None
    position: float | None = None
    """Quantile of the published number in our prediction (only for numbers outside every fit)."""

    @property
    def mark(self) -> Mark:
        """Returns one of eight marks, by which numbers are drawn, counted and colored."""
        if self.provenance in NEVER_COUNTED:
            return NEVER_COUNTED[self.provenance]
        if self.missing == "no_events":
            return "E"
        marks: dict[str, Mark] = {"reproduced": "R", "differs": "D", "inconclusive": "I"}
        return marks.get(self.verdict.outcome, "N")

    @property
    def hint(self) -> str:
        """Returns how far ours is from a number that a device was fitted to."""
        if self.provenance != "fitted":
            return ""
        return far_off(self.cell, self.measured, self.verdict)

    @property
    def stated(self) -> str:
        return printed(self.cell)

    @property
    def ours(self) -> str:
        """Returns our number in the paper's unit, with its count of runs."""
        return shown(self.measured) if self.measured.there else "-"


def shown(measured: Measured) -> str:
    """Returns our number in the paper's unit, with its spread and count of runs."""
    if measured.is_share:
        share = measured.share
        return f"{100 * share.value:.3g} ({share.bad}/{share.runs})"
    mean = measured.mean
    spread = f" ± {mean.sd:.2g}" if mean.sd is not None else ""
    return f"{mean.value:.4g}{spread} (n {mean.count})"


def printed(cell: PublishedCell) -> str:
    """Returns a published number with its spread and unit."""
    claim = cell.claim
    if cell.value is None:
        value = claim.value if claim is not None else None
        text = " to ".join(f"{v:g}" for v in value) if isinstance(value, list) else str(value)
        return f"{text} {cell.unit}".strip()
    signs = {"about": "about ", "lt": "< ", "le": "≤ ", "gt": "> ", "ge": "≥ ", "up_to": "up to "}
    sign = signs.get(str(claim.op), "") if claim is not None else ""
    spread = f" ± {cell.spread:g}" if cell.spread is not None else ""
    return f"{sign}{cell.value:g}{spread} {cell.unit}".strip()


def is_number(cell: PublishedCell) -> bool:
    """Returns whether the paper prints a number here. Every count on the page is out of these."""
    listed = cell.claim is not None and isinstance(cell.claim.value, list)
    return cell.value is not None or listed


@dataclass
class Judge:
    """Judges the numbers of one paper for one kind of engine."""

    paper: Paper
    pool: Pool
    cells: dict[str, PublishedCell]
    fitted: frozenset[str]
    """Ids of the numbers that the devices of these runs were fitted to."""
    known: dict[str, Measured] = field(default_factory=dict)
    """Cache of our values by cell id, because orderings need them again."""

    @cached_property
    def firm(self) -> list[Contrast]:
        return firm_contrasts(self.paper, self.cells)

    def judge(self, cell: PublishedCell) -> Judged:
        """Judges a cell by provenance, then by value."""
        comparability = cell.comparability
        if comparability.duplicate_of is not None:
            return self._aside(
                cell, "duplicate", f"the same number as {comparability.duplicate_of}"
            )
        if comparability.parameter is not None:
            return self._aside(cell, "parameter", comparability.parameter)
        if cell.claim is not None and cell.claim.kind in ("setup", "parameter", "background"):
            return self._aside(cell, "parameter", f"{cell.claim.kind}, not a result")
        if comparability.same_data is not None:
            return self._aside(cell, "same_data", f"{OWN_DATA}: {comparability.same_data}")
        if comparability.unmappable is not None:
            return self._missing(cell, "no_metric", comparability.unmappable)
        if (erratum := comparability.erratum) is not None:
            if erratum.skip or isinstance(erratum.judge_as, str):
                return self._aside(cell, "erratum", erratum.why)
            return self._judged(replace(cell, value=float(erratum.judge_as or 0.0)), erratum.why)
        return self._judged(cell, comparability.read_as or "")

    def measured(self, cell: PublishedCell) -> Measured:
        """Returns our values at a cell's coordinates."""
        if cell.id not in self.known:
            pool = self.pool.about(self.paper, cell.source)
            found = measure(self.paper, pool, cell.metric, cell.system, cell.conditions)
            self.known[cell.id] = found
        return self.known[cell.id]

    def _aside(self, cell: PublishedCell, provenance: Provenance, why: str) -> Judged:
        nothing = Measured(Found(None, None, why), NOTHING)
        return Judged(cell, provenance, not_run(why), nothing, why)

    def _missing(
        self, cell: PublishedCell, missing: Missing, why: str, runs: pd.DataFrame | None = None
    ) -> Judged:
        nothing = Measured(Found(runs, missing, why), NOTHING)
        return Judged(cell, "measured", not_run(why), nothing, why, missing)

    def _judged(self, cell: PublishedCell, note: str) -> Judged:
        claim = cell.claim
        if claim is not None and claim.quantity is not None:
            verdict, measured = judge_quantity(self.paper, self.pool, self.cells, cell)
        else:
            measured = self.measured(cell)
            verdict = self._value(cell, measured) if measured.there else not_run("")
        found = measured.found
        # Runs without a single event have no values of ours, but do differ.
        if not measured.there and verdict.outcome != "differs":
            missing = found.missing or "too_few_runs"
            return self._missing(cell, missing, found.reason, found.runs)
        provenance: Provenance = "measured"
        if cell.id in self.fitted:
            provenance = "fitted"
        elif found.stand_in:
            provenance = "stand_in"
        metric = self.paper.metrics.get(cell.metric)
        readings = metric.other_readings if metric is not None else []
        still_open = [reading for reading in readings if not reading.excluded]
        if still_open and verdict.outcome == "reproduced":
            other = still_open[0]
            why = f"the paper's words may mean {other.key} as well: {other.note}"
            verdict = replace(verdict, outcome="inconclusive", why=f"{why}; {verdict.why}")
        far = far_off(cell, measured, verdict)
        read_as = metric.read_as if metric is not None and far else None
        cause = {
            "fitted": "; ".join(w for w in (SET_TO_MATCH, far, read_as) if w),
            "stand_in": f"measured on {found.dataset}: direction only",
        }.get(provenance, verdict.why)
        beside = "" if claim is not None and claim.quantity is not None else self._beside(cell)
        told = metric.note if metric else ""
        why = "; ".join(w for w in (cause, alike([measured]), note, told, beside) if w)
        position = None
        if provenance == "measured" and (claim is None or claim.quantity is None):
            position = self._position(cell, measured)
        return Judged(cell, provenance, verdict, measured, why, None, position)

    def _beside(self, cell: PublishedCell) -> str:
        """Returns our numbers under other readings of the paper's definition."""
        metric = self.paper.metrics.get(cell.metric)
        if metric is None:
            return ""
        found = []
        for reading in metric.other_readings:
            read = {cell.metric: metric.model_copy(update={"key": reading.key, "plus": []})}
            paper = self.paper.model_copy(update={"metrics": read})
            pool = self.pool.about(self.paper, cell.source)
            ours = measure(paper, pool, cell.metric, cell.system, cell.conditions)
            if ours.there:
                found.append(f"{reading.key} ({reading.note}): {shown(ours)}")
        return "; ".join(found)

    def _value(self, cell: PublishedCell, measured: Measured) -> Verdict:
        claim = cell.claim
        ours = measured.share if measured.is_share else measured.mean
        scale = 0.01 if measured.is_share else 1.0
        op = claim.op if claim is not None else "eq"
        if claim is not None and isinstance(claim.value, list):
            stated = [float(v) * scale for v in claim.value]
            if op == "range":
                return judge_range(ours, stated[0], stated[1])
            mean = measured.mean
            part = margin_of_cell(self.paper, self.cells, cell, self.firm).value
            return judge_set([mean] * len(stated), [Mean(v) for v in stated], part)
        assert cell.value is not None
        if op in BOUNDS:
            bound = cast(Literal["lt", "le", "gt", "ge"], op)
            return judge_bound(ours, bound, cell.value * scale)
        if op == "up_to":
            why = "'up to' needs the quantity whose maximum it is"
            return Verdict("inconclusive", why)
        published = published_of(cell, measured.is_share)
        if published is None:
            return Verdict("inconclusive", "the paper prints no number of runs for this share")
        margin = margin_of_cell(self.paper, self.cells, cell, self.firm)
        if margin.ordering_only:
            return Verdict("inconclusive", f"ordering only: {margin.why}", margin=margin.value)
        if isinstance(ours, Share) and isinstance(published, Share):
            return judge_share(ours, published, margin.value)
        assert isinstance(ours, Mean) and isinstance(published, Mean)
        if op == "about":
            return judge_about(ours, published)
        return judge_mean(ours, published, margin.value, margin.kind)

    def _position(self, cell: PublishedCell, measured: Measured) -> float | None:
        published = published_of(cell, measured.is_share)
        if not enough(len(measured.values)) or published is None:
            return None
        if isinstance(published, Share):
            return share_position(measured.share, published)
        return mean_position(measured.mean, published) if published.count else None
