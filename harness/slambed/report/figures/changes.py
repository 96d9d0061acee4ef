# SPDX-License-Identifier: Apache-2.0
"""Draws the change of each system against the first one of its link, with intervals: an ablation in
one figure."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from slambed.metrics.statistics import Floats
from slambed.report.differences import Difference
from slambed.report.style import FigureWriter, color, figure, file_name, legend_beneath, marker

ROW_IN = 0.34
"""Height of a system's row; it grows by half of this per link beyond two."""
BESIDE = 0.7
"""Fraction of a row that the links of a system share."""
BEYOND = 1.3
"""Infinite changes are drawn at the largest finite end times this."""


def draw_changes(found: list[Difference], dataset: str, writer: FigureWriter) -> None:
    """Draws one row per system and one mark per link: the change of a metric against the baseline,
    negative to the left of zero. All differences have one metric and dataset."""
    first = found[0]
    name = file_name("changes", dataset, first.metric.key)
    one = len({d.baseline for d in found}) == 1
    against = first.baseline if one else "the first system of each link"
    title = f"{first.metric.title}: change against {against}, {dataset}"
    systems = list(dict.fromkeys(d.other for d in found))
    links = list(dict.fromkeys(d.under for d in found))
    height = 1.2 + ROW_IN * len(systems) * max(1.0, len(links) / 2)
    edge, ends = _edge(found), _ends(found)
    with figure(height_in=height) as (made, axes):
        for index, link in enumerate(links):
            own = [d for d in found if d.under == link]
            _marks(axes[0], own, systems, index, len(links), edge)
        if np.isposinf(ends).any():
            axes[0].set_xlim(right=edge)
        if np.isneginf(ends).any():
            axes[0].set_xlim(left=-edge)
        axes[0].axvline(0, color="#444444", linewidth=0.8, zorder=0)
        axes[0].set_yticks(range(len(systems)), systems)
        axes[0].set_ylim(len(systems) - 0.5, -0.5)
        unit = "points" if first.metric.kind == "share" else first.metric.shown_unit
        axes[0].set_xlabel(f"change of {first.metric.name}" + (f" [{unit}]" if unit else ""))
        axes[0].set_title(title)
        if len(links) > 1:
            legend_beneath(made, axes[0])
        writer.save(made, name, title, _caption(found), _rows(found))


def _ends(found: list[Difference]) -> Floats:
    """Returns value, low and high of each change in shown units [N,3]."""
    changes = [d.found.change.scaled(d.metric.scale) for d in found]
    return np.array([[c.value, c.low, c.high] for c in changes], dtype=np.float64)


def _edge(found: list[Difference]) -> float:
    """Returns where infinite changes are drawn, beyond all finite ones."""
    ends = np.abs(_ends(found))
    finite = ends[np.isfinite(ends)]
    return BEYOND * float(finite.max()) if finite.any() else 1.0


def _marks(
    axis: Axes, own: list[Difference], systems: list[str], index: int, links: int, edge: float
) -> None:
    across = (index - (links - 1) / 2) * BESIDE / links
    value, low, high = np.clip(_ends(own), -edge, edge).T
    axis.errorbar(
        value,
        [systems.index(d.other) + across for d in own],
        xerr=[value - low, high - value],
        clip_on=bool(np.isfinite(_ends(own)).all()),
        color=color(index),
        marker=marker(index),
        linestyle="none",
        markersize=5,
        elinewidth=0.9,
        capsize=2,
        label=own[0].under,
    )


def _caption(found: list[Difference]) -> str:
    pairs = " of pairs of equal seed" if all(d.found.paired for d in found) else ""
    fewest = min(d.found.runs for d in found)
    ranges = (
        "; ranges where runs are too few for one"
        if any(d.found.change.is_range for d in found)
        else ""
    )
    return (
        f"Each system less {_baselines(found)}{pairs}, with 95 % intervals{ranges}; "
        f"at least {fewest} runs a side."
        + (
            ""
            if np.isfinite(_ends(found)).all()
            else " A mark at the edge is infinite: runs failed."
        )
    )


def _baselines(found: list[Difference]) -> str:
    """Returns the system that the others are compared with; by link where it differs."""
    links: dict[str, list[str]] = {}
    for baseline, link in dict.fromkeys((d.baseline, d.under) for d in found):
        links.setdefault(baseline, []).append(link)
    if len(links) == 1:
        return found[0].baseline
    named = ", ".join(f"{name} on {' and '.join(on)}" for name, on in links.items())
    return f"the first one of its link ({named})"


def _rows(found: list[Difference]) -> pd.DataFrame:
    rows = []
    for d in found:
        change = d.found.change.scaled(d.metric.scale)
        rows.append(
            {
                "baseline": d.baseline,
                "system": d.other,
                "link": d.under,
                "baseline_value": d.found.a * d.metric.scale,
                "value": d.found.b * d.metric.scale,
                "change": change.value,
                "low": change.low,
                "high": change.high,
                "runs": d.found.runs,
                "p_holm": d.p_value,
            }
        )
    return pd.DataFrame(rows)
