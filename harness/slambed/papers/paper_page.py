# SPDX-License-Identifier: Apache-2.0
"""Writes one page per paper and an overview: HTML, Markdown and LaTeX of the same verdicts."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from slambed.papers.beside import beside
from slambed.papers.codes import named, spelled
from slambed.papers.compare import (
    Column,
    PaperVerdicts,
    compare_paper,
    comparison_table,
    ordering_table,
    pair_table,
)
from slambed.papers.environment import environment
from slambed.papers.figures import drawn_figures
from slambed.papers.judged import MARK_NAMES, MARKS, Judged
from slambed.papers.lookup import Pool, pool_of
from slambed.papers.paper_claims import (
    NOT_BEGUN,
    claim_groups,
    claims_per_engine,
    definitions,
    text_lines,
)
from slambed.papers.paper_view import (
    MARK_WORDS,
    bar,
    bars,
    circumstance,
    headline,
    plays_a_part,
    summary_rows,
    terminal_lines,
    twin,
    why_not,
)
from slambed.papers.peer import peer_tables
from slambed.papers.published import Paper
from slambed.papers.published.paper_plan import read_plan
from slambed.papers.reasons import count_table
from slambed.papers.strip import COLORS, histogram_svg, strip_svg
from slambed.report.experiment import write_tables
from slambed.report.load import Results
from slambed.report.page import STYLE
from slambed.report.tables import Table

METRICS = 6
"""How many metrics the overview draws per paper, those with the most numbers."""
RUNS_LINKED = 5
"""How many runs of a number are linked; the others are counted."""


@dataclass(frozen=True)
class PaperPage:
    """What was written for one paper."""

    html: Path
    markdown: Path
    lines: list[str]
    """The page's summary for the terminal."""
    verdicts: PaperVerdicts | None


def write_paper_page(
    paper: Paper,
    experiments: list[Results],
    folder: Path,
    overview: bool = False,
    command: str = "slambed papers compare",
) -> PaperPage:
    """Writes `<folder>/<paper id>/index.html`, page.md and tables; with `overview` the page links
    to the overview, which is written too. `command`: what the page says it was made by."""
    target = folder / paper.id
    target.mkdir(parents=True, exist_ok=True)
    pool = pool_of(experiments)
    if paper.kind == "peer":
        return _peer_page(paper, pool, target)
    verdicts = compare_paper(paper, pool)
    html = target / "index.html"
    html.write_text(
        environment()
        .get_template("paper.html.j2")
        .render(
            _content(verdicts, experiments, target),
            overview=overview,
            command=f"{command} {paper.id}",
        ),
        encoding="utf-8",
    )
    tables = [table for column in verdicts.columns for table in _tables(verdicts, column)]
    write_tables(tables, target / "tables")
    markdown = target / "page.md"
    markdown.write_text(_markdown(verdicts, experiments, tables), encoding="utf-8")
    return PaperPage(html, markdown, terminal_lines(verdicts, experiments), verdicts)


def write_overview(
    pages: list[PaperVerdicts], experiments: list[Results], folder: Path, systems: str = ""
) -> Path:
    """Writes `<folder>/index.html` over all these papers: what each claims and what came out.
    `systems`: the page in this folder that compares all systems, if it was written."""
    papers = [
        {
            "id": v.paper.id,
            "title": v.paper.paper.title,
            "published": v.paper.paper.published,
            "columns": [
                {
                    "engine": c.engine,
                    "made": circumstance(v, c, experiments),
                    "headline": headline(v, c),
                    "groups": [
                        group
                        for group in claim_groups(v, c)
                        if group.outcome not in NOT_BEGUN or not plays_a_part(v, c)
                    ],
                    "whole": bar("all numbers", "", c, list(c.rows)),
                    "strip": strip_svg(
                        list(c.rows.values()), f"{v.paper.id}/index.html#v-", METRICS
                    ),
                }
                for c in v.columns
            ],
        }
        for v in pages
    ]
    path = folder / "index.html"
    page = environment().get_template("papers.html.j2")
    counts = count_table(pages)
    content = {
        "papers": papers,
        "summary": [row for v in pages for row in summary_rows(v)],
        "counts": counts,
        "metrics": METRICS,
        "systems": systems,
    }
    path.write_text(page.render(**content, **_look()), encoding="utf-8")
    return path


def _look() -> dict[str, Any]:
    return {
        "style": Markup(STYLE),
        "marks": MARK_NAMES,
        "legend_words": MARK_WORDS,
        "colors": COLORS,
    }


def _content(verdicts: PaperVerdicts, experiments: list[Results], target: Path) -> dict[str, Any]:
    links = {r.name: _relative(_report_of(r), target) for r in experiments}
    folders = {r.name: r.folder for r in experiments}
    columns = []
    for c in verdicts.columns:
        made = circumstance(verdicts, c, experiments)
        columns.append(
            {
                "engine": c.engine,
                "made": made,
                "headline": headline(verdicts, c),
                "bars": bars(verdicts, c),
                "score": c.score,
                "strip": strip_svg(list(c.rows.values()), "#v-"),
                "figures": drawn_figures(verdicts, c, experiments),
                "why_not": why_not(verdicts, c),
                "histogram": histogram_svg(c.score.histogram),
                "links": [(name, links[name]) for name in made.experiments],
            }
        )
    plan = read_plan(verdicts.paper.id)
    claims, further = claims_per_engine(verdicts.columns, verdicts.paper)
    return _look() | {
        "paper": verdicts.paper,
        "columns": columns,
        "claims": claims,
        "further": further,
        "definitions": definitions(verdicts.columns),
        "twins": [twin(verdicts, t) for t in verdicts.paper.tables],
        "groups": [
            {
                "name": name,
                "label": label,
                "entries": [_entry(verdicts, i, folders, target) for i in ids],
            }
            for name, label, ids in verdicts.groups()
        ],
        "limits": [spelled(text, verdicts.paper) for text in plan.limits] if plan else [],
        "margins": [_margin_words(name, m) for name, m in verdicts.paper.margins.items()],
    }


def _report_of(results: Results) -> Path:
    """Returns an experiment's report, or what was run if none was written, as for packed runs."""
    report = results.folder / "report" / "index.html"
    run = results.folder / "experiment.json"
    return run if run.is_file() and not report.is_file() else report


def _margin_words(name: str, margin: Any) -> str:
    size = f"{margin.ratio:.0%}" if margin.ratio is not None else f"{margin.points:g} points"
    ends = f" ({margin.points_at_ends:g} at the ends)" if margin.points_at_ends else ""
    return f"{name.replace('_', ' ')} {size}{ends}"


def _entry(
    verdicts: PaperVerdicts, name: str, folders: dict[str, Path], target: Path
) -> dict[str, Any]:
    """Returns a number with everything that led to its marks."""
    cell = verdicts.cells[name]
    return {
        "id": name,
        "words": named(cell, {n: s.label for n, s in verdicts.paper.systems.items()}),
        "paper": next(c.rows[name].stated for c in verdicts.columns),
        "where": _place(verdicts.paper, cell.source),
        "ours": [_ours(verdicts, c, c.rows[name], folders, target) for c in verdicts.columns],
    }


def _ours(
    verdicts: PaperVerdicts, column: Column, row: Judged, folders: dict[str, Path], target: Path
) -> dict[str, Any]:
    verdict = row.verdict
    margin = ""
    if verdict.margin == verdict.margin:
        parts = {"ratio": f"{verdict.margin:.0%}", "points": f"{100 * verdict.margin:.3g} points"}
        margin = parts.get(verdict.scale, f"{verdict.margin:.3g}")
    keys = row.measured.keys
    reason = row.why
    if row.provenance in ("fitted", "stand_in") and verdict.why and verdict.why not in reason:
        reason = f"{reason}; {verdict.why}"
    place = beside(row) if row.mark == "S" else None
    if verdict.runs_needed:
        reason = f"{reason}; {verdict.runs_needed} runs would decide"
    return {
        "engine": column.engine, "mark": row.mark, "value": row.ours,
        "beside": place.words if place is not None else "",
        "why": spelled(reason, verdicts.paper),
        "formula": verdict.formula, "margin": margin, "assumed": verdict.assumed,
        "runs": [
            (key[:8], _relative(folders[experiment] / "runs" / key, target))
            for experiment, key in keys[:RUNS_LINKED]
        ],
        "more": max(0, len(keys) - RUNS_LINKED),
    }  # fmt: skip


def _place(paper: Paper, source: str) -> str:
    """Returns the section, and the lines of the paper's plain text."""
    places = {t.id: (t.where, t.lines) for t in paper.tables}
    places |= {c.id: (c.where, c.lines) for c in paper.claims}
    where, lines = places.get(source, (source, []))
    return where + (f", text {text_lines(lines)}" if lines else "")


def _relative(path: Path, target: Path) -> str:
    return Path(os.path.relpath(path, target)).as_posix()


def counts_table(verdicts: PaperVerdicts, column: Column) -> Table:
    """Returns the stacked bars as numbers."""
    headings = ["table", *MARKS.values(), "all", "compared"]
    table = Table("counts", "Printed numbers by verdict", headings)
    for _, label, ids in verdicts.groups():
        found = column.marks(ids)
        compared = str(found["R"] + found["D"] + found["I"])
        table.rows.append([label, *(str(found[m]) for m in MARKS), str(len(ids)), compared])
    return table


def _tables(verdicts: PaperVerdicts, column: Column) -> list[Table]:
    tables = [counts_table(verdicts, column), ordering_table(verdicts, column)]
    tables.append(pair_table(verdicts, column))
    tables.append(comparison_table(verdicts, column, list(column.rows)))
    for table in tables:
        table.name = "_".join(n for n in (verdicts.paper.id, table.name, column.engine) if n)
        if column.engine and column.engine not in table.caption:
            table.caption += f" ({column.engine})"
    return [table for table in tables if table.rows]


def _markdown(verdicts: PaperVerdicts, experiments: list[Results], tables: list[Table]) -> str:
    lines = [f"# {verdicts.paper.paper.title}", ""]
    lines += [f"    {line}" for line in terminal_lines(verdicts, experiments)]
    for table in tables:
        lines += ["", f"## {table.caption}", "", table.markdown()]
    return "\n".join(lines)


def _peer_page(paper: Paper, pool: Pool, target: Path) -> PaperPage:
    """Writes the page of another program compared with ours: a table per set-up, without
    verdicts."""
    tables = peer_tables(paper, pool)
    line = f"{paper.id}: {len(tables)} of {len(paper.setups)} set-ups were run"
    html, markdown = target / "index.html", target / "page.md"
    page = environment().get_template("peer.html.j2")
    html.write_text(page.render(paper=paper, line=line, tables=tables, **_look()), encoding="utf-8")
    write_tables(tables, target / "tables")
    parts = [f"# {paper.paper.title}", "", line]
    for table in tables:
        parts += ["", f"## {table.caption}", "", table.markdown()]
    markdown.write_text("\n".join(parts), encoding="utf-8")
    return PaperPage(html, markdown, [line], None)
