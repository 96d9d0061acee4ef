# SPDX-License-Identifier: Apache-2.0
"""`slambed diff --html`: writes the comparison as one self-contained page."""

import base64
import io
import json
from pathlib import Path

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from slambed.files.outputs import writing
from slambed.regression.diff import Change, LeftOut, diff_table, left_out_lines
from slambed.regression.diff_sides import Sides, sides_table
from slambed.report.figure_points import points_of
from slambed.report.page import in_page, page_script, render
from slambed.report.style import COLORS, NOTE_PT, figure, lay_out

MOST_DRAWN = 24
"""Most comparisons in the figure, smallest p first."""
ROW_IN, AROUND_IN = 0.36, 1.0
MOOD = {"better": "good", "worse": "bad"}
DRAWN = {"better": (COLORS[2], "o"), "worse": (COLORS[1], "s"), "changed": (COLORS[0], "D")}
NOT_SHOWN = ("#777777", "o")
WIDEST = 200.0
"""Percent of A; larger changes are drawn at the edge."""


def write_diff_page(
    found: list[Change], sides: Sides, path: Path, left_out: list[LeftOut] | None = None
) -> None:
    """Writes the page. Raises SlambedError if the file cannot be written."""
    table = diff_table(found, sides)
    beside = sides_table(sides)
    drawn = [change for change in by_p(found) if relative(change) is not None]
    heads = "\n".join(sides.headings()) if sides.differing else ""
    picture, points = _forest(drawn[:MOST_DRAWN], heads) if drawn else ("", Markup())
    page = render(
        "diff.html.j2",
        "slambed.regression",
        title=_title(sides),
        lines=sides.lines,
        tiles=_tiles(found),
        sides=beside,
        differs=any(own != other for _, own, other in beside.rows),
        problems=[*_problems(sides), *left_out_lines(left_out or [])],
        table=table,
        moods=[MOOD.get(row[-1], "") for row in table.rows],
        figure=picture,
        points=points,
        script=Markup(page_script()),
        drawn=min(len(drawn), MOST_DRAWN),
        not_drawn=len(found) - min(len(drawn), MOST_DRAWN),
        any_shown=any(change.shown for change in found),
    )
    with writing(path, "--html"):
        path.write_text(page, encoding="utf-8")


def _title(sides: Sides) -> str:
    titles = list(dict.fromkeys((sides.a.results.title, sides.b.results.title)))
    a, b = sides.names
    return " against ".join(titles) + (f": {a} against {b}" if a and b else "")


def _problems(sides: Sides) -> list[str]:
    """Returns the problems of both sides; those of one folder only once."""
    both = (sides.a.results, sides.b.results)
    a, b = ([*results.stand_ins, *results.problems] for results in both)
    if sides.a.results.folder == sides.b.results.folder:
        return list(dict.fromkeys([*a, *b]))
    return [f"{letter}: {line}" for letter, own in (("A", a), ("B", b)) for line in own]


def by_p(found: list[Change]) -> list[Change]:
    """Sorts changes like the table."""
    return sorted(found, key=lambda change: change.p_value)


def relative(change: Change) -> tuple[float, float, float] | None:
    """Returns value and interval of the change in percent of A, or in points for a share; None
    without a scale."""
    unit = 1.0 if change.metric.kind == "share" else abs(change.a)
    ends = np.array([change.change.value, change.change.low, change.change.high])
    if not unit or not np.isfinite(unit) or not np.isfinite(ends).all():
        return None
    value, low, high = (100 * ends / unit).tolist()
    return value, low, high


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


def _forest(changes: list[Change], sides: str) -> tuple[str, Markup]:
    """Draws a row per comparison: the change with its 95 % interval, or its range. Returns the
    image as a URI, and its points for the script."""
    with figure(height_in=AROUND_IN + ROW_IN * len(changes)) as (made, (axis,)):
        for row, change in enumerate(changes):
            ends = relative(change)
            assert ends is not None
            value, low, high = np.clip(ends, -WIDEST, WIDEST)
            color, marker = DRAWN.get(change.verdict, NOT_SHOWN)
            label = "range" if change.change.is_range else "95 % interval"
            axis.plot([low, high], [row, row], color=color, label=label)
            axis.plot([value], [row], marker, color=color, label=change.verdict)
        axis.axvline(0, color="black", linewidth=0.8)
        labels = [f"{change.metric.name}\n{change.cell}" for change in changes]
        axis.set_yticks(range(len(changes)), labels, fontsize=NOTE_PT - 1)
        axis.set_ylim(len(changes) - 0.5, -0.5)
        axis.set_xlabel("B - A in % of A (shares: points)")
        made.suptitle(sides, fontsize=NOTE_PT)
        lay_out(made)
        return _uri(made), in_page(json.dumps(points_of(made), separators=(",", ":")))


def _uri(made: Figure) -> str:
    out = io.BytesIO()
    made.savefig(out, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(out.getvalue()).decode()
