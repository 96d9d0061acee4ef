# SPDX-License-Identifier: Apache-2.0
"""Another program's figures, measured by us."""

from slambed.papers.published.base import Match, Strict


class PeerRow(Strict):
    """Another program's figure for a key of summary.json, in our unit."""

    low: float
    value: float
    high: float
    target: float | None = None
    """The ratio ours / theirs that we aim at."""
    note: str = ""


class PeerSetup(Strict):
    """One way in which another program was measured."""

    label: str
    match: Match
    dataset: str
    """What the other program was measured on; ours on anything else are beside a stand-in."""
    rows: dict[str, PeerRow]
