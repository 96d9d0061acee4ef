# SPDX-License-Identifier: Apache-2.0
"""Writes the page that compares the variants of all papers on the same sequences: one row per
variant, one small picture per sequence."""

from dataclasses import dataclass
from math import isfinite, log
from pathlib import Path

import pandas as pd
from markupsafe import Markup, escape

from slambed.papers.environment import environment
from slambed.papers.origin import origin_words
from slambed.report.experiment import write_tables
from slambed.report.load import Results
from slambed.report.page import STYLE
from slambed.report.tables import Table

ALL_SYSTEMS = "x_all_systems"
"""The experiment that the page shows."""
PAGE = "systems.html"
RARELY = 0.1
"""Up to this share of runs with a track loss a cell counts as one that keeps track."""
MOST_NAMED = 2
"""Up to so many variants that never lose track are named."""
COLUMN = 30
PLOT = 40
BARS = 12
MARGIN = 5
"""Width of a link, height of the errors, of the shares lost, and of the room for a dot at the upper
end, in pixels."""
REM = 2.3
"""Width of a link on the page."""
LARGEST_M = 1.0
SMALLEST_M = 0.001
"""Ends of the axis of errors in m; others are drawn at the edge."""


@dataclass(frozen=True)
class Cell:
    """The runs of a variant on one sequence, link and board."""

    variant: str
    board: str
    sequence: str
    link: str
    runs: int
    measured: int
    """Runs of which it is known whether they lost track."""
    lost: int
    error_m: float
    """Median ATE RMSE; NaN if no run has one."""
    coverage: float
    """Median share of the frames with a pose."""

    @property
    def words(self) -> str:
        known = isfinite(self.error_m)
        error = f"median ATE RMSE {100 * self.error_m:.2g} cm" if known else "no ATE RMSE"
        losses = f"{self.lost} of {self.measured} runs lost track"
        if not self.measured:
            losses = "track losses not measured"
        return f"{self.variant}, {self.board}, {self.link}: {error}, {losses}"


def cells_of_runs(results: Results) -> list[Cell]:
    """Returns one cell per variant, board, sequence and link, in the order of the experiment."""
    runs = results.valid_runs
    named = runs.assign(
        row=runs["label"].str.replace(r" \[[^\]]*\]", "", regex=True),
        scene=runs["dataset"].map(scene_of),
    )
    found = []
    for key, own in named.groupby(["row", "device_mobile", "scene", "profile"], sort=False):
        row, board, scene, link = map(str, key)
        losses = pd.to_numeric(own["track_losses"])
        found.append(
            Cell(
                row,
                board,
                scene,
                link,
                len(own),
                int(losses.notna().sum()),
                int(losses.gt(0).sum()),
                float(own["ate_rmse_m"].median()),
                float(own["coverage"].median()),
            )
        )
    return found


def scene_of(dataset: str) -> str:
    """Returns the sequence without its sensor: the same walk with depth and with one camera."""
    return dataset.replace("mono_", "").removesuffix("_mono")


def takeaway(cells: list[Cell]) -> list[str]:
    """Returns what the runs show, in a reader's words."""
    cells = [cell for cell in cells if cell.measured]
    if not cells:
        return ["Track losses were not measured."]
    kept = sum(cell.lost <= RARELY * cell.measured for cell in cells)
    of_all = f"In {kept} of {len(cells)} combinations"
    fewer = max(cell.measured for cell in cells) * RARELY < 1
    rarely = "no run loses" if fewer else f"at most {100 * RARELY:.0f} % of the runs lose"
    first = f"{of_all} {rarely} track."
    shares = {
        name: sum(c.lost for c in own) / sum(c.measured for c in own)
        for name in dict.fromkeys(cell.variant for cell in cells)
        if (own := [cell for cell in cells if cell.variant == name])
    }
    never = [name for name, share in shares.items() if not share]
    most = max(shares, key=lambda name: shares[name])
    loses = "lose" if len(never) > 1 else "loses"
    variants = f"variant{'' if len(shares) == 1 else 's'}"
    named = f" ({' and '.join(never)})" if 0 < len(never) <= MOST_NAMED else ""
    second = f"{len(never) or 'None'} of {len(shares)} {variants} never {loses} it{named}."
    if shares[most]:
        second += f" {most} loses it most often, in {100 * shares[most]:.0f} % of its runs."
    return [f"{first} {second}"]


def cell_svg(cells: list[Cell], links: list[str], boards: list[str]) -> Markup:
    """Returns one small picture: errors above, shares of runs with a loss below, by link and
    board."""
    width, height = COLUMN * len(links), PLOT + BARS + 4
    parts = [f'<line class="tickline" x1="0" x2="{width}" y1="{PLOT}" y2="{PLOT}"/>']
    parts += [
        f'<line class="grid" x1="0" x2="{width}" y1="{_height(error):.1f}" '
        f'y2="{_height(error):.1f}"/>'
        for error in (0.01, 0.1)
    ]
    for cell in cells:
        board = boards.index(cell.board)
        middle = COLUMN * (links.index(cell.link) + (board + 1) / (len(boards) + 1))
        share = cell.lost / cell.measured if cell.measured else 0.0
        dot = ""
        if isfinite(cell.error_m):
            at = f'cx="{middle:.1f}" cy="{_height(cell.error_m):.1f}"'
            dot = f'<circle class="b{board}" {at} r="3.4"/>'
        at = f'x="{middle - 4:.1f}" y="{PLOT + 2}"'
        bar = f'<rect class="lost" {at} width="8" height="{BARS * share:.1f}"/>'
        parts.append(f"<g><title>{escape(cell.words)}</title>{dot}{bar}</g>")
    return Markup(
        f'<svg class="cell" style="width: {REM * len(links):g}rem" '
        f'viewBox="0 {-MARGIN} {width} {height + MARGIN}" role="img" '
        f'aria-label="{escape("; ".join(cell.words for cell in cells))}">{"".join(parts)}</svg>'
    )


def head_svg(links: list[str]) -> Markup:
    """Returns the numbers of the links, above their columns."""
    texts = "".join(
        f'<text x="{COLUMN * (number + 0.5):g}" y="11">{number + 1}</text>'
        for number in range(len(links))
    )
    return Markup(
        f'<svg class="cell" style="width: {REM * len(links):g}rem" '
        f'viewBox="0 0 {COLUMN * len(links)} 14" aria-hidden="true">{texts}</svg>'
    )


def _height(error_m: float) -> float:
    """Returns the position of an error in pixels from the top."""
    inside = min(LARGEST_M, max(SMALLEST_M, error_m))
    return PLOT * (1 - log(inside / SMALLEST_M) / log(LARGEST_M / SMALLEST_M))


def cross_table(cells: list[Cell]) -> Table:
    """Returns all cells as numbers."""
    headings = ["variant", "board", "sequence", "link", "runs", "runs with a loss", "ATE RMSE [cm]"]
    table = Table(
        "all_systems", "All variants on the same sequences", [*headings, "coverage [%]"], words=4
    )
    for c in cells:
        error = f"{100 * c.error_m:.3g}" if isfinite(c.error_m) else "-"
        table.rows.append(
            [
                c.variant,
                c.board,
                c.sequence,
                c.link,
                str(c.runs),
                _losses(c),
                error,
                f"{100 * c.coverage:.1f}" if isfinite(c.coverage) else "-",
            ]
        )
    return table


def _losses(cell: Cell) -> str:
    if cell.measured == cell.runs:
        return str(cell.lost)
    return f"{cell.lost} of {cell.measured}" if cell.measured else "-"


def write_cross_page(results: Results, folder: Path) -> Path | None:
    """Writes `<folder>/systems.html` and its table; None if no run is valid."""
    cells = cells_of_runs(results) if len(results.valid_runs) else []
    if not cells:
        return None

    def each(values: "pd.Series[str] | list[str]") -> list[str]:
        return list(dict.fromkeys(values))

    links, boards = each([c.link for c in cells]), each([c.board for c in cells])
    scenes = each([c.sequence for c in cells])
    counts = [c.runs for c in cells]
    rows = [
        (
            variant,
            [
                cell_svg(
                    [c for c in cells if (c.variant, c.sequence) == (variant, s)], links, boards
                )
                for s in scenes
            ],
        )
        for variant in each([c.variant for c in cells])
    ]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / PAGE
    page = environment().get_template("cross.html.j2").render(
        style=Markup(STYLE), headline=takeaway(cells), rows=rows, scenes=scenes, links=links,
        boards=boards, head=head_svg(links), counts=sorted({min(counts), max(counts)}),
        experiment=results.name, origin=origin_words([results]),
    )  # fmt: skip
    path.write_text(page, encoding="utf-8")
    write_tables([cross_table(cells)], folder / "tables")
    return path
