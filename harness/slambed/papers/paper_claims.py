# SPDX-License-Identifier: Apache-2.0
"""The main claims of a paper for display: badge, both values, pairs, notes."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from slambed.papers.codes import spelled
from slambed.papers.compare import Column, PaperVerdicts
from slambed.papers.lookup import LIVE
from slambed.papers.orderings import KINDS, JudgedOrdering, OrderKind, PairLine, outcome_of
from slambed.papers.published import Paper, Provenance
from slambed.papers.verdicts.model import MOST_RUNS, SEEN_POWER

WEAK: dict[Provenance, str] = {"stand_in": "on a substitute sequence", "fitted": "fitted"}
"""Added to an outcome that is no evidence about the paper's own sequences."""
WEAK_BADGE = {
    "on a substitute sequence": " ON A SUBSTITUTE SEQUENCE",
    "fitted": " (FITTED, NO EVIDENCE)",
}
Outcome = tuple[JudgedOrdering, str]
"""An ordering and its group."""
SHOWN: tuple[OrderKind, ...] = ("holds", "reversed", "not_seen")
"""Outcomes that rest on our runs, so they must name stand-ins and fits."""
DEFINITIONS: dict[OrderKind, str] = {
    "not_seen": "our runs do not show it (in full: not for each of its pairs), and would have with "
    f"a chance of at least {100 * SEEN_POWER:.0f} % if the paper's numbers were true of them",
    "too_few_runs": "our runs do not show it, and may well have missed it; beside it stands how "
    "many would decide",
    "inconclusive": "our runs do not show it, and nothing printed says how many would",
    "not_shown_by_paper": "the paper's own numbers do not show it beyond doubt, so it cannot be "
    "confirmed; what ours show stands beside it",
    "no_events": "our runs are kept without the events that the number is computed from",
}
NAMED = 2
"""How many failing pairs the terminal names, besides the weakest."""


@dataclass(frozen=True)
class ClaimLine:
    """One main claim for one kind of engine."""

    engine: str
    badge: str
    words: str
    """The badge, without the mark for a stand-in or a fit."""
    kind: OrderKind
    """Outcome, or why there is none."""
    style: str
    """Its CSS classes, which show outcomes that are no evidence differently."""
    says: str
    paper: str
    ours: str
    note: str
    where: str
    anchor: str
    weak: str
    """Why it is no evidence (fitted, or on a substitute sequence); else empty."""
    chance: str
    """The chance that it would have shown, or how many runs would decide; else empty."""
    pairs: str
    """`8 of 9 pairs hold`, empty for a single pair; and where ours cannot differ, why."""
    others: list[PairLine]
    """The pairs besides the shown one, failing ones first."""
    chain_words: tuple[str, str]
    """What the pairs are called: one, several."""
    begun: bool
    """Whether a number of ours is in it."""

    @property
    def failing(self) -> list[PairLine]:
        """Returns the pairs besides the shown one that do not hold."""
        return [pair for pair in self.others if pair.outcome != "holds"]

    @property
    def other_pairs(self) -> str:
        """Returns the heading of the fold-out list of other pairs."""
        many, failing = len(self.others), len(self.failing)
        one, several = self.chain_words
        what = f"the other {one}" if many == 1 else f"the other {many} {several}"
        if not failing:
            return what
        if failing == many:
            return f"{what}, not holding either"
        return f"{what}, {failing} not holding"

    @property
    def line(self) -> str:
        """Returns the claim for the terminal."""
        message = f"[{self.badge}] {self.says}: paper {self.paper}, ours {self.ours}"
        parts = [f"; {words}" for words in (self.pairs, self.chance) if words]
        if failing := self.failing:
            more = f" and {len(failing) - NAMED} more" if len(failing) > NAMED else ""
            named = ", ".join(f"{pair.where} {pair.ours}".strip() for pair in failing[:NAMED])
            parts.append(f"; nor do {named}{more}")
        return message + "".join(parts)


def claim_lines(column: Column, every: bool = False) -> list[ClaimLine]:
    """Returns the main claims, or all declared orderings if asked or none is marked as main."""
    main = [o for o in column.orderings if o.contrast.main and not every] or column.orderings
    return [_claim(column.engine, o) for o in main]


def claims_per_engine(
    columns: list[Column], paper: Paper
) -> tuple[list[list[ClaimLine]], list[list[ClaimLine]]]:
    """Returns every ordering with its lines per kind of engine: the main claims, and the others."""
    main = {line.anchor for column in columns for line in claim_lines(column)}
    found = [
        [replace(line, note=spelled(line.note, paper)) for line in claim_lines(column, every=True)]
        for column in columns
    ]
    rows = [_with_number(lines) for lines in zip(*found, strict=True)]
    return [r for r in rows if r[0].anchor in main], [r for r in rows if r[0].anchor not in main]


def _with_number(lines: Sequence[ClaimLine]) -> list[ClaimLine]:
    """Leaves out the kinds of engine that have no number, where another one has."""
    told = [line for line in lines if line.begun]
    return told or list(lines)


@dataclass(frozen=True)
class ClaimGroup:
    """The orderings of a paper that came out alike."""

    outcome: str
    """Key of `OUTCOME_WORDS`, for the color."""
    heading: str
    lines: list[ClaimLine]
    more: int = 0
    """How many further orderings came out so; they are on the paper's page only."""


HEADINGS = {
    "hold": "Held",
    "reversed": "Reversed",
    "in_part": "Reversed in part",
    "not_seen": "Not shown by ours",
    "inconclusive": "Inconclusive",
    "unshown": "Not shown by the paper's own numbers",
    "half": "Not all run",
    "waiting": "No number of ours",
    "live": "Played live only",
    "virtual": "Played in virtual time only",
    "fitted": "Numbers were set to match",
}
NOT_BEGUN = ("waiting", "live", "virtual")
"""Groups of orderings that this kind of engine did not play."""


def with_outcomes(verdicts: PaperVerdicts, column: Column) -> list[Outcome]:
    """Returns each ordering with its group (`outcome_of`) among runs of one kind of engine; `live`
    or `virtual` where only the other kind played it."""
    others = {
        item.contrast.id: "live" if other.engine == LIVE else "virtual"
        for other in verdicts.columns
        for item in other.orderings
        if other is not column and outcome_of(item) not in ("waiting", "half")
    }
    found = []
    for item in column.orderings:
        outcome = outcome_of(item)
        if outcome == "waiting" and not item.begun:
            outcome = others.get(item.contrast.id, outcome)
        found.append((item, outcome))
    return found


def claim_groups(verdicts: PaperVerdicts, column: Column) -> list[ClaimGroup]:
    """Returns the main claims by outcome, with every further ordering that holds or is reversed,
    or of which ours show more than the paper's own numbers."""
    main = {line.anchor for line in claim_lines(column)}
    by_outcome: dict[str, list[ClaimLine]] = {}
    further: Counter[str] = Counter()
    lines = claim_lines(column, every=True)
    for (item, outcome), line in zip(with_outcomes(verdicts, column), lines, strict=True):
        told = outcome in ("hold", "reversed", "in_part") or item.unshown in ("holds", "reversed")
        if line.anchor in main or told:
            by_outcome.setdefault(outcome, []).append(line)
        else:
            further[outcome] += 1
    return [
        ClaimGroup(outcome, words, by_outcome.get(outcome, []), further[outcome])
        for outcome, words in HEADINGS.items()
        if outcome in by_outcome or further[outcome]
    ]


def in_short(assumed: Sequence[str]) -> list[str]:
    """Merges assumptions that differ only in their percentage, with the smallest and the
    largest."""
    percents: dict[str, list[int]] = {}
    for text in assumed:
        what, _, rest = text.partition(" (")
        percent = rest.removesuffix("%)")
        percents.setdefault(what if percent.isdigit() else text, []).extend(
            [int(percent)] if percent.isdigit() else []
        )
    return [
        f"{what} ({min(found)} to {max(found)} %)"
        if len(found) > 1
        else f"{what} ({found[0]} %)"
        if found
        else what
        for what, found in percents.items()
    ]


def _claim(engine: str, item: JudgedOrdering) -> ClaimLine:
    ordering, kind = item.ordering, item.kind
    weak = WEAK.get(item.provenance, "") if kind in SHOWN else ""
    fitted = item.provenance == "fitted"
    shade = ("weak fitted" if fitted else "weak") if weak else ""
    notes = [item.why]
    if fitted:
        notes.insert(0, "a device was set to match some of these numbers: no evidence")
    if item.stand_ins:
        notes.insert(0, f"played on {', '.join(item.stand_ins)}")
    chance = _chance(item)
    if kind == "too_few_runs" and chance:
        notes.append(chance)
    if ordering.assumed:
        notes.append(f"assumed: {', '.join(in_short(ordering.assumed))}")
    contrast = item.contrast
    if little := item.little_tracked:
        notes.insert(0, little)
    if contrast.note:
        notes.insert(0, contrast.note.removesuffix("."))
    lines = f", {text_lines(contrast.lines)} of its text" if contrast.lines else ""
    return ClaimLine(
        engine,
        item.words.upper() + WEAK_BADGE.get(weak, ""),
        item.words,
        kind,
        f"{kind} {shade}".strip(),
        contrast.says,
        item.values(False),
        item.values(True),
        "; ".join(notes),
        contrast.where + lines,
        contrast.id,
        weak,
        chance,
        "; ".join(filter(None, (item.holding, item.floor))),
        item.others,
        item.chain_words,
        item.begun,
    )


def _chance(item: JudgedOrdering) -> str:
    ordering = item.ordering
    by = f", by {ordering.spread}" if ordering.spread else ""
    if item.kind == "not_seen" and ordering.power is not None and not item.cannot_differ:
        return f"would have shown with a chance of {100 * ordering.power:.0f} %{by}"
    if item.kind != "too_few_runs":
        return ""
    if ordering.runs_needed is not None:
        return f"{ordering.runs_needed} runs of each combination would decide{by}"
    tested = ordering.power is not None
    return f"more than {MOST_RUNS} runs of each combination are needed" if tested else ""


def definitions(columns: list[Column]) -> list[tuple[str, str]]:
    """Returns definitions of outcomes on this page that need an explanation."""
    found = {line.kind for column in columns for line in claim_lines(column, every=True)}
    return [(KINDS[kind].upper(), words) for kind, words in DEFINITIONS.items() if kind in found]


def text_lines(lines: list[int]) -> str:
    """Returns `line 12` or `lines 12, 14` of the paper's plain text."""
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(map(str, lines))}"
