# SPDX-License-Identifier: Apache-2.0
"""Numbers of another program, measured by us."""

from slambed.papers.published.base import Match, Strict


class PeerRow(Strict):
    """Another program's number for a key of summary.json, in our unit."""

    low: float
    """Lowest of its runs."""
    value: float
    """Its figure."""
    high: float
    """Highest of its runs."""
    target: float | None = None
    """Target of the ratio ours / theirs."""
    note: str = ""
    """What a reader must know."""


class PeerSetup(Strict):
    """One set-up in which another program was measured."""

    label: str
    """What tables call it."""
    match: Match
    """Key of a run -> values by which our runs are found."""
    dataset: str
    """Sequence of the other program's measurement; runs of ours on another sequence are not
    compared."""
    rows: dict[str, PeerRow]
    """Key of summary.json -> the other program's figure."""
