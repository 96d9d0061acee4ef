# SPDX-License-Identifier: Apache-2.0
"""Summaries from before outcome and validity were two things, in the words of today."""

from slambed.metrics.summary import Summary
from slambed.records.manifest import OLD_OUTCOMES


def two_axes(summary: Summary) -> Summary:
    """A summary that knew valid and invalid runs only, in the words of today: a system that died
    was called invalid, now that is its outcome."""
    if "valid" not in summary or "valid" in summary:
        return summary
    outcome = OLD_OUTCOMES.get(str(summary.get("outcome")), "completed")
    failed = outcome != "completed"
    reason = summary.get("invalid_reason")
    valid = summary["valid"] is True or failed
    return Summary(
        summary
        | {
            "outcome": outcome,
            "outcome_reason": reason if failed else None,
            "not_completed": failed,
            "valid": valid,
            "invalid_reason": None if valid else reason,
            "coverage": 0.0 if failed else summary.get("coverage"),
        }
    )
