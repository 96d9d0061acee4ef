# SPDX-License-Identifier: Apache-2.0
"""Computes what a paper's page shows: headline, bars, copies of tables, reasons, conditions of the
runs."""

from collections import Counter
from dataclasses import dataclass, field, replace
from functools import lru_cache

from slambed.data.download import how_to_get
from slambed.data.recipe import Dataset
from slambed.data.recipe_file import load_recipe
from slambed.data.stand_in import played_instead
from slambed.errors import SlambedError
from slambed.files.outputs import is_file
from slambed.native import repository_root
from slambed.papers.beside import beside
from slambed.papers.codes import spelled
from slambed.papers.compare import Column, PaperVerdicts
from slambed.papers.fitted import OWN_DATA, SET_TO_MATCH
from slambed.papers.judged import MARK_NAMES, MARKS, Judged, Mark
from slambed.papers.kept import no_runs_words
from slambed.papers.orderings import JudgedOrdering
from slambed.papers.origin import origin_words
from slambed.papers.paper_claims import Outcome, claim_lines, with_outcomes
from slambed.papers.paper_runs import experiments_of
from slambed.papers.published import Paper, PublishedTable
from slambed.papers.published.paper_plan import read_plan
from slambed.papers.reasons import REASON_WORDS, Reason, count, reason_of
from slambed.papers.registered import PlanLine, experiments_behind, plan_lines, plan_words
from slambed.report.load import Results

MARK_WORDS: dict[Mark, str] = MARK_NAMES | {
    "F": "fitted: set to match, no evidence",
    "S": "substitute sequence: played instead of the paper's, shown and not judged",
    "E": "run, but kept without events",
}
"""Words for the legend."""
NO_DETAILS: dict[Reason | None, str] = {
    reason: REASON_WORDS[reason] for reason in ("not_played", "live", "virtual")
}
"""Reasons that are the same for all their numbers."""
REASONS = 3
SHOWN_CLAIMS = 4


@dataclass(frozen=True)
class Bar:
    """One stacked bar."""

    label: str
    anchor: str
    total: int
    segments: list[tuple[Mark, int, float]]
    """Mark, count, percent of the bar."""


@dataclass(frozen=True)
class TwinCell:
    """One cell of a table's copy."""

    id: str
    paper: str
    ours: list[tuple[str, Mark, str, str]]
    """Per engine: our number, mark, reason, and and how far off a fitted number is, or where the
    number of a substitute sequence lies."""


@dataclass(frozen=True)
class Twin:
    """A published table as a heat map."""

    table: PublishedTable
    headings: list[str]
    rows: list[tuple[str, list[TwinCell | None]]]


@dataclass(frozen=True)
class Circumstance:
    """The conditions under which the runs of one kind of engine were made."""

    engine: str
    line: str
    commits: list[str]
    seeds: dict[str, str]
    """By experiment."""
    fits: list[str]
    experiments: list[str]
    plan: list[PlanLine]


def bars(verdicts: PaperVerdicts, column: Column) -> list[Bar]:
    """Returns one bar per table and one for the text, over all printed numbers."""
    return [bar(label, name, column, ids) for name, label, ids in verdicts.groups()]


def bar(label: str, anchor: str, column: Column, ids: list[str]) -> Bar:
    """Counts these numbers by mark."""
    found = column.marks(ids)
    segments = [(m, found[m], 100 * found[m] / len(ids)) for m in MARKS if found[m]]
    return Bar(label, anchor, len(ids), segments)


def twin(verdicts: PaperVerdicts, table: PublishedTable) -> Twin:
    """Returns the table with the paper's number, ours and the mark in every cell."""
    rows: list[tuple[str, list[TwinCell | None]]] = []
    for name, row in table.rows.items():
        cells: list[TwinCell | None] = []
        for column in table.columns:
            place = f"{table.id}.{name}.{column}"
            if place not in verdicts.cells:
                words = row.values.get(column)
                cells.append(None if words is None else TwinCell("", str(words), []))
                continue
            judged = [c.rows[place] for c in verdicts.columns]
            ours = [
                (_short(j), j.mark, spelled(j.why, verdicts.paper), j.hint or _place_beside(j))
                for j in judged
            ]
            cells.append(TwinCell(place, _number(judged[0]), ours))
        rows.append((row.label, cells))
    return Twin(table, [c.label for c in table.columns.values()], rows)


def _place_beside(row: Judged) -> str:
    """Returns `0.44 x print` for a number that has no verdict because of its sequence."""
    place = beside(row) if row.mark == "S" else None
    return place.words if place is not None else ""


def _number(row: Judged) -> str:
    return "" if row.cell.value is None else f"{row.cell.value:g}"


def _short(row: Judged) -> str:
    if not row.measured.there:
        return ""
    if row.measured.is_share:
        return f"{row.measured.share.bad}/{row.measured.share.runs}"
    return f"{row.measured.mean.value:.3g}"


@dataclass(frozen=True)
class WhyNot:
    """Why numbers have no verdict of their own: the most frequent reasons, and the rest."""

    reasons: list[str]
    rest: list[str]
    numbers: int
    """How many numbers the rest covers."""

    @property
    def more(self) -> str:
        """Returns `and 9 more reasons (19 numbers)`; empty if all are shown."""
        if not self.rest:
            return ""
        reasons = f"{len(self.rest)} more reason{'' if len(self.rest) == 1 else 's'}"
        return f"and {reasons} ({self.numbers} number{'' if self.numbers == 1 else 's'})"


def why_not(verdicts: PaperVerdicts, column: Column) -> WhyNot:
    """Groups the numbers without a verdict of their own by reason, with what would help; the
    largest group first."""
    blocks: Counter[str] = Counter()
    for row in column.rows.values():
        if row.mark == "S":
            blocks[_stand_in(verdicts, row)] += 1
        elif row.provenance == "same_data":
            blocks[OWN_DATA] += 1
        elif row.mark == "F":
            blocks[f"fitted, {SET_TO_MATCH}"] += 1
        elif row.mark == "E":
            blocks[row.why] += 1
        elif (reason := reason_of(verdicts, column, row)) in NO_DETAILS:
            blocks[NO_DETAILS[reason]] += 1
        elif reason == "recording":
            blocks[f"{REASON_WORDS[reason]}: {_recording(verdicts, row)}"] += 1
        elif reason is not None:
            blocks[f"{REASON_WORDS[reason]}: {row.why}"] += 1
        elif row.mark == "I":
            blocks[_undecided(row)] += 1
    if (waiting := REASON_WORDS["not_played"]) in blocks:
        blocks[f"{waiting}{_how_to_run(verdicts.paper)}"] = blocks.pop(waiting)
    found = blocks.most_common()
    lines = [
        f"{_many(number, 'number')}: {spelled(text, verdicts.paper)}" for text, number in found
    ]
    rest = sum(number for _, number in found[REASONS:])
    return WhyNot(lines[:REASONS], lines[REASONS:], rest)


def _how_to_run(paper: Paper) -> str:
    try:
        experiments_of([paper])
    except SlambedError:
        return ", and no experiment makes these runs"
    return f"; slambed papers run {paper.id}"


def _stand_in(verdicts: PaperVerdicts, row: Judged) -> str:
    ours = row.measured.found.dataset
    name = row.cell.conditions.get("dataset")
    if name is None:  # computed from other cells, which name the dataset
        return played_instead(ours, "the paper's sequence")
    dataset = verdicts.paper.datasets.get(str(name))
    wanted = dataset.match[0] if dataset is not None and dataset.match else str(name)
    return "; ".join(filter(None, (played_instead(ours, wanted), _how_to_get(wanted))))


def _recording(verdicts: PaperVerdicts, row: Judged) -> str:
    dataset = verdicts.paper.datasets[str(row.cell.conditions["dataset"])]
    return "; ".join(filter(None, (dataset.label, _how_to_get(dataset.match[0]))))


def _how_to_get(name: str) -> str:
    """Returns how to get a sequence; empty where it is not known, or nothing offers it."""
    recipe = _recipe(name)
    if recipe is None:
        return ""
    original = recipe.window_of or next(iter(recipe.first_of), None)
    return how_to_get(recipe) if original is None else _how_to_get(original)


@lru_cache
def _recipe(dataset: str) -> Dataset | None:
    """Returns what the catalog says of a sequence; None for one that it does not have."""
    file = repository_root() / "catalog" / "datasets" / f"{dataset}.yaml"
    return load_recipe(file) if is_file(file) else None


def _undecided(row: Judged) -> str:
    needed = row.verdict.runs_needed
    if needed is not None:
        return f"inconclusive, {needed} runs of each combination would decide"
    return "inconclusive, and no number of our runs alone would decide"


@dataclass(frozen=True)
class CountLine:
    """A count, and lines about single items that it counts."""

    says: str
    single: list[str] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        """Returns both for the terminal."""
        return [f"- {self.says}", *(f"  - {line}" for line in self.single)]


@dataclass(frozen=True)
class Headline:
    """What was learnt: a short sentence, and the counts that it leaves out."""

    says: str
    rest: list[CountLine]

    @property
    def lines(self) -> list[str]:
        """Returns both for the terminal."""
        return [self.says, *(line for item in self.rest for line in item.lines)]


def headline(verdicts: PaperVerdicts, column: Column) -> list[Headline]:
    """Returns what was learnt: of the orderings, per kind of sequences, and of the numbers."""
    if not column.engine:
        waiting = _many(len(column.orderings), "ordering")
        wait = "waits" if len(column.orderings) == 1 else "wait"
        return [
            Headline(f"Nothing is played yet, {waiting} {wait}.", []),
            _numbers(verdicts, column),
        ]
    if plays_a_part(verdicts, column):
        return _of_a_part(verdicts, column)
    return [*_orderings(verdicts, column), _numbers(verdicts, column)]


def plays_a_part(verdicts: PaperVerdicts, column: Column) -> bool:
    """Returns whether another kind of engine played more orderings. What this one did not play
    needs no words then."""
    return _begun(column) < max(map(_begun, verdicts.columns))


def _begun(column: Column) -> int:
    return sum(item.begun for item in column.orderings)


def _of_a_part(verdicts: PaperVerdicts, column: Column) -> list[Headline]:
    """Returns what was learnt with a kind of engine that played less than the other one: nothing is
    said of what it did not play."""
    played = [(item, group) for item, group in with_outcomes(verdicts, column) if item.begun]
    groups = count(verdicts, column).groups
    ours = groups["judged"] + groups["beside"] + groups["fitted"]
    has, it = ("has", "it") if ours == 1 else ("have", "them")
    numbers = f"{_many(ours, 'printed number')} {has} a number of ours next to {it}."
    were = "was" if len(played) == 1 else "were"
    outcomes = [_outcomes(played, f" that {were} played")] if played else []
    return [*outcomes, Headline(numbers, [])]


OUTCOME_WORDS: dict[str, tuple[str, str]] = {
    "hold": ("holds", "hold"),
    "reversed": ("is reversed", "are reversed"),
    "in_part": ("is reversed in part", "are reversed in part"),
    "not_seen": ("is not shown by ours", "are not shown by ours"),
    "inconclusive": ("is inconclusive", "are inconclusive"),
    "unshown": (
        "is not shown by the paper's own numbers",
        "are not shown by the paper's own numbers",
    ),
    "half": ("is not all run", "are not all run"),
    "waiting": ("has no number of ours", "have no number of ours"),
    "live": ("was played live only", "were played live only"),
    "virtual": ("was played in virtual time only", "were played in virtual time only"),
    "fitted": ("compares numbers set to match", "compare numbers set to match"),
}
"""Group -> singular and plural."""


def _orderings(verdicts: PaperVerdicts, column: Column) -> list[Headline]:
    """Returns one headline per kind of sequences: the paper's own, others."""
    by_place: dict[str, list[Outcome]] = {}
    for pair in sorted(with_outcomes(verdicts, column), key=lambda pair: bool(pair[0].stand_ins)):
        by_place.setdefault("substitute" if pair[0].stand_ins else "own", []).append(pair)
    if "own" in by_place and not any(item.begun for item, _ in by_place["own"]):
        by_place.setdefault("substitute", []).extend(by_place.pop("own"))
    return [_outcomes(own) for own in by_place.values()]


def _place(items: list[JudgedOrdering]) -> str:
    """Returns what kind of sequences these orderings were played on."""
    used = sorted({name for item in items for name in item.stand_ins})
    recorded = [name for name in used if not is_generated(name)]
    if not used:
        played = {m.found.dataset for i in items for chain in i.chains for _, m in chain if m.there}
        if played and all(map(is_generated, played)):
            return "Where the paper names no sequence,"
        return "On the paper's own sequences"
    if not recorded:
        return "On generated sequences"
    generated = "generated sequences and " if len(recorded) < len(used) else ""
    return f"On {generated}other recordings ({', '.join(recorded)})"


def is_generated(dataset: str) -> bool:
    """Returns whether a sequence is generated by slambed; False for one that is not known here."""
    recipe = _recipe(dataset)
    if recipe is None:
        return False
    return recipe.synthetic is not None or bool(recipe.window_of and is_generated(recipe.window_of))


def _outcomes(pairs: list[Outcome], which: str = "") -> Headline:
    """Returns `On generated sequences 11 of 24 orderings hold.`, and the other outcomes; `which`
    follows the word "ordering"."""
    by_group: dict[str, list[JudgedOrdering]] = {group: [] for group in OUTCOME_WORDS}
    for item, group in pairs:
        by_group[group].append(item)
    rest = [
        CountLine(f"{len(own)} {OUTCOME_WORDS[group][len(own) > 1]}", _further(group, own))
        for group, own in by_group.items()
        if own and group != "hold"
    ]
    if little := _little_tracked(by_group["hold"]):
        rest.insert(0, CountLine(little))
    held = len(by_group["hold"])
    holding = f"{held or 'none'} of {_many(len(pairs), 'ordering')}{which}"
    if len(pairs) == 1:
        holding = f"{'one' if held else 'no'} ordering{which}"
    place = _place([item for item, _ in pairs])
    return Headline(f"{place} {holding} {'hold' if held > 1 else 'holds'}.", rest)


def _further(group: str, items: list[JudgedOrdering]) -> list[str]:
    """Returns lines below the count of a group: what ours show of orderings that the paper's own
    numbers do not show, and in how many orderings ours cannot differ."""
    if group == "unshown":
        return _unshown(items)
    if group not in ("not_seen", "inconclusive"):
        return []
    counts = Counter(item.floor for item in items if item.cannot_differ)
    if len(items) == 1:
        return list(counts)
    return [f"{_in_how_many(n, items)} of them: {text}" for text, n in counts.items()]


def _little_tracked(items: list[JudgedOrdering]) -> str:
    """Returns `in each of those that hold our runs tracked at most 15 % of their frames`; empty
    where they tracked more."""
    shares = [item.most_tracked for item in items if item.little_tracked]
    if not shares:
        return ""
    which = f"{_in_how_many(len(shares), items)} of those that hold"
    if len(items) == 1:
        which = "where it holds"
    return f"{which} our runs tracked at most {100 * max(shares):.0f} % of their frames"


def _in_how_many(number: int, items: list[JudgedOrdering]) -> str:
    return "in each" if number == len(items) else f"in {number}"


def _unshown(items: list[JudgedOrdering]) -> list[str]:
    """Returns what ours show of each ordering that the paper's own numbers do not show; nothing
    where they show nothing either."""
    return [
        f'"{item.contrast.says}" ({item.contrast.id.partition(".")[2]}), {item.holding}'
        for item in items
        if item.unshown in ("holds", "reversed")
    ]


def _many(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _numbers(verdicts: PaperVerdicts, column: Column) -> Headline:
    """Returns how many printed numbers are judged, and the groups of the others: every printed one
    is counted once."""
    counted = count(verdicts, column)
    marks = Counter(row.mark for row in column.rows.values())
    derived = sum(row.provenance == "same_data" for row in column.rows.values())
    judged, because = counted.groups["judged"], counted.because
    found = (
        (
            counted.groups["beside"],
            "is shown beside ours, not judged",
            "are shown beside ours, not judged",
        ),
        (counted.groups["fitted"] - derived, "was set to match", "were set to match"),
        (derived, "follows from other published numbers", "follow from other published numbers"),
        (counted.groups["setting"], "is a setting or repeated", "are settings or repeated"),
        (counted.groups["none"], f"has none of ours: {because}", f"have none of ours: {because}"),
    )
    rest = [
        CountLine(f"{number} {many if number > 1 else one}")
        for number, one, many in found
        if number
    ]
    verb = "are" if judged > 1 else "is"
    says = f"Of {counted.printed} printed numbers {judged or 'none'} {verb} judged"
    parts = ((marks["R"], "reproduced"), (marks["D"], "different"), (marks["I"], "inconclusive"))
    how = ", ".join(f"{number} {word}" for number, word in parts)
    return Headline(f"{says}: {how}." if judged else f"{says}.", rest)


@dataclass(frozen=True)
class SummaryRow:
    """One line of the overview: a paper and one kind of engine."""

    id: str
    name: str
    runs: str
    orderings: int
    """Orderings that were played, in full or in part; the next three add up to them."""
    hold: int
    reversed: int
    neither: int
    numbers: int
    """Numbers that the paper prints."""
    judged: int
    reproduced: int


def summary_rows(verdicts: PaperVerdicts) -> list[SummaryRow]:
    """Returns one line for each kind of engine; one of zeros if nothing was played."""
    found = []
    for column in verdicts.columns:
        outcomes = Counter(o for item, o in with_outcomes(verdicts, column) if item.begun)
        hold, reverse = outcomes["hold"], outcomes["reversed"] + outcomes["in_part"]
        found.append(
            SummaryRow(
                id=verdicts.paper.id,
                name=verdicts.paper.paper.title.partition(":")[0],
                runs=column.engine or "none",
                orderings=outcomes.total(),
                hold=hold,
                reversed=reverse,
                neither=outcomes.total() - hold - reverse,
                numbers=len(column.rows),
                judged=count(verdicts, column).groups["judged"],
                reproduced=column.marks(list(column.rows))["R"],
            )
        )
    return found


RUNS_WORDS = {"virtual": "runs simulated in virtual time"}


def circumstance(
    verdicts: PaperVerdicts, column: Column, experiments: list[Results]
) -> Circumstance:
    """Returns engine, devices, commit, seeds, plan and runs per number."""
    paper = verdicts.paper
    behind = experiments_behind(column)
    used = [r for r in experiments if r.name in behind]
    commits = sorted({c[:7] for r in used for c in r.facts.get("commit", {})})
    counts = [_runs_of(r) for r in column.rows.values() if r.measured.there]
    engine = column.engine
    parts = [RUNS_WORDS.get(engine, f"{engine} runs") if engine else no_runs_words(paper.id)]
    if column.fits:
        parts.append(f"devices fitted ({', '.join(f.name for f in column.fits)})")
    parts += origin_words(used)
    if counts:
        span = f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)} to {max(counts)}"
        parts.append(f"{span} runs per number")
    plan = read_plan(paper.id)
    lines = plan_lines(paper, plan, column, experiments)
    parts.append(plan_words(lines, plan, bool(engine)))
    return Circumstance(
        engine,
        ", ".join(parts),
        commits,
        {r.name: _seeds(r) for r in used},
        [f.name for f in column.fits],
        [r.name for r in used],
        [replace(line, text=spelled(line.text, verdicts.paper)) for line in lines],
    )


def _runs_of(row: Judged) -> int:
    """Returns the runs played for a number, including those it leaves out, such as lost ones."""
    found = row.measured.found.runs
    return len(row.measured.values) if found is None else len(found)


def _seeds(results: Results) -> str:
    if "seed" not in results.valid_runs:
        return ""
    seeds = sorted({int(seed) for seed in results.valid_runs["seed"].dropna()})
    return f"{seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else ", ".join(map(str, seeds))


def terminal_lines(verdicts: PaperVerdicts, experiments: list[Results]) -> list[str]:
    """Returns the page for the terminal, about a screen per kind of engine."""
    found: list[str] = []
    for column in verdicts.columns:
        title = f"{verdicts.paper.paper.title} ({verdicts.paper.paper.year})"
        lines = [
            title,
            circumstance(verdicts, column, experiments).line,
            *(line for found in headline(verdicts, column) for line in found.lines),
        ]
        claims = claim_lines(column)
        if len(verdicts.columns) > 1:
            # What this kind of engine did not play, the other one may have.
            claims = [c for c in claim_lines(column, every=True) if c.begun]
        shown = claims if len(claims) <= SHOWN_CLAIMS else claims[: SHOWN_CLAIMS - 1]
        lines += [claim.line for claim in shown]
        if len(claims) > len(shown):
            lines.append(f"... and {len(claims) - len(shown)} more claims on the page")
        lines.append(f"prediction: {column.score.line()}")
        gaps = why_not(verdicts, column)
        lines += gaps.reasons
        lines += [f"{gaps.more} on the page"] if gaps.more else []
        found += lines
    return found
