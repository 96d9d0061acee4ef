# SPDX-License-Identifier: Apache-2.0
"""What a busy host did to runs that are trusted all the same, a line per cell."""

from collections import Counter

import pandas as pd

MOST_CELLS = 10
STALL_MS = 100.0
WAIT_SHARE = 0.5


def held_up(runs: pd.DataFrame) -> list[str]:
    """A track loss in a run that the host held up may not be the system's."""
    if "host_stall_ms_max" not in runs or "lost" not in runs:
        return []
    stalled = runs[(runs["host_stall_ms_max"] > STALL_MS) & runs["lost"].eq(True)]
    return [
        f"{cell}: {count} of the runs with a track loss were held up by the host for more than "
        f"{STALL_MS:g} ms; tolerances.host_stall_ms_max keeps such runs out"
        for cell, count in list(Counter(stalled["cell"].astype(str)).items())[:MOST_CELLS]
    ]


def waited(runs: pd.DataFrame) -> list[str]:
    """On a busy host stages take longer than on the device, though the link was right."""
    if "cpu_wait_share" not in runs:
        return []
    shares = runs["cpu_wait_share"].astype(float)
    return [
        f"{cell}: the mobile node of {len(found)} runs waited for a processor for up to "
        f"{found.max():.0%} of the time in which it wanted one, so its stages took longer than "
        "the limits of its device explain; tolerances.cpu_wait_share_max keeps such runs out"
        for cell, found in list(shares[shares > WAIT_SHARE].groupby(runs["cell"]))[:MOST_CELLS]
    ]
