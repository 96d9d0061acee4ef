# SPDX-License-Identifier: Apache-2.0
"""Another program's figures, measured by us."""

from slambed.papers.published.base import Match, Strict


class PeerRow(Strict):
    """Another program's figure for a key of summary.json, in our unit."""

    low: float
    """Lowest of its runs."""
    value: float
    """Its figure."""
    high: float
    """Highest of its runs."""
    target: float | None = None
    """The ratio ours / theirs that we aim at."""
    note: str = ""
    """What a reader must know."""


class PeerSetup(Strict):
    """One way in which another program was measured."""

    label: str
    """What tables call it."""
    match: Match
    """Key of a run -> values by which our runs are found."""
    dataset: str
    """What the other program was measured on; ours on anything else are beside a stand-in."""
    rows: dict[str, PeerRow]
    """Key of summary.json -> the other program's figure."""
