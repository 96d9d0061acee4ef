# SPDX-License-Identifier: Apache-2.0
"""`slambed diff --html`: the comparison of two results folders as one self-contained page."""

import base64
import io
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from slambed.outputs import writing
from slambed.report.cells import text
from slambed.report.diff import Change, diff_table
from slambed.report.load import Results
from slambed.report.page import render
from slambed.report.style import COLOURS, NOTE_PT, RC, WIDTH_IN
from slambed.report.tables import Table

MOST_DRAWN = 24
"""Comparisons in the figure, those with the smallest p first."""
ROW_IN, AROUND_IN = 0.36, 0.6
MOOD = {"better": "good", "worse": "bad"}
DRAWN = {"better": (COLOURS[2], "o"), "worse": (COLOURS[1], "s"), "changed": (COLOURS[0], "D")}
NOT_SHOWN = ("#777777", "o")
WIDEST = 200.0
"""Percent of A; what changed by more than that stands at the edge."""


def write_diff_page(found: list[Change], a: Results, b: Results, path: Path) -> None:
    """Writes the page. Raises SlambedError where that cannot be done."""
    table = diff_table(found, str(a.folder), str(b.folder))
    beside = sides(a, b)
    drawn = [change for change in by_p(found) if relative(change) is not None]
    page = render(
        "diff.html.j2",
        title=f"{a.title} against {b.title}" if a.title != b.title else a.title,
        a=str(a.folder),
        b=str(b.folder),
        tiles=_tiles(found),
        sides=beside,
        differs=any(own != other for _, own, other in beside.rows),
        problems=[f"{name}: {x}" for name, side in (("A", a), ("B", b)) for x in side.problems],
        table=table,
        moods=[MOOD.get(row[-1], "") for row in table.rows],
        figure=_uri(_forest(drawn[:MOST_DRAWN])) if drawn else "",
        drawn=min(len(drawn), MOST_DRAWN),
        not_drawn=len(found) - min(len(drawn), MOST_DRAWN),
        any_shown=any(change.shown for change in found),
    )
    with writing(path, "--html"):
        path.write_text(page, encoding="utf-8")


def by_p(found: list[Change]) -> list[Change]:
    """In the order of the table."""
    return sorted(found, key=lambda change: change.p_value)


def relative(change: Change) -> tuple[float, float, float] | None:
    """Value and ends of the change in percent of A, of a share in points; None without a scale."""
    unit = 1.0 if change.metric.kind == "share" else abs(change.a)
    ends = np.array([change.change.value, change.change.low, change.change.high])
    if not unit or not np.isfinite(unit) or not np.isfinite(ends).all():
        return None
    value, low, high = (100 * ends / unit).tolist()
    return value, low, high


def sides(a: Results, b: Results) -> Table:
    """What was compared: where it differs lies the reason, if anywhere."""
    rows = [
        ["runs to be trusted", *(f"{len(s.trusted)} of {len(s.runs)}" for s in (a, b))],
        ["engine", _words(a, "engine"), _words(b, "engine")],
        ["systems", _words(a, "label"), _words(b, "label")],
        ["first run", _first(a), _first(b)],
    ]
    rows += [
        [name.replace("_", " "), _most(a, name), _most(b, name)]
        for name in ("commit", "cpu_model", "cores", "kernel")
    ]
    return Table("sides", "The two sides", ["", "A", "B"], rows, words=3)


def _first(side: Results) -> str:
    return min(map(text, side.runs["started_utc"].dropna()), default="-")


def _words(side: Results, column: str) -> str:
    return ", ".join(dict.fromkeys(map(text, side.runs[column].dropna()))) or "-"


def _most(side: Results, fact: str) -> str:
    values = list(side.facts.get(fact, {}))
    changed = "+" if fact == "commit" and "True" in side.facts.get("dirty", {}) else ""
    return ", ".join(f"{value[:40]}{changed}" for value in values) or "-"


def _tiles(found: list[Change]) -> list[tuple[str, str, str]]:
    verdicts = [change.verdict for change in found]
    worse, better = verdicts.count("worse"), verdicts.count("better")
    blind = verdicts.count("too few runs to show any")
    tiles = [
        (str(len(found)), "comparisons", ""),
        (str(worse), "worse in B", "bad" if worse else ""),
        (str(better), "better in B", "good" if better else ""),
        (str(verdicts.count("no change shown")), "show no change", ""),
    ]
    other = verdicts.count("changed")
    if other:
        tiles.insert(3, (str(other), "changed, neither better nor worse", ""))
    return tiles + ([(str(blind), "with too few runs to show any", "bad")] if blind else [])


def _forest(changes: list[Change]) -> Figure:
    """A row for each comparison: the change with its 95 % interval."""
    with plt.rc_context(RC):
        made, axis = plt.subplots(figsize=(WIDTH_IN, AROUND_IN + ROW_IN * len(changes)))
        for row, change in enumerate(changes):
            ends = relative(change)
            assert ends is not None
            value, low, high = np.clip(ends, -WIDEST, WIDEST)
            colour, marker = DRAWN.get(change.verdict, NOT_SHOWN)
            axis.plot([low, high], [row, row], color=colour)
            axis.plot([value], [row], marker, color=colour)
        axis.axvline(0, color="black", linewidth=0.8)
        labels = [f"{change.metric.name}\n{change.cell}" for change in changes]
        axis.set_yticks(range(len(changes)), labels, fontsize=NOTE_PT - 1)
        axis.set_ylim(len(changes) - 0.5, -0.5)
        axis.set_xlabel("B - A in % of A (shares: points)")
        return made


def _uri(made: Figure) -> str:
    out = io.BytesIO()
    with plt.rc_context(RC):
        made.savefig(out, format="svg", metadata={"Date": None})
    plt.close(made)
    return "data:image/svg+xml;base64," + base64.b64encode(out.getvalue()).decode()
