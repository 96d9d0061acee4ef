# SPDX-License-Identifier: Apache-2.0
"""Runs whose mobile node was on a real board: the network to it, and the accuracy of its clock."""

import pandas as pd

from slambed.report.load import Results
from slambed.report.tables import Table


def board_table(results: Results) -> Table | None:
    """Returns measured RTT and clocks of every cell with a board; None without one."""
    runs = _of_boards(results)
    if not len(runs):
        return None
    rows: list[list[str]] = []
    for (cell, board), part in runs.groupby(["cell", "board"], sort=False):
        rows.append(
            [
                str(cell),
                str(board),
                str(part["board_is"].iloc[0]),
                str(len(part)),
                *(
                    _range(part[key], digits)
                    for key, digits in (
                        ("rtt_measured_ms_mean", 2),
                        ("clock_error_ms", 3),
                        ("clock_drift_ppm", 2),
                    )
                ),
            ]
        )
    return Table(
        "boards",
        "Mobile nodes on a real board, over the network to it as it was; smallest to largest run. "
        "One-way times are within the clocks' error; drift is taken out",
        [
            "cell",
            "board",
            "it is",
            "runs",
            "RTT measured, mean [ms]",
            "clocks within [ms]",
            "drift [ppm]",
        ],
        rows,
        words=3,
    )


def board_lines(results: Results) -> list[str]:
    """Returns one sentence per board."""
    lines: list[str] = []
    for (board, what), part in _of_boards(results).groupby(["board", "board_is"], sort=False):
        rtt, error = (
            pd.to_numeric(part[key], errors="coerce")
            for key in ("rtt_measured_ms_mean", "clock_error_ms")
        )
        message = f"; RTT {rtt.median():.2f} ms" if rtt.notna().any() else ""
        known = f", its clock known to {error.max():.3f} ms" if error.notna().any() else ""
        lines.append(
            f"Board {board} ({what}) executed the mobile node of {len(part)} runs itself, without "
            f"limits; the network to it is real, and nothing was added to it{message}{known}."
        )
    return lines


def _of_boards(results: Results) -> pd.DataFrame:
    runs = results.runs
    return runs[runs["board"].notna()]


def _range(values: pd.Series, digits: int) -> str:
    known = pd.to_numeric(values, errors="coerce").dropna()
    if not len(known):
        return "-"
    low, high = f"{known.min():.{digits}f}", f"{known.max():.{digits}f}"
    return low if low == high else f"{low} to {high}"
