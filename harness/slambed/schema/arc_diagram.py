# SPDX-License-Identifier: Apache-2.0
"""What uses what, as an SVG picture: one name a line, and an arc down to each name that it uses."""

import html
from collections.abc import Mapping, Sequence

ROW, TOP, CHARACTER, TEXT = 20, 20, 7.6, 13
"""Pixels: a line, the space above the first, and a character of a size that a phone still shows."""
BULGE, NARROWEST, FOOT, APART = 8.0, 14.0, 7.0, 4.0
"""Pixels: an arc's width grows by BULGE with each line that it passes; FOOT is an arrow's length.
An arc leaves a name APART below its middle, and arrives as much above it."""
COLORS = ("#0072B2", "#D55E00", "#009E73", "#AA5FB0", "#B8860B", "#4C8FD0", "#8A6D5C")
"""Neighbors differ, also for eyes that see few colors, on white and on black."""
STYLE = """\
.card { fill: #ffffff; stroke: #d1d9e0 } text { fill: #1f2328 } .group { fill: #59636e }
@media (prefers-color-scheme: dark) {
.card { fill: #161b22; stroke: #3d444d } text { fill: #e6edf3 } .group { fill: #9198a1 } }"""


def reduced(used: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """Returns the graph without the arrows that a longer path implies."""

    def reached(name: str) -> set[str]:
        return {name}.union(*(reached(item) for item in used.get(name, ())))

    return {
        name: {
            item for item in found if not any(item in reached(other) for other in found - {item})
        }
        for name, found in used.items()
    }


def downwards(names: Sequence[str], used: Mapping[str, set[str]]) -> list[str]:
    """Returns the names in an order in which each is above those that it uses, and close to them.

    Raises ValueError where names use each other in a circle."""
    order: list[str] = []
    waiting = sorted(names)
    while waiting:
        ready = [
            name for name in waiting if not any(name in used.get(other, ()) for other in waiting)
        ]
        if not ready:
            raise ValueError(f"a circle among {', '.join(waiting)}")
        # The one whose last user was placed latest: its arc is the shortest.
        following = max(
            ready,
            key=lambda name: max(
                (place for place, user in enumerate(order) if name in used.get(user, ())),
                default=-1,
            ),
        )
        order.append(following)
        waiting.remove(following)
    return order


def arc_diagram(title: str, groups: Mapping[str, Sequence[str]], used: Mapping[str, set[str]],
                labels: Mapping[str, str]) -> str:  # fmt: skip
    """Draws the names of each group under its heading ("" has none). A heading can be used, too."""
    used = reduced(used)
    rows: list[tuple[str, str, bool]] = []
    for heading, names in groups.items():
        if heading:
            rows.append((heading, heading, True))
        rows += [(name, labels.get(name, name), False) for name in downwards(names, used)]
    y = {name: TOP + ROW * number for number, (name, _, _) in enumerate(rows)}
    edge = 16 + CHARACTER * max(len(label) for _, label, _ in rows)
    arcs, right = [], edge
    targets = [name for name, _, _ in rows if any(name in found for found in used.values())]
    for number, target in enumerate(targets):
        color = COLORS[number % len(COLORS)]
        for user in (name for name, _, _ in rows if target in used.get(name, ())):
            bulge = NARROWEST + BULGE * (y[target] - y[user]) / ROW
            # A cubic curve reaches three quarters of the way to its control points.
            right = max(right, edge + FOOT + 0.75 * bulge)
            arcs.append(_arc(edge + 5, y[user] + APART, y[target] - APART, bulge, color))
        arcs.append(_arrow(edge + 5, y[target] - APART, color))
    width, height = round(right + 14), TOP + ROW * len(rows)
    words = [_text(edge, y[name], label, heading) for name, label, heading in rows]
    shown = html.escape(title)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
            f'width="{width}" height="{height}" role="img" aria-label="{shown}" '
            'font-family="ui-monospace, SFMono-Regular, Menlo, DejaVu Sans Mono, monospace" '
            f'font-size="{TEXT}">',
            f"<title>{shown}</title>",
            f"<style>\n{STYLE}\n</style>",
            f'<rect class="card" x="0.5" y="0.5" width="{width - 1}" height="{height - 1}" '
            'rx="8"/>',
            *arcs,
            *words,
            "</svg>",
            "",
        ]
    )


def _arc(x: float, begin: float, end: float, bulge: float, color: str) -> str:
    far, foot = x + bulge, x + FOOT
    return (
        f'<path d="M{x:.1f} {begin:g}C{far:.1f} {begin:g} {far:.1f} {end:g} {foot:.1f} {end:g}" '
        f'fill="none" stroke="{color}" stroke-width="1.4"/>'
    )


def _arrow(x: float, y: float, color: str) -> str:
    return f'<path d="M{x - 1:.1f} {y:g}l9 -3.5v7z" fill="{color}"/>'


def _text(x: float, y: float, words: str, heading: bool) -> str:
    settings = ' class="group" font-style="italic"' if heading else ""
    return (
        f'<text x="{x:.1f}" y="{y + TEXT / 3:.1f}" text-anchor="end"{settings}>'
        f"{html.escape(words)}</text>"
    )
