# SPDX-License-Identifier: Apache-2.0
"""Extracts the values of a figure and their places, for the script that shows values under the
pointer.

The image itself is unchanged; the script only overlays it.
"""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

MOST_POINTS = 1000
"""Most points of a curve: a pointer cannot resolve more."""
DIGITS = 5
Floats = NDArray[np.float64]


def points_of(made: Figure) -> dict[str, Any]:
    """Returns per axes its box in the image (fractions of width and height from the upper left),
    its scales, curves and bars. The figure must be laid out."""
    return {"axes": [_axes(axis) for axis in made.axes]}


def _axes(axis: Axes) -> dict[str, Any]:
    box = axis.get_position()
    return {
        "box": [_short(v) for v in (box.x0, 1 - box.y1, box.x1, 1 - box.y0)],
        "x": _scale(axis, "x"),
        "y": _scale(axis, "y"),
        "curves": [curve for curve in _curves(axis) if curve["x"]],
        "bars": _bars(axis),
    }


def _scale(axis: Axes, which: str) -> dict[str, Any]:
    own = axis.xaxis if which == "x" else axis.yaxis
    limits = axis.get_xlim() if which == "x" else axis.get_ylim()
    texts = [
        (t.get_position()[0 if which == "x" else 1], t.get_text()) for t in own.get_ticklabels()
    ]
    # Tick labels that do not parse as numbers are names of cells and stages.
    named = [
        [float(at), " ".join(text.split())] for at, text in texts if text and not _is_number(text)
    ]
    return {
        "label": own.get_label_text(),
        "scale": "log" if own.get_scale() == "log" else "linear",
        "limits": [_short(float(limits[0])), _short(float(limits[1]))],
        "names": named,
    }


def _is_number(text: str) -> bool:
    if "$" in text:  # a power of ten in mathtext
        return True
    try:
        float(text.replace("\N{MINUS SIGN}", "-"))
    except ValueError:
        return False
    return True


def _hex(color: Any) -> str:
    return to_hex(to_rgba(color))


def _curves(axis: Axes) -> list[dict[str, Any]]:
    found = []
    for line in axis.lines:
        if line.get_transform() != axis.transData:  # a mark at the edge, not data
            continue
        points = np.asarray(line.get_xydata(), dtype=np.float64)
        found.append(_curve(axis, points, str(line.get_label()), _hex(line.get_color())))
    for group in axis.collections:
        if isinstance(group, PathCollection) and group.get_offset_transform() == axis.transData:
            colors = group.get_facecolor()
            color = _hex(colors[0]) if len(colors) else "#000000"
            points = np.ma.getdata(group.get_offsets()).astype(np.float64)
            found.append(_curve(axis, points, str(group.get_label()), color, group))
    return found


def _curve(
    axis: Axes, points: Floats, label: str, color: str, group: PathCollection | None = None
) -> dict[str, Any]:
    """Returns a curve; where its points have values that color them, with these and their name,
    which is the group's gid."""
    values = None if group is None else group.get_array()
    if values is not None:
        points = np.column_stack([points, np.ma.getdata(values)])
    points = points[np.isfinite(points).all(axis=1)]
    (x0, x1), (y0, y1) = sorted(axis.get_xlim()), sorted(axis.get_ylim())
    inside = (
        (points[:, 0] >= x0) & (points[:, 0] <= x1) & (points[:, 1] >= y0) & (points[:, 1] <= y1)
    )
    points = points[inside]
    if len(points) > MOST_POINTS:
        points = points[np.linspace(0, len(points) - 1, MOST_POINTS).astype(np.intp)]
    # Matplotlib's labels of unnamed artists begin with an underscore.
    name = "" if label.startswith("_") else label
    x, y, *colored = ([_short(float(v)) for v in column] for column in points.T)
    curve: dict[str, Any] = {"name": name, "color": color, "x": x, "y": y}
    if group is not None and colored:
        curve["value"] = {"label": str(group.get_gid() or "value"), "of": colored[0]}
    return curve


def _bars(axis: Axes) -> list[dict[str, Any]]:
    """Returns the bars, which are horizontal: their width is their value. Parts of a stacked bar
    have the name of their part."""
    found = []
    for container in axis.containers:
        name = str(container.get_label())
        for bar in container:
            if not isinstance(bar, Rectangle):
                continue
            x0, width = bar.get_x(), bar.get_width()
            y0, height = bar.get_y(), bar.get_height()
            found.append(
                {
                    "name": "" if name.startswith("_") else name,
                    "x": [_short(x0), _short(x0 + width)],
                    "y": [_short(y0), _short(y0 + height)],
                    "value": _short(width),
                }
            )
    return found


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
