# SPDX-License-Identifier: Apache-2.0
"""Manifests and summaries from before outcome and trust were two things, in the words of today."""

from typing import Any

OLD_OUTCOMES = {"mobile_died": "died", "edge_died": "died", "timeout": "timed_out"}
"""What was the system's doing; any other word was the harness's or the link's."""


def manifest_of_today(manifest: dict[str, Any]) -> dict[str, Any]:
    """A manifest that calls a run invalid says now how the system ended, or why not to trust it."""
    if "distrust" in manifest or "outcome" not in manifest:
        return manifest
    outcome = OLD_OUTCOMES.get(str(manifest["outcome"]), "completed")
    link = manifest.get("link")
    told = [manifest.get("invalid_reason"), link.get("invalid_reason") if link else None]
    reasons = list(dict.fromkeys(str(line) for line in told if line))
    failed = outcome != "completed"
    return manifest | {
        "outcome": outcome,
        "outcome_reason": reasons[0] if failed and reasons else None,
        "distrust": [] if failed else reasons,
    }


def two_axes(summary: dict[str, Any]) -> dict[str, Any]:
    """A summary that knew valid and invalid runs only, in the words of today: a system that died
    was called invalid, now that is its outcome."""
    if "valid" not in summary or "trusted" in summary:
        return summary
    outcome = OLD_OUTCOMES.get(str(summary.get("outcome")), "completed")
    failed = outcome != "completed"
    reason = summary.get("invalid_reason")
    trusted = summary["valid"] is True or failed
    return summary | {
        "outcome": outcome,
        "outcome_reason": reason if failed else None,
        "not_completed": failed,
        "trusted": trusted,
        "distrust": None if trusted else reason,
        "coverage": 0.0 if failed else summary.get("coverage"),
    }
