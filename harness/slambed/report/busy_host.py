# SPDX-License-Identifier: Apache-2.0
"""Warns about valid runs that a busy host affected, one line per cell."""

from collections.abc import Callable, Iterator

import pandas as pd

from slambed.metrics.resources import Resources, resources_of

STALL_MS = 100.0
"""Time between two frames of the papers' playback: a longer stall drops one."""
WAIT_SHARE = 0.5
NODES = ("mobile", "edge")

Samples = Callable[[str], pd.DataFrame | None]
"""Returns the samples of a run by its key; None if they cannot be read."""


def held_up(runs: pd.DataFrame) -> Iterator[str]:
    """Yields lines about track losses in runs that the host stalled; these may not be the
    system's."""
    if "host_stall_ms_max" not in runs or "lost" not in runs:
        return
    stalled = runs[(runs["host_stall_ms_max"] > STALL_MS) & runs["lost"].eq(True)]
    for cell, found in stalled.groupby("cell", sort=False):
        yield (
            f"{cell}: {len(found)} of the runs with a track loss were held up by the host for more "
            f"than {STALL_MS:g} ms, at most {found['host_stall_ms_max'].max():.0f} ms at once; "
            "they count as valid unless the experiment sets tolerances.host_stall_ms_max"
        )


def waited(runs: pd.DataFrame, samples: Samples) -> Iterator[str]:
    """Yields lines about runs whose mobile node waited for a CPU. On a busy host its stages took
    longer than on the device; several threads under a small limit also wait for each other."""
    if "cpu_wait_share" not in runs:
        return
    waiting = runs[runs["cpu_wait_share"].astype(float) > WAIT_SHARE]
    sizes = runs.groupby("cell").size()
    for cell, found in waiting.groupby("cell"):
        yield (
            f"{cell}: in {len(found)} of {sizes[cell]} runs the mobile node waited for a processor "
            f"for more than {100 * WAIT_SHARE:.0f} % of the time in which it wanted one: the host "
            "was busy, so that stages took longer than on the device, or the node's own threads "
            f"waited for each other under its limits; most {_most(found, samples)}; they count as "
            "valid unless the experiment sets tolerances.cpu_wait_share_max"
        )


def _most(found: pd.DataFrame, samples: Samples) -> str:
    """Returns the run that waited most, as `in 01ab: mobile node 84 %, edge node 12 %` with
    times."""
    worst = found.sort_values("cpu_wait_share", kind="stable").iloc[-1]
    rows = samples(str(worst["run_key"]))
    end_s = None if pd.isna(worst["wall_s"]) else float(worst["wall_s"])
    nodes = {n: resources_of(rows, n, end_s) for n in NODES} if rows is not None else {}
    # The summary's share takes precedence, because samples may be missing or older.
    parts = [f"mobile node {_much(worst['cpu_wait_share'], nodes.get('mobile'))}"]
    edge = nodes.get("edge")
    if edge is not None and edge.cpu_wait_share is not None:
        parts.append(f"edge node {_much(edge.cpu_wait_share, edge)}")
    return f"in {worst['run_key']}: {', '.join(parts)}"


def _much(share: float, node: Resources | None) -> str:
    ms = node.cpu_wait_ms if node is not None else None
    return f"{100 * share:.0f} %" + (f" ({ms:.0f} ms of all its threads)" if ms is not None else "")
