# SPDX-License-Identifier: Apache-2.0
"""Style of all figures, and how they are saved: three formats, their data, and the command."""

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

# Okabe and Ito's palette (2008), which is safe for all common kinds of color vision. Yellow is left
# out because it is too pale on white. Markers and dashes repeat the distinction for grayscale
# prints.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
DASHES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))
GROUND_TRUTH = "#777777"
FAULT_COLORS = {"kill": "#D55E00", "freeze": "#56B4E9", "cut": "#999999"}
FAULT_SHADE = 0.18
FORMATS = ("png", "svg", "pdf")
POINTS = ".points.json"
"""Suffix of the file with a figure's points."""
ON_PAGES = ("png", "svg")
"""Formats that pages need; a PDF takes as long as everything else, because of its fonts."""
WIDTH_IN = 5.4
NAME_PT, NOTE_PT = 11, 9
"""Font sizes of names of bars and of notes; a page shows a figure 450 to 550 pixels wide."""
LEGEND_ROW_IN, KEY_IN, LETTER_IN = 0.17, 0.53, 0.068
"""Legend: height of a row, width of an entry without its text, and width per character."""
MOST_LEGEND_COLUMNS = 3
SQUEEZED_SHARE = 0.6
"""If the smallest value is above this fraction of the largest, an axis from 0 would hide
differences."""
PNG_DPI = 150
PICTURE_DPI = 110
"""For figures as wide as a screen."""

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
    "svg.hashsalt": "slambed",  # makes the bytes reproducible
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
    """Yields a figure in our style and closes it at the end."""
    # `lay_out` runs once; the figure's own layout engine would run once per format.
    with plt.rc_context(RC | {"figure.constrained_layout.use": False}):
        made, axes = plt.subplots(
            rows, columns, figsize=(WIDTH_IN, height_in), squeeze=False, **options
        )
        try:
            yield made, list(axes.ravel())
        finally:
            plt.close(made)


def legend_beneath(made: Figure, axis: Axes, handles: list[Any] | None = None) -> None:
    """Puts a legend under the figure, where it hides no curve, in as many columns as fit."""
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
    """Starts the x axis of costs at 0, unless all values are far from 0 and close together. Returns
    whether it starts at 0."""
    low, high = float(min(values)), float(max(values))
    if 0 <= low < SQUEEZED_SHARE * high or high == low == 0:
        axis.set_xlim(0, 1.05 * high if high > 0 else 1.0)
        return True
    reach = max(high - low, 0.02 * abs(high))
    axis.set_xlim(low - 0.15 * reach, high + 0.15 * reach)
    return False


def color(index: int) -> str:
    return COLORS[index % len(COLORS)]


def fault_color(fault: str) -> str:
    return FAULT_COLORS.get(fault, GROUND_TRUTH)


def marker(index: int) -> str:
    """Returns the n-th marker; the cycle is shifted each time colors repeat."""
    return MARKERS[(index + index // len(COLORS)) % len(MARKERS)]


def dash(index: int) -> Any:
    """Returns the n-th line style; the cycle is shifted each time colors repeat."""
    return DASHES[(index + index // len(COLORS)) % len(DASHES)]


@dataclass
class FigureWriter:
    """Saves figures into one folder and records them."""

    folder: Path
    command: str
    saved: list[SavedFigure]
    empty: list[str] = field(default_factory=list)
    """Figures that had nothing to show, a line each."""
    formats: tuple[str, ...] = FORMATS

    def has(self, figure: SavedFigure) -> bool:
        """Returns whether a figure of an earlier report exists in all these formats."""
        wanted = {f"{figure.name}.{kind}" for kind in self.formats}
        files = [*figure.files, figure.data]
        return wanted <= {*files} and all((self.folder / name).is_file() for name in files)

    def nothing(self, name: str, title: str, why: str) -> None:
        """Records why there is no such figure, and deletes one of an earlier report."""
        for suffix in (*(f".{kind}" for kind in FORMATS), POINTS, ".csv"):
            (self.folder / f"{name}{suffix}").unlink(missing_ok=True)
        self.empty.append(f"{title}: {why}")

    def save(self, made: Figure, name: str, title: str, caption: str, data: pd.DataFrame) -> None:
        """Writes `<name>.png/.svg/.pdf`, `<name>.points.json` and `<name>.csv`; files of other
        formats are deleted."""
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
        """Returns title and command for the file; without a date, so that the bytes are
        reproducible."""
        if kind == "pdf":
            return {"Title": title, "Subject": self.command, "CreationDate": None}
        date = {"Date": None} if kind == "svg" else {}
        return {"Title": title, "Description": self.command, **date}

    def write_list(self) -> Path:
        """Writes `figures.json`: every figure with its caption, files, data and command."""
        path = self.folder / "figures.json"
        self.folder.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps([asdict(item) for item in self.saved], indent=1) + "\n")
        return path


def save_picture(drawn: Callable[[], Figure], path: Path) -> None:
    """Saves one figure at a given path; the suffix is the format (png, svg or pdf)."""
    with plt.rc_context(RC):
        made = drawn()
        try:
            with writing(path):
                made.savefig(path, dpi=PICTURE_DPI)
        finally:
            plt.close(made)


def lay_out(made: Figure) -> None:
    """Lays out a figure, with wide titles on several lines."""
    layout = ConstrainedLayoutEngine()
    layout.execute(made)
    if _wrap_wide_texts(made):
        layout.execute(made)


def _titles_of(made: Figure) -> set[str]:
    return {made.get_suptitle(), *(axis.get_title() for axis in made.axes)}


def _wrap_wide_texts(made: Figure) -> bool:
    """Wraps titles that are wider than the figure; returns whether there were any."""
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
    """Returns a safe file name from labels."""
    joined = "_".join(part for part in parts if part)
    return "".join(c if c.isalnum() or c in "_-." else "-" for c in joined).strip("-")
