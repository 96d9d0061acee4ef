# SPDX-License-Identifier: Apache-2.0
"""What a paper's page shows, computed: claims, bars, twins of tables, reasons, circumstances."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from slambed.errors import SlambedError
from slambed.report.compare import Column, PaperVerdicts
from slambed.report.judged import MARKS, Judged, Mark
from slambed.report.load import Results
from slambed.report.lookup import MISSING_WORDS
from slambed.report.orderings import JudgedOrdering
from slambed.report.paper_runs import experiments_of
from slambed.report.papers import Paper, PublishedTable
from slambed.report.papers.plan import read_plan
from slambed.report.registered import PlanLine, plan_lines, plan_words

BADGES = {
    "holds": "HOLDS", "reversed": "REVERSED", "inconclusive": "CANNOT TELL",
    "paper_cannot_tell": "PAPER CANNOT TELL", "not_run": "NOT RUN",
}  # fmt: skip
REASONS = 3
SHOWN_CLAIMS = 4


@dataclass(frozen=True)
class ClaimLine:
    """One main claim for one kind of engine."""

    engine: str
    badge: str
    kind: str
    """Outcome as a CSS class."""
    says: str
    paper: str
    ours: str
    note: str
    where: str
    anchor: str
    evidence: bool
    """Neither on a stand-in nor fitted."""


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
    """One place of a table's twin."""

    id: str
    paper: str
    ours: list[tuple[str, Mark, str]]
    """Per engine: our number, mark, reason."""


@dataclass(frozen=True)
class Twin:
    """A published table as a heat map."""

    table: PublishedTable
    headings: list[str]
    rows: list[tuple[str, list[TwinCell | None]]]


@dataclass(frozen=True)
class Circumstance:
    """How the runs of one kind of engine were made."""

    engine: str
    line: str
    commits: list[str]
    seeds: str
    fits: list[str]
    experiments: list[str]
    plan: list[PlanLine]


def claim_lines(column: Column) -> list[ClaimLine]:
    """The main claims; all declared orderings where none is called a main one."""
    main = [o for o in column.orderings if o.contrast.main] or column.orderings
    return [_claim(column.engine, o) for o in main]


def claims_beside(columns: list[Column]) -> list[list[ClaimLine]]:
    """Every main claim with what each kind of engine says of it."""
    return [list(lines) for lines in zip(*map(claim_lines, columns), strict=True)]


def in_short(assumed: Sequence[str]) -> list[str]:
    """What differs in its percentage alone is one assumption, with the smallest and the largest."""
    percents: dict[str, list[int]] = {}
    for text in assumed:
        what, _, rest = text.partition(" (")
        percent = rest.removesuffix("%)")
        percents.setdefault(what if percent.isdigit() else text, []).extend(
            [int(percent)] if percent.isdigit() else []
        )
    return [
        f"{what} ({min(found)} to {max(found)} %)" if len(found) > 1
        else f"{what} ({found[0]} %)" if found else what
        for what, found in percents.items()
    ]  # fmt: skip


def _claim(engine: str, item: JudgedOrdering) -> ClaimLine:
    ordering = item.ordering
    missing = ordering.why.startswith("not run")
    kind = "not_run" if missing and ordering.outcome == "inconclusive" else ordering.outcome
    notes = [ordering.why]
    if item.provenance == "fitted":
        notes.insert(0, "a device was fitted to some of these numbers: no evidence")
    if item.stand_ins:
        notes.insert(0, f"stand-in {', '.join(item.stand_ins)}")
    if ordering.runs_needed and ordering.outcome == "inconclusive":
        notes.append(f"{ordering.runs_needed} runs per cell would decide")
    if ordering.assumed:
        notes.append(f"assumed: {', '.join(in_short(ordering.assumed))}")
    contrast = item.contrast
    lines = f", {text_lines(contrast.lines)} of its text" if contrast.lines else ""
    return ClaimLine(
        engine, BADGES[kind], kind, contrast.says, item.values(False), item.values(True),
        "; ".join(notes), contrast.where + lines, contrast.id, item.provenance == "measured",
    )  # fmt: skip


def bars(verdicts: PaperVerdicts, column: Column) -> list[Bar]:
    """One per table and one of the text, over all numbers that the paper prints."""
    return [bar(label, name, column, ids) for name, label, ids in verdicts.groups()]


def bar(label: str, anchor: str, column: Column, ids: list[str]) -> Bar:
    """Counts of these numbers by mark."""
    found = column.marks(ids)
    segments = [(m, found[m], 100 * found[m] / len(ids)) for m in MARKS if found[m]]
    return Bar(label, anchor, len(ids), segments)


def twin(verdicts: PaperVerdicts, table: PublishedTable) -> Twin:
    """The table with the paper's number, ours and the mark at every place."""
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
            ours = [(_short(j), j.mark, j.why) for j in judged]
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


def text_lines(lines: list[int]) -> str:
    """`line 12`, `lines 12, 14`: where the paper's plain text says so."""
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(map(str, lines))}"


def why_not(verdicts: PaperVerdicts, column: Column) -> list[str]:
    """The largest blocks of numbers without a verdict of their own, with what would help."""
    blocks: Counter[str] = Counter()
    for row in column.rows.values():
        if row.mark == "S":
            blocks[_stand_in(verdicts, row)] += 1
        elif row.missing == "too_few_runs" and "no run" in row.why:
            blocks[NOT_RUN] += 1
        elif row.mark == "N" and row.missing:
            blocks[f"{MISSING_WORDS[row.missing]}: {row.why}"] += 1
        elif row.mark == "I":
            blocks[_undecided(row)] += 1
    if NOT_RUN in blocks:
        blocks[f"{NOT_RUN}{_how_to_run(verdicts.paper)}"] = blocks.pop(NOT_RUN)
    return [
        f"{count} {'number' if count == 1 else 'numbers'}: {text}"
        for text, count in blocks.most_common(REASONS)
    ]


NOT_RUN = "not run yet"


def _how_to_run(paper: Paper) -> str:
    try:
        experiments_of([paper])
    except SlambedError:
        return ", and no experiment makes these runs"
    return f"; slambed paper {paper.id}"


def _stand_in(verdicts: PaperVerdicts, row: Judged) -> str:
    ours = row.measured.found.dataset
    name = row.cell.conditions.get("dataset")
    dataset = verdicts.paper.datasets.get(str(name))
    wanted = dataset.match[0] if dataset is not None and dataset.match else str(name)
    return f"{ours} stands in for the paper's sequence; slambed data download {wanted}"


def _undecided(row: Judged) -> str:
    needed = row.verdict.runs_needed
    if needed is not None:
        return f"inconclusive, {needed} runs per cell would decide"
    return "inconclusive, and no number of our runs alone would decide"


def headline(verdicts: PaperVerdicts, column: Column) -> str:
    """What a reader shall take away: claims first, then numbers."""
    lines = claim_lines(column)
    kinds = Counter(line.kind for line in lines)
    told = [
        f"{kinds[kind]} {word}"
        for kind, word in (
            ("holds", "hold"), ("reversed", "reversed"), ("inconclusive", "cannot be told"),
            ("paper_cannot_tell", "not shown by the paper itself"), ("not_run", "not run"),
        )
        if kinds[kind]
    ]  # fmt: skip
    marks = column.marks(list(column.rows))
    weak = sum(line.kind == "holds" and not line.evidence for line in lines)
    if weak:
        which = "" if weak == kinds["holds"] else f"{weak} of them "
        told[0] += f" ({which}on stand-ins or fitted)"
    if not column.engine:
        waiting, twice = marks["N"], marks["P"]
        return (
            f"Nothing was run yet. {len(lines)} main claims and {waiting} numbers wait; "
            f"{twice} of the {len(column.rows)} printed numbers are settings or stand twice."
        )
    claims = f"Of {len(lines)} main claims {', '.join(told)}. " if lines else ""
    return (
        f"{claims}{marks['R']} of {len(column.rows)} printed numbers reproduced, "
        f"{marks['D']} differ, {marks['I']} undecided{_not_judged(marks)}."
    )


RUNS_WORDS = {"virtual": "runs simulated in virtual time"}


def _not_judged(marks: Mapping[Mark, int]) -> str:
    """What a reader must not take for agreement."""
    words: dict[Mark, str] = {
        "S": "on stand-ins",
        "F": "fitted",
        "P": "settings or twice there",
        "N": "not run",
    }
    found = [f"{marks[mark]} {word}" for mark, word in words.items() if marks[mark]]
    total = sum(marks[mark] for mark in words)
    return f", {total} not judged ({', '.join(found)})" if found else ""


def circumstance(
    verdicts: PaperVerdicts, column: Column, experiments: list[Results]
) -> Circumstance:
    """Engine, devices, commit, seeds, plan and how many runs stand behind a number."""
    used = [r for r in experiments if r.name in _experiments(column)]
    commits = sorted({c[:7] for r in used for c in r.facts.get("commit", {})})
    dirty = any("True" in r.facts.get("dirty", {}) for r in used)
    counts = [len(r.measured.values) for r in column.rows.values() if r.measured.there]
    seeds = sorted({int(s) for s in column.runs.get("seed", []) if s == s and s is not None})
    parts = [
        RUNS_WORDS.get(column.engine, f"{column.engine} runs") if column.engine else "no runs yet"
    ]
    if column.fits:
        parts.append(f"devices fitted ({', '.join(f.name for f in column.fits)})")
    if commits:
        parts.append(f"commit {', '.join(commits[:3])}{'+' if dirty else ''}")
    if counts:
        span = f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)} to {max(counts)}"
        parts.append(f"{span} runs per number")
    plan = read_plan(verdicts.paper.id)
    lines = plan_lines(verdicts.paper, plan, column, used)
    parts.append(plan_words(lines, plan, bool(column.engine)))
    told = f"{seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else ", ".join(map(str, seeds))
    return Circumstance(
        column.engine, ", ".join(parts), commits, told, [f.name for f in column.fits],
        [r.name for r in used], lines,
    )  # fmt: skip


def _experiments(column: Column) -> set[str]:
    numbers = {key[0] for row in column.rows.values() for key in row.measured.keys}
    orderings = {
        key[0] for o in column.orderings for chain in o.chains for _, m in chain for key in m.keys
    }
    return numbers | orderings


def twelve_lines(verdicts: PaperVerdicts, experiments: list[Results]) -> list[str]:
    """The page in the terminal: at most twelve lines per kind of engine."""
    found: list[str] = []
    for column in verdicts.columns:
        title = f"{verdicts.paper.paper.title} ({verdicts.paper.paper.year})"
        lines = [
            title,
            circumstance(verdicts, column, experiments).line,
            headline(verdicts, column),
        ]
        claims = claim_lines(column)
        shown = claims if len(claims) <= SHOWN_CLAIMS else claims[: SHOWN_CLAIMS - 1]
        lines += [f"[{c.badge}] {c.says}: paper {c.paper}, ours {c.ours}" for c in shown]
        if len(claims) > len(shown):
            lines.append(f"... and {len(claims) - len(shown)} more claims on the page")
        lines.append(column.summary())
        lines.append(f"prediction: {column.score.line()}")
        lines += why_not(verdicts, column)
        found += lines[:12]
    return found
