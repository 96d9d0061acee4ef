# SPDX-License-Identifier: Apache-2.0
"""Judges the declared orderings of a paper with our runs."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from typing import Literal

import numpy as np

from slambed.metrics.comparison import holm
from slambed.papers.judged import Judge
from slambed.papers.lookup import Missing
from slambed.papers.margins import published_of, ratio_of
from slambed.papers.measured import Measured, alike
from slambed.papers.published import Contrast, Provenance, PublishedCell
from slambed.papers.verdicts.contrasts import (
    Ordering,
    Published,
    Step,
    judge_blocks,
    judge_contrast,
    paper_shows,
)
from slambed.papers.verdicts.flat import judge_flat
from slambed.papers.verdicts.model import LEVEL, Floats, Mean, OrderOutcome
from slambed.papers.verdicts.trends import page

Chain = tuple[tuple[PublishedCell, Measured], ...]
WAS_RUN: tuple[Missing, ...] = ("no_events", "no_metric")
"""Reasons that apply when runs exist without the number."""


OrderKind = OrderOutcome | Literal["not_run", "half_run", "no_events", "no_number"]
KINDS: dict[OrderKind, str] = {
    "holds": "holds", "reversed": "reversed", "not_seen": "not shown by ours",
    "too_few_runs": "inconclusive, too few runs", "inconclusive": "inconclusive",
    "not_shown_by_paper": "not shown by the paper", "no_events": "run, events not kept",
    "no_number": "no number of ours", "half_run": "not all run", "not_run": "not run",
}  # fmt: skip
"""Words for an ordering's outcome on the page, the terminal and in tables."""
CHAINS = {"blocks": ("sequence", "sequences"), "flat": ("curve", "curves")}
"""Kind of a contrast -> what its chains are called, where they are no pairs."""
PARTLY: dict[OrderKind, str] = {"not_seen": "not shown in full", "reversed": "reversed in part"}
"""Words for an ordering with several pairs, some of which hold."""


@dataclass(frozen=True)
class PairLine:
    """One pair of a claim with several pairs."""

    outcome: str
    """`holds`, `reversed` or `not shown`."""
    paper: str
    ours: str
    where: str
    p_value: float

    @property
    def line(self) -> str:
        """Returns the pair as a list item."""
        place = f", {self.where}" if self.where else ""
        return f"{self.outcome}{place}: paper {self.paper}, ours {self.ours} (p {self.p_value:.2g})"


@dataclass(frozen=True)
class JudgedOrdering:
    """One declared ordering compared with ours."""

    contrast: Contrast
    ordering: Ordering
    provenance: Provenance
    chains: tuple[Chain, ...]
    """In the declared order, every cell with our values."""
    systems: Mapping[str, str]
    """Labels of the paper's systems."""
    missing: Missing | None = None
    """Why a number of ours is missing; None if none is."""
    ignored: frozenset[str] = frozenset()
    """Conditions that do not distinguish cells, such as the paper's number of runs."""

    @property
    def stand_ins(self) -> list[str]:
        """Returns our sequences that stand in for the paper's."""
        found = {m.found.dataset for chain in self.chains for _, m in chain if m.found.stand_in}
        return sorted(found)

    @property
    def begun(self) -> bool:
        """Returns whether we have a value at any of its cells."""
        return any(m.there for chain in self.chains for _, m in chain)

    @property
    def kind(self) -> OrderKind:
        """Returns the outcome, or why there is none."""
        if self.missing is None or self.ordering.outcome != "inconclusive":
            return self.ordering.outcome
        if self.missing == "no_events":
            return "no_events"
        if self.begun:
            return "half_run"
        return "no_number" if self.missing == "no_metric" else "not_run"

    @property
    def words(self) -> str:
        some = any(part.outcome == "holds" for part in self.ordering.parts)
        return PARTLY.get(self.kind, KINDS[self.kind]) if some else KINDS[self.kind]

    @property
    def unshown(self) -> OrderOutcome | None:
        """Returns what ours show of an ordering that the paper's own numbers do not show:
        `holds`, `reversed` (in one pair at least) or `not_seen`. None for every other ordering,
        and without enough runs."""
        p_holds, p_reversed = self.ordering.p_holds, self.ordering.p_reversed
        if self.kind != "not_shown_by_paper" or isnan(p_holds):
            return None
        if p_holds <= LEVEL:
            return "holds"
        return "reversed" if p_reversed <= LEVEL else "not_seen"

    @property
    def holding(self) -> str:
        """Returns `8 of 9 pairs hold`, with the number of reversed pairs; empty for a single
        pair. Where the paper's own numbers show nothing: `ours: holds in none and
        reversed in 25 of 26 pairs`."""
        parts: Counter[str] = Counter(part.outcome for part in self.ordering.parts)
        if self.unshown is not None:
            return f"ours: {self._unshown_words(parts)}"
        if not parts:
            return ""
        other = f", {parts['reversed']} reversed" if parts["reversed"] else ""
        return f"{parts['holds']} of {len(self.chains)} {self.chain_words[1]} hold{other}"

    @property
    def why(self) -> str:
        """Returns the test's reason, and the chance that it would have shown: none where ours
        cannot differ."""
        ordering = self.ordering
        chance = "" if self.cannot_differ else ordering.chance
        return "; ".join(filter(None, (ordering.why, chance)))

    @property
    def cannot_differ(self) -> bool:
        """Returns whether our values are alike in all of its pairs, as where no run lost track."""
        return self._alike().total() == len(self.chains)

    def _alike(self) -> Counter[str]:
        """Counts the pairs in which our values cannot differ, by the reason."""
        return Counter(filter(None, (alike([m for _, m in chain]) for chain in self.chains)))

    @property
    def floor(self) -> str:
        """Returns `no run of ours lost track: nothing to compare`; empty where ours can differ, or
        show the ordering."""
        if self.kind == "holds":
            return ""
        found, whole = self._alike(), self.cannot_differ
        parts = [
            words
            if whole and len(found) == 1
            else f"in {number} of {len(self.chains)} {self.chain_words[1]} {words}"
            for words, number in found.items()
        ]
        return f"{', '.join(parts)}: nothing to compare{'' if whole else ' there'}" if parts else ""

    @property
    def little_tracked(self) -> str:
        """Returns `our runs tracked 12 to 16 % of their frames` where all of them are below
        `LITTLE_TRACKED`: whatever is compared then is about what was tracked. Empty otherwise."""
        shares = self._tracked()
        if not shares or max(shares) >= LITTLE_TRACKED:
            return ""
        least, most = (f"{100 * share:.0f}" for share in (min(shares), max(shares)))
        return f"our runs tracked {f'{least} to ' * (least != most)}{most} % of their frames"

    @property
    def most_tracked(self) -> float:
        """Returns the largest share of frames that one of our runs tracked; NaN if none is
        known."""
        return max(self._tracked(), default=float("nan"))

    def _tracked(self) -> list[float]:
        """Returns the share of frames with a pose of each of our runs."""
        return [
            float(share)
            for chain in self.chains
            for _, m in chain
            if m.there and m.found.runs is not None and "coverage" in m.found.runs
            for share in m.found.runs["coverage"].dropna()
        ]

    def _unshown_words(self, parts: Counter[str]) -> str:
        if self.unshown == "holds":
            return "holds"
        held, reverse = parts["holds"], parts["reversed"]
        if not held and not reverse:
            return "reversed" if self.unshown == "reversed" else "not shown either"
        # Otherwise the other pairs would be taken for pairs that hold.
        also = f" and reversed in {reverse}" if reverse else ""
        return f"holds in {held or 'none'}{also} of {len(self.chains)} {self.chain_words[1]}"

    @property
    def chain_words(self) -> tuple[str, str]:
        """Returns what its chains are called: one, several."""
        return CHAINS.get(self.contrast.kind, ("pair", "pairs"))

    @property
    def others(self) -> list[PairLine]:
        """Returns all pairs except the one that `values` shows: reversed ones first, then the
        weakest."""
        shown = self.ordering.decides or 0
        lines = [line for number, line in enumerate(self.pairs) if number != shown]
        order = ("reversed", "not shown", "holds")
        return sorted(lines, key=lambda line: (order.index(line.outcome), -line.p_value))

    @property
    def pairs(self) -> list[PairLine]:
        """Returns every pair, if there are several and we have runs for them."""
        if not self.ordering.parts:
            return []
        return [
            PairLine(
                part.outcome.replace("_", " "),
                " ".join(self._ends(chain, ours=False)),
                " ".join(self._ends(chain, ours=True)),
                self._where(chain),
                part.p_value,
            )
            for chain, part in zip(self.chains, self.ordering.parts, strict=True)
        ]

    def values(self, ours: bool) -> str:
        """Returns the ends of the decisive chain, printed or ours, as `Relocate: 446 < Edge-SLAM:
        474 ms`; a trend as `rtt 0: 20 → rtt 80: 73 %`."""
        if ours and not self.begun:
            return KINDS["not_run" if self.missing is None else self.kind]
        decides = self.ordering.decides
        chain = self.chains[decides or 0]
        reported, unit = self._ends(chain, ours)
        if not unit and reported == IN_WORDS:
            return reported
        which = "first" if decides is None else "weakest"
        if decides is not None and self.ordering.outcome == "reversed":
            which = "clearest"
        place = f", {where}" if (where := self._where(chain)) else ""
        many = len(self.chains) > 1
        more = f" ({which} of {len(self.chains)} {self.chain_words[1]}{place})" if many else ""
        return f"{reported} {unit}".strip() + more

    def _ends(self, chain: Chain, ours: bool) -> tuple[str, str]:
        """Returns both ends of a chain, and the unit to write behind them."""
        ends = [chain[0], chain[-1]]
        unit = ends[0][0].unit
        if ours:
            texts = [_value(m) for _, m in ends]
            numbers = [_number(m) for _, m in ends]
        else:
            texts = [NO_NUMBER if c.value is None else f"{c.value:g}" for c, _ in ends]
            numbers = [c.value for c, _ in ends]
        if set(texts) == {NO_NUMBER}:
            return IN_WORDS, ""
        if texts[-1] == NO_NUMBER:
            texts[0], unit = f"{texts[0]} {unit}".strip(), ""
        between = " → " if len(chain) > 2 else f" {_relation(*numbers)} "
        names = _names(ends[0][0], ends[1][0], self.systems, self.ignored)
        message = between.join(
            f"{name}: {text}" if name else text for name, text in zip(names, texts, strict=True)
        )
        counts = ours and any(m.there and m.is_share for _, m in ends)
        return message, "runs" if counts else unit  # 11/100 is no percentage

    def _where(self, chain: Chain) -> str:
        """Returns the sequence, and what else both ends share but other pairs do not."""
        common = [_common(c) for c in self.chains]
        own = _common(chain)
        reported = [str(own["dataset"])] if "dataset" in own else []
        reported += [
            str(value) if name == "metric" else f"{name} {value}"
            for name, value in own.items()
            if name not in self.ignored | {"dataset"}
            and any(other.get(name) != value for other in common)
        ]
        return ", ".join(reported)


LITTLE_TRACKED = 0.5
"""Share of frames; if no run tracked as many, an ordering's outcome says so."""

IN_WORDS = "in words"


def _common(chain: Chain) -> dict[str, object]:
    """Returns the conditions and the metric that both ends of a chain share."""
    first, last = ({"metric": c.metric} | c.conditions for c, _ in (chain[0], chain[-1]))
    return {name: value for name, value in first.items() if last.get(name) == value}


NO_NUMBER = "not printed"
"""Shown for an end of a chain that the paper only plots or describes in words."""


def _names(
    first: PublishedCell, last: PublishedCell, systems: Mapping[str, str], ignored: frozenset[str]
) -> list[str]:
    """Returns what distinguishes the two cells, in the paper's terms."""
    found = []
    for cell, other in ((first, last), (last, first)):
        parts = []
        if cell.system != other.system and cell.system is not None:
            parts.append(systems.get(cell.system, cell.system))
        parts += [
            f"{name} {value}"
            for name, value in cell.conditions.items()
            if name not in ignored and other.conditions.get(name) != value
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


OUTCOMES: dict[OrderKind, str] = {
    "holds": "hold", "reversed": "reversed", "not_seen": "not_seen", "too_few_runs": "inconclusive",
    "inconclusive": "inconclusive", "not_shown_by_paper": "unshown", "not_run": "waiting",
    "half_run": "half", "no_events": "waiting", "no_number": "waiting",
}  # fmt: skip
"""Outcome of an ordering -> its group in the headline."""


def outcome_of(item: JudgedOrdering) -> str:
    """Returns an ordering's group, for headlines: hold, reversed, in_part, not_seen,
    inconclusive (with too few runs too), unshown (by the paper's own numbers), half (some of its
    numbers are not run), waiting (no number of ours) or fitted."""
    group = OUTCOMES[item.kind]
    if item.provenance == "fitted" and group in ("hold", "reversed", "not_seen"):
        return "fitted"
    return "in_part" if group == "reversed" and item.words == PARTLY["reversed"] else group


def judge_orderings(judge: Judge) -> list[JudgedOrdering]:
    """Judges all contrasts of the paper; the paper's own p values are Holm-adjusted per table."""
    found = [OrderingCase(judge, contrast) for contrast in judge.paper.contrasts]
    adjusted = papers_p_values(found)
    return [case.judged(adjusted.get(case.contrast.id)) for case in found]


def papers_p_values(cases: Sequence["OrderingCase"]) -> dict[str, float]:
    """Returns the p value of each testable ordering by the paper's own numbers, Holm-adjusted per
    table, by the id of its contrast."""
    by_table: dict[str, list[OrderingCase]] = {}
    for case in cases:
        if case.testable:
            by_table.setdefault(case.source, []).append(case)
    found: dict[str, float] = {}
    for group in by_table.values():
        p_values = holm([case.p_paper() for case in group])
        found |= {c.contrast.id: float(p) for c, p in zip(group, p_values, strict=True)}
    return found


class OrderingCase:
    """A contrast with the paper's numbers and ours, in rising order."""

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
        """Returns the table whose contrasts are adjusted together."""
        return self.chains[0][0][0].source

    def _published(self, cell: PublishedCell) -> Published | None:
        metric = self.judge.paper.metrics.get(cell.metric)
        return published_of(cell, metric is not None and metric.statistic == "share")

    def steps(self) -> list[Step]:
        """Returns the values that should rise, chain by chain."""
        found = []
        for chain in self.rising:
            paper = [self._published(c) for c, _ in chain] if self.testable else []
            ours = tuple(m.ours for _, m in chain)
            label = f"{chain[0][0].id} and {chain[-1][0].id}"
            found.append(Step(ours, tuple(p for p in paper if p is not None), label))
        return found

    def table(self, ours: bool) -> Floats:
        """Returns the means, one row per chain; NaN where a value is missing."""
        rows = [
            [(float(np.mean(m.values)) if m.there else None) if ours else c.value for c, m in chain]
            for chain in self.rising
        ]
        return np.array(rows, dtype=np.float64)  # a None becomes NaN

    def _spreads(self) -> tuple[Floats, Floats]:
        """Returns our coefficients of variation and numbers of runs, one row per chain."""
        spread = [[Mean.of(m.values).cv for _, m in chain] for chain in self.rising]
        runs = [[len(m.values) for _, m in chain] for chain in self.rising]
        return np.array(spread, dtype=np.float64), np.array(runs, dtype=np.float64)

    def p_paper(self) -> float:
        """Returns the p value of the paper's own numbers, not yet adjusted."""
        if self.contrast.kind == "blocks":
            return page(self.table(ours=False))
        return paper_shows(self.steps())[0]

    def judged(self, p_paper: float | None) -> JudgedOrdering:
        """Judges the contrast. `p_paper` is adjusted; None where it could not be tested."""
        used = [(c, m) for chain in self.chains for c, m in chain]
        provenance: Provenance = "measured"
        if any(c.id in self.judge.fitted for c, m in used):
            provenance = "fitted"
        elif any(m.found.stand_in for _, m in used):
            provenance = "stand_in"
        paper = self.judge.paper
        labels = {name: system.label for name, system in paper.systems.items()}
        ignored = frozenset(n for n, rule in paper.conditions.items() if rule == "ignore")
        ordering = self._ordering(p_paper)
        missing = self._missing()
        return JudgedOrdering(
            self.contrast,
            ordering,
            provenance,
            self.chains,
            labels,
            missing.found.missing or "too_few_runs" if missing else None,
            ignored,
        )

    def _missing(self) -> Measured | None:
        """Returns the first cell without our number, preferably one that was not run."""
        absent = [m for chain in self.chains for _, m in chain if not m.there]
        return min(absent, key=lambda m: m.found.missing in WAS_RUN, default=None)

    def _ordering(self, p_paper: float | None) -> Ordering:
        if self.contrast.basis == "data" and p_paper is None:
            why = "the paper prints no numbers that could be tested"
            return Ordering("not_shown_by_paper", why)
        if missing := self._missing():
            if p_paper is not None and p_paper > LEVEL:
                return judge_contrast(self.steps(), p_paper, self._assumed())
            why = missing.found.reason
            return Ordering(
                "inconclusive", why if missing.found.missing in WAS_RUN else f"not run: {why}"
            )
        if mixed := self._mixed():
            return Ordering("inconclusive", mixed)
        if self.contrast.kind == "blocks":
            return judge_blocks(
                self.table(ours=True), self.table(ours=False), p_paper, *self._spreads()
            )
        steps = self.steps()
        if self.contrast.kind == "flat":
            metric = self.chains[0][0][0].metric
            return judge_flat(steps, ratio_of(self.judge.paper, metric))
        if p_paper is None:
            return judge_contrast(steps, float("nan"))
        return judge_contrast(steps, p_paper, self._assumed())

    def _assumed(self) -> tuple[str, ...]:
        return () if self.contrast.kind == "blocks" else paper_shows(self.steps())[1]

    def _mixed(self) -> str:
        """Returns why cells cannot be compared: on stand-ins, an ordering counts only within one
        sequence."""
        ours: dict[str, set[str]] = {}
        for chain in self.chains:
            for cell, measured in chain:
                ours.setdefault(str(cell.conditions.get("dataset")), set()).add(
                    measured.found.dataset
                )
        for name, datasets in ours.items():
            if len(datasets) > 1:
                return (
                    f"its numbers on {name} are of several sequences: {', '.join(sorted(datasets))}"
                )
        return ""
