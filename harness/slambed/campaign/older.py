# SPDX-License-Identifier: Apache-2.0
"""Runs of earlier campaigns: more repetitions of what is wanted stay, all others step aside.

A report must never mix runs of different sources or parameters under one name.
"""

from typing import Any

from slambed.campaign.folder import ResultFolder
from slambed.spec.matrix import RunSpec, canonical_json


def settle(folder: ResultFolder, wanted: list[RunSpec]) -> tuple[list[RunSpec], list[str]]:
    """Moves runs that belong to nothing wanted to `stale/`.

    Returns the valid runs that are further repetitions of wanted cells, and the keys moved away.
    """
    keys = {spec.run_key for spec in wanted}
    conditions = {_condition(spec): spec for spec in wanted}
    more: list[RunSpec] = []
    moved: list[str] = []
    for key in folder.run_keys():
        if key in keys:
            continue
        spec = spec_of(folder.read(key, "manifest.json"))
        twin = conditions.get(_condition(spec)) if spec is not None else None
        if spec is not None and twin is not None and folder.state(key) == "valid":
            # Names may have changed since; the condition is the same.
            names = {"experiment": twin.experiment, "cell": twin.cell, "label": twin.label}
            more.append(spec.model_copy(update=names))
        else:
            folder.set_aside(key)
            moved.append(key)
    return more, moved


def spec_of(manifest: dict[str, Any] | None) -> RunSpec | None:
    """The RunSpec of a manifest; None when another version of slambed wrote it."""
    try:
        return RunSpec.model_validate((manifest or {})["spec"])
    except (KeyError, ValueError):
        return None


def _condition(spec: RunSpec) -> str:
    """What a run means apart from being the n-th of its kind."""
    meaning = spec.meaning()
    first_seed = spec.seed - meaning.pop("repetition")
    return canonical_json(meaning | {"seed": first_seed})
