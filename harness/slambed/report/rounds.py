# SPDX-License-Identifier: Apache-2.0
"""Parts of a map update round in our runs, as in DynNetSLAM's Table 1."""

import numpy as np

from slambed.metrics.update_round import PART_FIELDS, UpdateRound, update_rounds
from slambed.report.cells import hosts_of, text
from slambed.report.kept_events import from_part, with_events
from slambed.report.load import Results
from slambed.report.tables import Table

RUNS_READ = 20
"""Runs read per cell: event logs are large, and these have some hundred updates."""
KINDS = ("update_applied",)


def update_round_tables(results: Results) -> list[Table]:
    """Returns one table with a row per cell whose events report the parts, or no table."""
    rows: list[list[str]] = []
    datasets = list(dict.fromkeys(map(text, results.valid_runs["dataset"])))
    one = len(datasets) == 1
    mixed = results.runs["host"].nunique(dropna=False) > 1
    offloaded = results.valid_runs[results.valid_runs["device_edge"].notna()]
    kept = with_events(results, offloaded, KINDS)
    for _, runs in kept.groupby("cell", sort=False):
        rounds: list[UpdateRound] = []
        for key in runs["run_key"].head(RUNS_READ):
            log = results.events(str(key), KINDS)
            rounds += update_rounds(log) if log is not None else []
        if not rounds:
            continue
        gaps = [r.gap_keyframes for r in rounds if r.gap_keyframes is not None]
        first = runs.iloc[0]
        rows.append(
            [
                text(first["label"]),
                *([] if one else [text(first["dataset"])]),
                text(first["profile"]),
                *([hosts_of(runs)] if mixed else []),
                str(len(rounds)),
                *(_spread([r.parts_ms[part] for r in rounds]) for part in PART_FIELDS),
                _spread([r.computed_ms for r in rounds]),
                _spread([r.total_ms for r in rounds]),
                f"{np.mean(gaps):.1f}" if gaps else "-",
            ]
        )
    caption = (
        "Parts of a map update round in ms, mean ± standard deviation over the accepted updates of "
        "all runs together (updates: how many; one has no deviation). A keyframe is made "
        "(T_Track), travels to the edge (T_M->E), is read (T_RKF) and mapped (T_LM); the update is "
        "due (T_Wait: pacing), is made (T_PLMU), travels back (T_E->M) and is applied (T_MU). "
        "T_Computed is T_Total without T_Wait; gap: keyframes that the local map loses by an update"
        + (f"; {part}" if (part := from_part(kept, offloaded)) else "")
        + (f"; {datasets[0]}" if one else "")
    )
    headings = [
        "system", *([] if one else ["dataset"]), "link", *(["hosts"] if mixed else []), "updates",
        *PART_FIELDS, "T_Computed", "T_Total", "gap",
    ]  # fmt: skip
    return (
        [Table("update_rounds", caption, headings, rows, words=2 + (not one) + mixed)]
        if rows
        else []
    )


def _spread(values: list[float]) -> str:
    deviation = f"{np.std(values):.1f}" if len(values) > 1 else "-"
    return f"{np.mean(values):.1f} ± {deviation}"
