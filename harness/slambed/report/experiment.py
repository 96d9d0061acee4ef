# SPDX-License-Identifier: Apache-2.0
"""Writes the report of one experiment."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console, Group, RenderableType
from rich.text import Text

from slambed.files.atomic import replacing
from slambed.metrics.catalog import SUMMARY_KEYS
from slambed.report import current
from slambed.report.board_facts import COLUMNS as BOARD
from slambed.report.boards import board_table
from slambed.report.cells import Cell, cells_of, metrics_to_show, what_runs_show
from slambed.report.compute_times import ComputeTime, compute_times
from slambed.report.differences import difference_tables
from slambed.report.hosts import host_table
from slambed.report.html import PageContent, write_html
from slambed.report.load import Results, load
from slambed.report.not_measured import left_to_live_runs, not_measured
from slambed.report.own_programs import program_lines
from slambed.report.plots import TIME_FOR_FIGURES_S, Drawn, draw_all
from slambed.report.rounds import update_round_tables
from slambed.report.settings import settings_table
from slambed.report.setup import NO_LIMITS, is_virtual, setup_lines
from slambed.report.style import FORMATS
from slambed.report.tables import (
    Table,
    asked_links,
    cell_tables,
    limits_table,
    link_table,
)

WRITTEN = ".written"
"""File beside tables with the names of those that the last call wrote."""
MOST_TERMINAL_LINES = 12
LOUD = "bold yellow"


@dataclass(frozen=True)
class ReportPaths:
    """What `write_report` wrote."""

    markdown: Path
    html: Path
    summary_csv: Path
    folder: Path
    problems: list[str]


@dataclass(frozen=True)
class ReportSummary:
    """What page and terminal both show; computing it takes seconds for thousands of runs."""

    results: Results
    cells: list[Cell]
    tables: list[Table]
    comparisons: list[Table]
    times: list[ComputeTime]
    """Compute times behind the numbers."""

    @property
    def warnings(self) -> list[str]:
        """Returns what a reader must know before any number."""
        found = (time.warning(self.results.name) for time in self.times)
        return [*self.results.stand_ins, *(line for line in found if line is not None)]

    @classmethod
    def of(cls, results: Results, comparisons: Iterable[Table] = ()) -> "ReportSummary":
        """Summarizes loaded runs. `comparisons` are tables of these and published numbers."""
        for line in not_measured(results):
            results.complain(line)
        metrics = metrics_to_show(results)
        cells = cells_of(results, metrics)
        tables = [*cell_tables(cells, metrics), *update_round_tables(results)]
        if (by_host := host_table(results, metrics)) is not None:
            tables.append(by_host)
        if (boards := board_table(results)) is not None:
            tables.append(boards)
        return cls(results, cells, tables, list(comparisons), compute_times(results))


def write_report(
    experiment_dir: Path,
    command: str | None = None,
    figures: bool = True,
    limit_s: float | None = TIME_FOR_FIGURES_S,
    summary: ReportSummary | None = None,
    formats: tuple[str, ...] = FORMATS,
    place: Path | None = None,
) -> ReportPaths:
    """Writes summary.csv, report.md and report/ (index.html, figures, tables) from the runs alone.

    The report lists damaged, missing or unknown files. Raises SlambedError only if the folder does
    not exist. `summary`: of the folder, if the caller has it; `formats`: of the figures; `place`:
    output folder, default the folder of the runs.
    """
    place = place or experiment_dir
    runs = current.begin(experiment_dir, place)
    summary = summary or ReportSummary.of(load(experiment_dir))
    results, cells = summary.results, summary.cells
    folder = place / "report"
    folder.mkdir(exist_ok=True)
    summary_csv = write_summary_csv(results, place)
    made_by = command or f"slambed report {results.name}"
    drawn = Drawn([], 0)
    if figures and len(results.valid_runs):
        drawn = draw_all(results, cells, folder, made_by, limit_s, formats)
    content = PageContent(
        warnings=summary.warnings,
        setup=[*setup_lines(results, summary.times), *left_to_live_runs(results)],
        settings=settings_table(results),
        cells=cells,
        tables=summary.tables,
        differences=difference_tables(results),
        comparisons=summary.comparisons,
        links=asked_links(results),
        link=link_table(results),
        limits=limits_table(results),
        figures=drawn.figures,
        left_out=drawn.left_out,
        empty=drawn.empty,
    )
    tables = [
        content.settings, *content.tables, *content.differences, *content.comparisons,
        content.links, content.link, content.limits,
    ]  # fmt: skip
    write_tables(tables, folder / "tables")
    html = write_html(results, content, folder)
    markdown = place / "report.md"
    markdown.write_text(_markdown(results, content), encoding="utf-8")
    current.finish(place, runs)
    return ReportPaths(markdown, html, summary_csv, folder, results.problems)


def write_summary_csv(results: Results, place: Path) -> Path:
    """Writes one row per run: the keys of summary.json, systems' own metrics, label, host and
    parameters. The file is replaced atomically."""
    path = place / "summary.csv"
    with replacing(path) as out:
        results.runs[_columns(results)].to_csv(out, index=False)
    return path


def _columns(results: Results) -> list[str]:
    params = sorted(str(name) for name in results.runs if str(name).startswith("params."))
    boards = BOARD if results.runs["board"].notna().any() else ()
    return [*SUMMARY_KEYS, *results.own_metrics, "label", "host", *boards, *params]


def write_tables(tables: list[Table], folder: Path) -> None:
    """Writes each table that has rows as CSV, Markdown and LaTeX; removes those that an earlier
    call wrote here and this one does not."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {}
    for table in tables:
        if table.rows:
            made[f"{table.name}.csv"] = table.csv()
            made[f"{table.name}.md"] = table.markdown()
            made[f"{table.name}.tex"] = table.latex()
    # Other files of the folder may be the user's.
    listed = folder / WRITTEN
    before = listed.read_text(encoding="utf-8").splitlines() if listed.is_file() else []
    for name in before:
        if name not in made and name == Path(name).name:
            (folder / name).unlink(missing_ok=True)
    for name, content in made.items():
        (folder / name).write_text(content, encoding="utf-8")
    listed.write_text("".join(f"{name}\n" for name in made), encoding="utf-8")


def _markdown(results: Results, content: PageContent) -> str:
    lines = [f"# {results.title}", "", headline(results, content.cells), ""]
    lines += [text for line in content.warnings for text in (f"**Warning: {line}.**", "")]
    lines += [text for line in content.setup for text in (line, "")]
    if content.settings.rows:
        lines += [f"{content.settings.caption}:", "", content.settings.markdown()]
    lines += ["The same with all details: [report/index.html](report/index.html).", ""]
    if results.problems:
        lines += ["## Warnings", "", *(f"- {line}" for line in results.problems), ""]
    for heading, tables in (
        ("Tables", content.tables),
        ("Beside published figures", content.comparisons),
        ("Differences", content.differences),
        ("Link and limits", [content.links, content.link, content.limits]),
    ):
        shown = [table for table in tables if table.rows]
        if shown:
            lines += [f"## {heading}", ""]
        for table in shown:
            lines += [f"{table.caption}:", "", table.markdown()]
        if heading == "Tables":
            notes = [f"- {cell.name}: {note}" for cell in content.cells for note in cell.notes]
            lines += [*notes, ""] if notes else []
        if heading == "Link and limits" and shown and is_virtual(results.runs):
            lines += [NO_LIMITS, ""]
    if content.figures or content.empty:
        lines += ["## Figures", ""]
    for figure in content.figures:
        lines += [f"![{figure.title}](report/{figure.name}.png)", "", figure.caption, ""]
    lines += [text for line in content.empty for text in (f"{line}.", "")]
    return "\n".join(lines)


def headline(results: Results, cells: list[Cell]) -> str:
    """Returns the most important line."""
    total, valid = len(results.runs), len(results.valid_runs)
    if total == 0:
        return "Nothing was measured."
    of = f" of {results.expected}" if results.expected and results.expected > total else ""
    several = "s" if len(cells) != 1 else ""
    line = (
        f"{total}{of} runs in {len(cells)} combination{several}, {valid} valid{_failed(results)}."
    )
    return f"{line} {hint}" if (hint := what_runs_show(cells)) else line


def _failed(results: Results) -> str:
    """Returns how many runs did not complete; empty if all did."""
    count = int(results.valid_runs["not_completed"].eq(True).sum())
    return f", {count} of them did not complete" if count else ""


def terminal_summary(
    experiment_dir: Path,
    console: Console | None = None,
    summary: ReportSummary | None = None,
    place: Path | None = None,
    said: bool = False,
) -> RenderableType:
    """Returns the tables for a terminal, and prints them if a console is given. `place` is the
    folder of the report, default the folder of the runs; `said`: the notes of the campaign, which
    name replaced sequences, are on the terminal already."""
    summary = summary or ReportSummary.of(load(experiment_dir))
    results, cells = summary.results, summary.cells
    parts: list[RenderableType] = [Text(f"{results.title}: {headline(results, cells)}")]
    for table in summary.tables + summary.comparisons:
        parts += [Text(""), table.rich()]
    parts += [Text(line) for line in program_lines(results.runs)]
    notes = [f"{cell.name}: {note}" for cell in cells for note in cell.notes] + results.problems
    warnings = summary.warnings[len(results.stand_ins) if said else 0 :]
    parts += [Text(f"! {line}", style=LOUD) for line in warnings]
    parts += [Text(f"! {line}") for line in notes[:MOST_TERMINAL_LINES]]
    if len(notes) > MOST_TERMINAL_LINES:
        parts.append(Text(f"! ... and {len(notes) - MOST_TERMINAL_LINES} more in report.md"))
    # A path on one line can be copied.
    page = f"report: {(place or experiment_dir) / 'report' / 'index.html'}"
    parts.append(Text(page, no_wrap=True, overflow="ignore"))
    group = Group(*parts)
    if console is not None:
        console.print(group, crop=False)
    return group
