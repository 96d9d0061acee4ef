# SPDX-License-Identifier: Apache-2.0
"""Writes the report as one self-contained HTML file."""

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup

from slambed.metrics.catalog import metric
from slambed.report.cells import Cell, number, what_runs_show
from slambed.report.load import Results
from slambed.report.overview import CAPTION, overviews, to_timeline
from slambed.report.page import in_page, page_script, render
from slambed.report.setup import NO_LIMITS, is_virtual
from slambed.report.style import POINTS, SavedFigure
from slambed.report.tables import Table
from slambed.report.timeline import timeline_svg
from slambed.report.told import told
from slambed.spec.run_spec import run_name

MOST_RUNS = 300
MOST_TIMELINES = 24
SHORT_COMMIT = 7
"""Characters of a short hash, as in git; section "Manifest" has the full one."""
MOST_SVG_BYTES = 150_000
"""A figure larger than this as SVG is inlined as PNG."""


@dataclass
class PageContent:
    """Everything the page shows besides `Results`."""

    warnings: list[str]
    """What a reader must know before any number."""
    setup: list[str]
    """Engines, devices and compute times, in sentences."""
    settings: Table
    cells: list[Cell]
    tables: list[Table]
    differences: list[Table]
    comparisons: list[Table]
    links: Table
    link: Table
    limits: Table
    figures: list[SavedFigure]
    left_out: int
    empty: list[str]
    """Figures that had nothing to show, and why."""


def write_html(results: Results, content: PageContent, folder: Path) -> Path:
    """Writes `<folder>/index.html`."""
    pictures = overviews(results)
    in_pictures = {key for picture in pictures for key in picture.shown}
    runs = [_run(results, row) for row in _chosen_runs(results.runs, in_pictures)]
    wanted = [run for run in runs if run["wanted"]]
    wanted.sort(key=lambda run: run["key"] not in in_pictures)
    for run in wanted[: max(MOST_TIMELINES, len(in_pictures))]:
        run["timeline"] = timeline_svg(results, run["key"], to_timeline(run["key"]))
    sections = [
        ("tables", "Tables"), ("papers", "Beside published figures"),
        ("differences", "Differences"), ("figures", "Figures"), ("runs", "Runs"),
        ("validity", "Link and limits"), ("setup", "Setup"), ("manifest", "Manifest"),
    ]  # fmt: skip
    first, *further = content.tables or [Table("cells_1", "", [])]
    if not content.comparisons:
        sections.remove(("papers", "Beside published figures"))
    if not any(table.rows for table in content.differences):
        sections.remove(("differences", "Differences"))
    page = render(
        "report.html.j2",
        title=results.title,
        name=results.name,
        notes=results.spec.get("notes") or "",
        sections=dict(sections),
        told=told(results),
        pictures=pictures,
        picture_caption=CAPTION,
        first=first,
        tiles=_tiles(results, content.cells),
        warnings=content.warnings,
        setup=content.setup,
        settings=content.settings,
        hint=_hint(content.cells),
        problems=results.problems,
        tables=further,
        cell_notes=[(cell.name, note) for cell in content.cells for note in cell.notes],
        comparisons=content.comparisons,
        differences=[table for table in content.differences if table.rows],
        figures=[
            {**vars(item), "uri": _uri(folder, item), "points": _points(folder, item)}
            for item in content.figures
        ],
        script=Markup(page_script()),
        left_out=content.left_out,
        empty=content.empty,
        links=content.links,
        link=content.link,
        limits=content.limits,
        no_limits=NO_LIMITS if is_virtual(results.runs) else "No limits were recorded.",
        runs=runs,
        runs_left_out=len(results.runs) - len(runs),
        facts=[
            (name, value, count)
            for name, values in results.facts.items()
            for value, count in values.most_common(5)
        ],
    )
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "index.html"
    path.write_text(page, encoding="utf-8")
    return path


def _tiles(results: Results, cells: list[Cell]) -> list[tuple[str, str, str]]:
    total, valid = len(results.runs), len(results.valid_runs)
    lost = int(results.valid_runs["lost"].eq(True).sum())
    failed = int(results.valid_runs["not_completed"].eq(True).sum())
    expected = results.expected
    all_there = expected is None or total >= expected
    runs = f"{total}" if all_there else f"{total} of {expected}"
    proofs = pd.to_numeric(results.runs["rtt_error_ms_median"]).dropna()
    tiles = [
        (runs, "runs", "" if all_there and total else "bad"),
        (f"{valid}", "valid runs", "good" if valid == total and total else "bad"),
        (f"{lost}", "valid runs with a track loss", ""),
        (f"{failed}", "valid runs that did not complete", "bad" if failed else ""),
        (f"{len(cells)}", "combinations", ""),
    ]
    if len(proofs):
        tiles.append((f"{proofs.max():.2f} ms", "largest median RTT error of a run", ""))
    commits = list(results.facts.get("commit", {}))
    if commits:
        dirty = "True" in results.facts.get("dirty", {})
        text = commits[0][:SHORT_COMMIT] if len(commits) == 1 else f"{len(commits)} commits"
        tiles.append((text + ("+" if dirty else ""), "commit (+: changed files)", ""))
    return tiles


def _hint(cells: list[Cell]) -> str:
    if not cells:
        return "Nothing was measured."
    return what_runs_show(cells)


def _chosen_runs(runs: pd.DataFrame, in_pictures: set[str]) -> list[dict[str, Any]]:
    """Returns all runs; of a large campaign the failed and lossy ones, then those of the pictures
    and the first of every cell."""
    flagged = ~runs["valid"].eq(True) | runs["not_completed"].eq(True) | runs["lost"].eq(True)
    first = ~runs.duplicated("cell") | runs["run_key"].isin(in_pictures)
    marked = runs.assign(wanted=flagged | first)
    if len(runs) > MOST_RUNS:
        shown = marked["run_key"].isin(in_pictures)
        kept = pd.concat(
            [
                marked[shown],
                marked[flagged & ~shown].head(MOST_RUNS // 2),
                marked[first & ~flagged & ~shown],
            ]
        )
        marked = kept.head(MOST_RUNS).sort_index()
    return [{str(k): v for k, v in row.items()} for row in marked.to_dict("records")]


def _run(results: Results, row: dict[str, Any]) -> dict[str, Any]:
    valid, completed = row["valid"] is True, row["outcome"] == "completed"
    outcome = str(row["outcome"]).replace("_", " ")
    if not completed:
        outcome += f": {row['outcome_reason']}"
    if not valid:
        outcome += f"; invalid: {row['invalid_reason']}"
    return {
        "key": row["run_key"],
        "name": run_name(row["cell"], row["repetition"]),
        "outcome": outcome,
        "mood": "" if valid and completed else "bad",
        "coverage": f"{metric('coverage').show(number(row['coverage']))} %",
        "losses": _count(row["track_losses"]),
        "ate": metric("ate_rmse_m").show(number(row["ate_rmse_m"])),
        "timeline": None,
        "wanted": bool(row["wanted"]),
    }


def _count(value: object) -> str:
    found = number(value)
    return "-" if found is None else f"{found:.0f}"


def _points(folder: Path, item: SavedFigure) -> Markup:
    return in_page((folder / f"{item.name}{POINTS}").read_text(encoding="utf-8"))


def _uri(folder: Path, item: SavedFigure) -> str:
    svg = (folder / f"{item.name}.svg").read_bytes()
    if len(svg) <= MOST_SVG_BYTES:
        return "data:image/svg+xml;base64," + base64.b64encode(svg).decode()
    png = (folder / f"{item.name}.png").read_bytes()
    return "data:image/png;base64," + base64.b64encode(png).decode()
