# SPDX-License-Identifier: Apache-2.0
"""Runs beyond a plan that its report also shows: further repetitions and other engines."""

from typing import Any

from slambed.campaign.store import RunStore
from slambed.spec.run_spec import RunSpec


def valid_repetitions(store: RunStore, planned: list[RunSpec]) -> list[RunSpec]:
    """Returns valid runs of the same cells with higher repetition numbers, from earlier
    campaigns. Their keys are computed from the plan, without a search."""
    last: dict[str, RunSpec] = {}
    for spec in planned:
        if spec.cell not in last or spec.repetition > last[spec.cell].repetition:
            last[spec.cell] = spec
    found: list[RunSpec] = []
    for spec in last.values():
        further = spec
        while True:
            number = further.repetition + 1
            further = spec.model_copy(
                update={"repetition": number, "seed": spec.seed - spec.repetition + number}
            )
            if store.state(further.run_key) != "valid":
                break
            found.append(further)
    return found


def of_other_engines(before: dict[str, Any], engine: str) -> list[dict[str, Any]]:
    """Returns the planned runs of all other engines, as stored in experiment.json."""
    runs = before.get("runs")
    listed = runs if isinstance(runs, list) else []
    return [run for run in listed if isinstance(run, dict) and run.get("engine") != engine]
