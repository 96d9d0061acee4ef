# SPDX-License-Identifier: Apache-2.0
"""Numbers of another program, measured by us."""

from slambed.papers.published.base import Match, Strict


class PeerRow(Strict):
    """Another program's number for a key of summary.json, in our unit."""

    low: float
    value: float
    high: float
    target: float | None = None
    """Target of the ratio ours / theirs."""
    note: str = ""


class PeerSetup(Strict):
    """One set-up in which another program was measured."""

    label: str
    match: Match
    dataset: str
    """Sequence of the other program's measurement; runs of ours on another sequence are not
    compared."""
    rows: dict[str, PeerRow]
