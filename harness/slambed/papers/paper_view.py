# SPDX-License-Identifier: Apache-2.0
"""Computes what a paper's page shows: headline, bars, copies of tables, reasons, conditions of the
runs."""

from collections import Counter
from dataclasses import dataclass

from slambed.data.stand_in import played_instead
from slambed.errors import SlambedError
from slambed.papers.compare import Column, PaperVerdicts
from slambed.papers.fitted import OWN_DATA, SET_TO_MATCH
from slambed.papers.judged import MARKS, Judged, Mark
from slambed.papers.kept import no_runs_words
from slambed.papers.lookup import MISSING_WORDS
from slambed.papers.orderings import KINDS, PARTLY
from slambed.papers.origin import origin_words
from slambed.papers.paper_claims import claim_lines
from slambed.papers.paper_runs import experiments_of
from slambed.papers.published import Paper, PublishedTable
from slambed.papers.published.paper_plan import read_plan
from slambed.papers.registered import PlanLine, plan_lines, plan_words
from slambed.report.load import Results

MARK_WORDS: dict[Mark, str] = MARKS | {
    "F": "fitted: set to match, no evidence",
    "S": "stand-in: played on substitute data",
    "E": "run, but kept without events",
}
"""Words for the legend."""
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
    """Per engine: our number, mark, reason, and how far off a fitted number is."""


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
            ours = [(_short(j), j.mark, j.why, j.hint) for j in judged]
            cells.append(TwinCell(place, _number(judged[0]), ours))
        rows.append((row.label, cells))
    return Twin(table, [c.label for c in table.columns.values()], rows)


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
        elif row.missing == "too_few_runs" and row.why.partition(": ")[2].startswith("no "):
            blocks[NOT_RUN] += 1
        elif row.mark == "N" and row.missing:
            blocks[f"{MISSING_WORDS[row.missing]}: {row.why}"] += 1
        elif row.mark == "I":
            blocks[_undecided(row)] += 1
    if NOT_RUN in blocks:
        blocks[f"{NOT_RUN}{_how_to_run(verdicts.paper)}"] = blocks.pop(NOT_RUN)
    found = blocks.most_common()
    lines = [f"{count} {'number' if count == 1 else 'numbers'}: {text}" for text, count in found]
    rest = sum(count for _, count in found[REASONS:])
    return WhyNot(lines[:REASONS], lines[REASONS:], rest)


NOT_RUN = "not run yet"


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
    return f"{played_instead(ours, wanted)}; slambed data download {wanted}"


def _undecided(row: Judged) -> str:
    needed = row.verdict.runs_needed
    if needed is not None:
        return f"inconclusive, {needed} runs per cell would decide"
    return "inconclusive, and no number of our runs alone would decide"


def headline(verdicts: PaperVerdicts, column: Column) -> list[str]:
    """Returns the takeaway: a sentence about the claims, one about the numbers."""
    claims, rows = claim_lines(column), list(column.rows.values())
    if not column.engine:
        twice = sum(row.mark == "P" for row in rows)
        waiting = sum(row.mark in ("N", "E") for row in rows)
        return [
            f"Nothing was run yet. {len(claims)} main claims and {waiting} numbers wait; {twice} "
            f"of the {len(rows)} printed numbers are settings or repeated."
        ]
    reported = [
        f"{len(own)} {words[len(own) > 1]}{_weak([line.weak for line in own])}"
        for outcome, words in CLAIM_WORDS.items()
        if (own := [line for line in claims if line.words == outcome])
    ]
    found = [f"Of {len(claims)} main claims {', '.join(reported)}."] if claims else []
    return [*found, _numbers(rows)]


CLAIM_WORDS: dict[str, tuple[str, str]] = {
    KINDS["holds"]: ("holds", "hold"),
    KINDS["reversed"]: ("is reversed", "are reversed"),
    PARTLY["reversed"]: ("is reversed in part", "are reversed in part"),
    KINDS["not_seen"]: ("is not seen", "are not seen"),
    PARTLY["not_seen"]: ("is not seen in full", "are not seen in full"),
    KINDS["too_few_runs"]: ("has too few runs", "have too few runs"),
    KINDS["inconclusive"]: ("is inconclusive", "are inconclusive"),
    KINDS["not_shown_by_paper"]: (
        "is not shown by the paper itself",
        "are not shown by the paper itself",
    ),
    KINDS["no_events"]: ("is run but kept without events", "are run but kept without events"),
    KINDS["no_number"]: ("has no number of ours", "have no number of ours"),
    KINDS["half_run"]: ("is not all run", "are not all run"),
    KINDS["not_run"]: ("is not run", "are not run"),
}
"""Singular and plural."""


def _numbers(rows: list[Judged]) -> str:
    """Returns the sentence about the numbers. It starts with how many could be compared, because
    with none, none differs either."""
    marks = Counter(row.mark for row in rows)
    judged = {
        "reproduced": marks["R"],
        "differ" if marks["D"] != 1 else "differs": marks["D"],
        "inconclusive": marks["I"],
    }
    compared = sum(judged.values())
    aside = Counter(word for row in rows if (word := _not_compared(row)))
    why = ", ".join(f"{aside[word]} {word}" for word in NOT_COMPARED if aside[word])
    message = f"{compared} of {len(rows)} printed numbers could be compared"
    if not compared:
        return f"{message}: {why}."
    outcomes = ", ".join(f"{count} {word}" for word, count in judged.items())
    return f"{message}: {outcomes}." + (f" The others could not: {why}." if why else "")


NOT_COMPARED = (
    "played on stand-ins (substitute data)", "fitted (set to match)",
    "from the paper's own data", "settings or repeated",
    "run but kept without events", "without a number of ours", "not run",
)  # fmt: skip
"""Groups that are neither agreement nor difference."""


def _not_compared(row: Judged) -> str:
    substitute, fitted, own_data, setting, no_events, no_number, not_run = NOT_COMPARED
    words: dict[Mark, str] = {"S": substitute, "F": fitted, "P": setting, "E": no_events}
    if row.mark == "N":
        return no_number if row.missing == "no_metric" else not_run
    return own_data if row.provenance == "same_data" else words.get(row.mark, "")


def _weak(reasons: list[str]) -> str:
    """Returns ` (on a stand-in)` if it applies to all, else ` (1 on a stand-in, 2 fitted)`."""
    counts = Counter(reason for reason in reasons if reason)
    if list(counts.values()) == [len(reasons)]:
        return f" ({next(iter(counts))})"
    message = ", ".join(f"{count} {reason}" for reason, count in counts.items())
    return f" ({message})" if message else ""


RUNS_WORDS = {"virtual": "runs simulated in virtual time"}


def circumstance(
    verdicts: PaperVerdicts, column: Column, experiments: list[Results]
) -> Circumstance:
    """Returns engine, devices, commit, seeds, plan and runs per number."""
    paper = verdicts.paper
    used = [r for r in experiments if r.name in _experiments(column)]
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
    lines = plan_lines(paper, plan, column, used)
    parts.append(plan_words(lines, plan, bool(engine)))
    return Circumstance(
        engine,
        ", ".join(parts),
        commits,
        {r.name: _seeds(r) for r in used},
        [f.name for f in column.fits],
        [r.name for r in used],
        lines,
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


def _experiments(column: Column) -> set[str]:
    numbers = {key[0] for row in column.rows.values() for key in row.measured.keys}
    orderings = {
        key[0] for o in column.orderings for chain in o.chains for _, m in chain for key in m.keys
    }
    return numbers | orderings


def twelve_lines(verdicts: PaperVerdicts, experiments: list[Results]) -> list[str]:
    """Returns the page for the terminal: at most twelve lines per kind of engine."""
    found: list[str] = []
    for column in verdicts.columns:
        title = f"{verdicts.paper.paper.title} ({verdicts.paper.paper.year})"
        lines = [
            title,
            circumstance(verdicts, column, experiments).line,
            " ".join(headline(verdicts, column)),
        ]
        claims = claim_lines(column)
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
