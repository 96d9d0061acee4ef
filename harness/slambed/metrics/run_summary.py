# SPDX-License-Identifier: Apache-2.0
"""Computes the flat summary of one run (docs/reference/summary.md, `summary.json`)."""

from collections.abc import Mapping
from pathlib import Path

from slambed.metrics.catalog import metrics_of
from slambed.metrics.declared import described_by
from slambed.metrics.run_data import RunData
from slambed.metrics.summary import Summary
from slambed.metrics.update_round import CLOSURE_LIMIT_MS
from slambed.metrics.validity import invalid_reasons_of
from slambed.records.kept_spec import KeptSpec


def summarize_run(
    folder: Path, spec: KeptSpec | Mapping[str, object], groundtruth: Path | None = None
) -> Summary:
    """Returns the summary of a raw folder or of a stored result; unmeasured values are None.

    `spec` is the RunSpec, as stored or as JSON; `manifest.json` in the folder holds the outcome.
    The ground truth is `groundtruth`, else `groundtruth.txt` in the folder, else that of the
    sequence in `run.json`.
    """
    summary, _ = summarize_with_problems(folder, spec, groundtruth)
    return summary


def summarize_with_problems(
    folder: Path, spec: KeptSpec | Mapping[str, object], groundtruth: Path | None = None
) -> tuple[Summary, list[str]]:
    """Like `summarize_run`, but also returns problems of the files (one line each)."""
    run = RunData(folder, KeptSpec.of(spec), groundtruth)
    return summary_of(run), run.problems


def summary_of(run: RunData) -> Summary:
    """Returns the summary of a loaded run; problems of its files are added to `run.problems`."""
    summary = Summary(
        {
            item.key: item.value_of(run)
            for item in metrics_of(described_by(run.spec.system, run.spec.system_folder))
        }
    )
    if (summary.number("update_parts_error_ms_max") or 0.0) > CLOSURE_LIMIT_MS:
        run.problems.append("update_applied: the parts of T_Total do not add up to it")
    reasons = invalid_reasons_of(run.spec, run.manifest, summary)
    summary["valid"] = not reasons
    summary["invalid_reason"] = "; ".join(reasons) or None
    return summary
