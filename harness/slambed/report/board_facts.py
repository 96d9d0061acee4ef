# SPDX-License-Identifier: Apache-2.0
"""Columns of runs whose mobile node was on a real board."""

from slambed.records.manifest import Manifest

COLUMNS = ("board", "board_is", "clock_error_ms", "clock_drift_ppm", "clock_over")


def board_facts(manifest: Manifest) -> dict[str, object]:
    """Returns the columns of a run with a board; empty for other runs."""
    board = manifest.board
    if board is None:
        return {}
    clocks = board.clocks
    return {
        "board": board.name,
        "board_is": f"{board.model}, {board.cores} cores, {board.architecture}",
        "clock_error_ms": None if clocks is None else clocks.error_ms,
        "clock_drift_ppm": None if clocks is None else clocks.drift_ppm,
        "clock_over": None if clocks is None else clocks.before.over,
    }
