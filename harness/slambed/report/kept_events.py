# SPDX-License-Identifier: Apache-2.0
"""Runs whose events were kept. Packed runs come back without them, beside new ones that have
theirs."""

from collections.abc import Sequence

import pandas as pd

from slambed.metrics.collect import events_file, is_stored
from slambed.report.load import Results

NONE_ARE_KEPT = (
    "no run has its events: packed runs have them only with --whole or --events; "
    "\"slambed run NAME --force '*'\", with their --engine and --runs, plays them again"
)


def with_events(
    results: Results, runs: pd.DataFrame, kinds: Sequence[str] | None = None
) -> pd.DataFrame:
    """Returns the runs that have their events of these types, or all events."""
    folders = map(results.run_dir, runs["run_key"].astype(str))
    kept = [is_stored(f) if kinds is None else events_file(f, kinds) is not None for f in folders]
    return runs[pd.Series(kept, index=runs.index, dtype=bool)]


def from_part(with_them: pd.DataFrame, runs: pd.DataFrame) -> str:
    """Returns `from 3 of 6 runs, the others have no events`; empty if all have them."""
    if len(with_them) == len(runs):
        return ""
    return f"from {len(with_them)} of {len(runs)} runs, the others have no events"
