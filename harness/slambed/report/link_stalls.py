# SPDX-License-Identifier: Apache-2.0
"""Links on which nothing moved, a line per cell."""

import pandas as pd

MOST_CELLS = 10


def stalled_links(runs: pd.DataFrame) -> list[str]:
    """Bytes under way of which none is acknowledged for 1 s: TCP waits for a time-out, or the link
    is cut. What then comes late is the link's."""
    if "link_stalls" not in runs:
        return []
    stalls = runs[runs["link_stalls"].astype(float) > 0]
    sizes = runs.groupby("cell").size()
    return [
        f"{cell}: in {len(found)} of {sizes[cell]} runs the link stalled, at most "
        f"{int(found['link_stalls'].max())} times: bytes under way and none acknowledged for 1 s; "
        "slambed explain says when"
        for cell, found in list(stalls.groupby("cell"))[:MOST_CELLS]
    ]
