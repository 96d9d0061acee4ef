# SPDX-License-Identifier: Apache-2.0
"""Tells the result of an experiment in one sentence: who lost track, and on which link."""

import pandas as pd

from slambed.report.cells import text
from slambed.report.load import Results

MOST_SYSTEMS = 4
MOST_LINKS = 3
NO_LINK = "no link"


def told(results: Results) -> str:
    """Returns one sentence about the valid runs with measured losses; empty without any."""
    valid = results.valid_runs
    runs = valid[valid["lost"].notna()]
    if not len(runs):
        return ""
    more = len(valid) - len(runs)
    ended = int(runs["not_completed"].eq(True).sum())
    parts = [
        _of_measured(runs),
        f"{ended} of {len(runs)} runs did not complete" if ended and len(runs) > 1 else "",
        f"{more} more {'were' if more > 1 else 'was'} not measured" if more else "",
    ]
    return "; ".join(part for part in parts if part) + "."


def _of_measured(runs: pd.DataFrame) -> str:
    """Returns the sentence without its full stop."""
    lost = runs["lost"].eq(True)
    if not lost.any():
        if len(runs) > 1:
            return f"No run of {len(runs)} lost track"
        return f"The run kept track{_ended(runs)}"
    if lost.all():
        if len(runs) > 1:
            return f"Every run of {len(runs)} lost track"
        return f"The run lost track{_ended(runs)}"
    groups = sorted(
        runs.assign(lost=lost).groupby("label", sort=False),
        key=lambda group: -float(group[1]["lost"].mean()),
    )
    parts = [_of_system(str(label), rows) for label, rows in groups[:MOST_SYSTEMS]]
    more = len(groups) - MOST_SYSTEMS
    rest = f"; {more} more systems are in the table" if more > 0 else ""
    return f"Runs with a track loss: {'; '.join(parts)}{rest}"


def _ended(run: pd.DataFrame) -> str:
    """Returns what is added to the sentence about a single run that did not complete."""
    return ", and did not complete" if run["not_completed"].eq(True).any() else ""


def _of_system(label: str, rows: pd.DataFrame) -> str:
    """Returns `offloaded 9 of 10 with rtt_85, none of 20 otherwise`."""
    lost, count = int(rows["lost"].sum()), len(rows)
    if not lost:
        return f"{label} none of {count}"
    one_dataset = rows["dataset"].nunique() == 1
    links = [
        (text(profile) or NO_LINK, int(part["lost"].sum()), len(part))
        for profile, part in rows.groupby("profile", sort=False, dropna=False)
    ]
    with_losses = [link for link in links if link[1]]
    if not one_dataset or len(links) == 1 or len(with_losses) > MOST_LINKS:
        return f"{label} {lost} of {count}"
    named = ", ".join(f"{n} of {of} with {name}" for name, n, of in with_losses)
    without = sum(of for _, n, of in links if not n)
    return f"{label} {named}" + (f", none of {without} otherwise" if without else "")
