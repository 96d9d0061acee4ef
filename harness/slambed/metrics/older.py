# SPDX-License-Identifier: Apache-2.0
"""Summaries from before outcome and trust were two things, in the words of today."""

from slambed.metrics.summary import Summary
from slambed.records.manifest import OLD_OUTCOMES


def two_axes(summary: Summary) -> Summary:
    """A summary that knew valid and invalid runs only, in the words of today: a system that died
    was called invalid, now that is its outcome."""
    if "valid" not in summary or "trusted" in summary:
        return summary
    outcome = OLD_OUTCOMES.get(str(summary.get("outcome")), "completed")
    failed = outcome != "completed"
    reason = summary.get("invalid_reason")
    trusted = summary["valid"] is True or failed
    return Summary(
        summary
        | {
            "outcome": outcome,
            "outcome_reason": reason if failed else None,
            "not_completed": failed,
            "trusted": trusted,
            "distrust": None if trusted else reason,
            "coverage": 0.0 if failed else summary.get("coverage"),
        }
    )
