# SPDX-License-Identifier: Apache-2.0
"""Draws the change of each system against the first one of its link, with intervals: an ablation in
one figure."""

import pandas as pd
from matplotlib.axes import Axes

from slambed.report.differences import Difference
from slambed.report.style import FigureWriter, color, figure, file_name, legend_beneath, marker

ROW_IN = 0.34
"""Height of a system's row; it grows by half of this per link beyond two."""
BESIDE = 0.7
"""Fraction of a row that the links of a system share."""


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
    with figure(height_in=height) as (made, axes):
        for index, link in enumerate(links):
            _marks(axes[0], [d for d in found if d.under == link], systems, index, len(links))
        axes[0].axvline(0, color="#444444", linewidth=0.8, zorder=0)
        axes[0].set_yticks(range(len(systems)), systems)
        axes[0].set_ylim(len(systems) - 0.5, -0.5)
        unit = "points" if first.metric.kind == "share" else first.metric.shown_unit
        axes[0].set_xlabel(f"change of {first.metric.name}" + (f" [{unit}]" if unit else ""))
        axes[0].set_title(title)
        if len(links) > 1:
            legend_beneath(made, axes[0])
        writer.save(made, name, title, _caption(found), _rows(found))


def _marks(axis: Axes, own: list[Difference], systems: list[str], index: int, links: int) -> None:
    across = (index - (links - 1) / 2) * BESIDE / links
    changes = [d.found.change.scaled(d.metric.scale) for d in own]
    axis.errorbar(
        [c.value for c in changes],
        [systems.index(d.other) + across for d in own],
        xerr=[[c.value - c.low for c in changes], [c.high - c.value for c in changes]],
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
