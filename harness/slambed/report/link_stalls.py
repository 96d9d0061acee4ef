# SPDX-License-Identifier: Apache-2.0
"""Warns about stalled links, one line per cell."""

from collections.abc import Iterator

import pandas as pd


def stalled_links(runs: pd.DataFrame) -> Iterator[str]:
    """Yields lines about runs with link stalls: bytes in flight of which none is acknowledged for
    1 s, because TCP waits for a timeout or the link is cut. Late messages after a stall are the
    link's fault."""
    if "link_stalls" not in runs:
        return
    stalls = runs[runs["link_stalls"].astype(float) > 0]
    sizes = runs.groupby("cell").size()
    for cell, found in stalls.groupby("cell"):
        yield (
            f"{cell}: in {len(found)} of {sizes[cell]} runs the link stalled, at most "
            f"{int(found['link_stalls'].max())} times: bytes under way and none acknowledged for "
            "1 s; slambed explain says when"
        )
