# SPDX-License-Identifier: Apache-2.0
"""How every figure looks, and how it is saved: three formats, its data, and what made it."""

import json
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Text

from slambed.files.outputs import writing
from slambed.report.figure_points import points_of

# Okabe and Ito's palette (2008), distinguished by all common kinds of color vision. Yellow is left
# out: it is too pale on white. Markers and dashes repeat the distinction for gray prints.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
DASHES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))
GROUND_TRUTH = "#777777"
FAULT_COLORS = {"kill": "#D55E00", "freeze": "#56B4E9", "cut": "#999999"}
FAULT_SHADE = 0.18
FORMATS = ("png", "svg", "pdf")
POINTS = ".points.json"
"""Beside a figure: what can be pointed at in it."""
ON_PAGES = ("png", "svg")
"""What pages show; the fonts of a PDF take as long as all else of a figure."""
WIDTH_IN = 5.4
NAME_PT, NOTE_PT = 11, 9
"""Names of bars, and what stands beside marks: a page shows a figure 450 to 550 pixels wide."""
LEGEND_ROW_IN, KEY_IN, LETTER_IN = 0.17, 0.53, 0.068
"""Of a legend: the height of a row, and what an entry takes beside its text and per letter."""
MOST_LEGEND_COLUMNS = 3
SQUEEZED_SHARE = 0.6
"""Where the smallest value is above this share of the largest, an axis from 0 shows only that."""
PNG_DPI = 150
PICTURE_DPI = 110
"""Of pictures as wide as a screen."""

RC: Any = {
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "pdf.fonttype": 42,  # text stays text in PDF
    "svg.fonttype": "path",
    "svg.hashsalt": "slambed",  # the same figure gives the same bytes
}


@dataclass(frozen=True)
class SavedFigure:
    """A figure on disk; files are names inside the report folder."""

    name: str
    title: str
    caption: str
    command: str
    files: list[str]
    data: str


@contextmanager
def figure(
    rows: int = 1, columns: int = 1, height_in: float = 3.4, **options: Any
) -> Iterator[tuple[Figure, list[Axes]]]:
    """A figure in our style; closed at the end whatever happens."""
    # `lay_out` does it once; an engine of the figure's own draws it once more per format.
    with plt.rc_context(RC | {"figure.constrained_layout.use": False}):
        made, axes = plt.subplots(
            rows, columns, figsize=(WIDTH_IN, height_in), squeeze=False, **options
        )
        try:
            yield made, list(axes.ravel())
        finally:
            plt.close(made)


def legend_beneath(made: Figure, axis: Axes, handles: list[Any] | None = None) -> None:
    """A legend under the figure, where it hides no curve, as wide as it may be."""
    found, names = axis.get_legend_handles_labels()
    if handles is not None:
        found, names = handles, [str(handle.get_label()) for handle in handles]
    if not found:
        return
    widest_in = KEY_IN + LETTER_IN * max(map(len, names))
    columns = max(1, min(len(names), MOST_LEGEND_COLUMNS, int(WIDTH_IN / widest_in)))
    rows = -(-len(names) // columns)
    made.set_size_inches(made.get_figwidth(), made.get_figheight() + LEGEND_ROW_IN * rows)
    made.legend(found, names, loc="outside lower center", ncols=columns)


def from_zero_if_it_shows(axis: Axes, values: Any) -> bool:
    """Begins the x axis of costs at 0 unless all values are far from it and would be squeezed to
    the edge; whether it begins there."""
    low, high = float(min(values)), float(max(values))
    if 0 <= low < SQUEEZED_SHARE * high or high == low == 0:
        axis.set_xlim(0, 1.05 * high if high > 0 else 1.0)
        return True
    reach = max(high - low, 0.02 * abs(high))
    axis.set_xlim(low - 0.15 * reach, high + 0.15 * reach)
    return False


def color(index: int) -> str:
    """Color of the n-th thing."""
    return COLORS[index % len(COLORS)]


def fault_color(fault: str) -> str:
    """Color of a kind of fault."""
    return FAULT_COLORS.get(fault, GROUND_TRUTH)


def marker(index: int) -> str:
    """Marker of the n-th thing; where colors begin anew the markers do not."""
    return MARKERS[(index + index // len(COLORS)) % len(MARKERS)]


def dash(index: int) -> Any:
    """Line style of the n-th thing; where colors begin anew the styles do not."""
    return DASHES[(index + index // len(COLORS)) % len(DASHES)]


@dataclass
class FigureWriter:
    """Saves figures into one folder and keeps the list of them."""

    folder: Path
    command: str
    saved: list[SavedFigure]
    empty: list[str] = field(default_factory=list)
    """Figures that had nothing to show, a line each."""
    formats: tuple[str, ...] = FORMATS

    def has(self, figure: SavedFigure) -> bool:
        """Whether a figure of an earlier report is there, in all these formats."""
        wanted = {f"{figure.name}.{kind}" for kind in self.formats}
        files = [*figure.files, figure.data]
        return wanted <= {*files} and all((self.folder / name).is_file() for name in files)

    def nothing(self, name: str, title: str, why: str) -> None:
        """Says why there is no such figure; one of an earlier report goes."""
        for suffix in (*(f".{kind}" for kind in FORMATS), POINTS, ".csv"):
            (self.folder / f"{name}{suffix}").unlink(missing_ok=True)
        self.empty.append(f"{title}: {why}")

    def save(self, made: Figure, name: str, title: str, caption: str, data: pd.DataFrame) -> None:
        """Writes `<name>.png/.svg/.pdf`, `<name>.points.json` and `<name>.csv`; a format that is
        not asked for goes."""
        self.folder.mkdir(parents=True, exist_ok=True)
        files: list[str] = []
        lay_out(made)
        for kind in FORMATS:
            file = f"{name}.{kind}"
            if kind not in self.formats:
                (self.folder / file).unlink(missing_ok=True)
                continue
            made.savefig(self.folder / file, dpi=PNG_DPI, metadata=self._facts(kind, title))
            files.append(file)
        points = f"{name}{POINTS}"
        (self.folder / points).write_text(json.dumps(points_of(made), separators=(",", ":")) + "\n")
        files.append(points)
        data.to_csv(self.folder / f"{name}.csv", index=False, float_format="%.6g")
        self.saved.append(SavedFigure(name, title, caption, self.command, files, f"{name}.csv"))

    def _facts(self, kind: str, title: str) -> dict[str, Any]:
        """Title and command inside the file; no date, so that the same figure is the same file."""
        if kind == "pdf":
            return {"Title": title, "Subject": self.command, "CreationDate": None}
        date = {"Date": None} if kind == "svg" else {}
        return {"Title": title, "Description": self.command, **date}

    def write_list(self) -> Path:
        """`figures.json`: every figure with its caption, files, data and command."""
        path = self.folder / "figures.json"
        self.folder.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps([asdict(item) for item in self.saved], indent=1) + "\n")
        return path


def save_picture(drawn: Callable[[], Figure], path: Path) -> None:
    """One figure at the place that somebody named; its format is the suffix (png, svg or pdf)."""
    with plt.rc_context(RC):
        made = drawn()
        try:
            with writing(path):
                made.savefig(path, dpi=PICTURE_DPI)
        finally:
            plt.close(made)


def lay_out(made: Figure) -> None:
    """Puts everything of a figure at its place, wide titles on several lines."""
    layout = ConstrainedLayoutEngine()
    layout.execute(made)
    if _wrap_wide_texts(made):
        layout.execute(made)


def _titles_of(made: Figure) -> set[str]:
    return {made.get_suptitle(), *(axis.get_title() for axis in made.axes)}


def _wrap_wide_texts(made: Figure) -> bool:
    """Breaks titles that are wider than the figure; whether there were any."""
    wide = False
    whole_px = made.get_figwidth() * made.dpi
    titles = made.findobj(Text)
    titles = [t for t in titles if t.get_text() and t.get_text() in _titles_of(made)]
    for title in titles:
        box = title.get_window_extent()
        over = 2 * max(-box.x0, box.x1 - whole_px, 0.0)
        if over > 0 and box.width > 0:
            letters = int(len(title.get_text()) * (box.width - over) / box.width)
            title.set_text(textwrap.fill(title.get_text(), max(20, letters)))
            wide = True
    return wide


def file_name(*parts: str) -> str:
    """A harmless file name from labels."""
    joined = "_".join(part for part in parts if part)
    return "".join(c if c.isalnum() or c in "_-." else "-" for c in joined).strip("-")
