# SPDX-License-Identifier: Apache-2.0
"""Maps former names to today's. Stored results and users' files may hold former names; every reader
of such files uses this module."""

from collections.abc import Collection, Mapping
from typing import Any, TypeVar

from pydantic import BeforeValidator

Value = TypeVar("Value")

EVENTS = {"initialised": "initialized", "relocalised": "relocalized"}
"""Event types."""

FIELDS = {
    "incarnation": "session",
    "labelled_keyframes": "labeled_keyframes",
    "relocalisation": "relocalization",
    "travelled_m": "traveled_m",
}
"""Event fields, and columns of events.parquet."""

STAGES = {
    "relocalise": "relocalize",
    "serialise": "serialize",
    "serialise_text": "serialize_text",
}
"""Stages of nodes: `name` of `stage` events, keys of a device's cost model."""

STATES = {"not_initialised": "not_initialized"}
"""Tracking states: `state` of events."""

METRICS = {
    "relocalisations": "relocalizations",
    "serialise_ms_median": "serialize_ms_median",
}
"""Keys of summary.json, and metrics that an experiment's report names."""

PARAMETERS = {
    "label_neighbours": "label_neighbors",
    "local_neighbours": "local_neighbors",
    "relocalisation": "relocalization",
    "update_neighbours": "update_neighbors",
}
"""Parameters of systems."""

RECIPES = {"licence": "license"}
"""Keys of datasets and networks."""

SUMMARY = {"trusted": "valid", "distrust": "invalid_reason"}
"""Keys of summary.json, and columns of summary.csv and of histories."""

MANIFEST = {"distrust": "invalid_reasons", "beside": "sidecar"}
"""Keys of manifest.json."""

LINK = {"distrust": "invalid_reason"}
"""Keys of the manifest's `link`."""

LEDGER = {"trusted": "valid", "distrust": "invalid_reason"}
"""Keys of a line of ledger.jsonl."""

OUTCOMES = {"mobile_died": "died", "edge_died": "died", "timeout": "timed_out"}
"""Former outcomes that mean the system failed. All others blamed the harness or the link, so the
system itself had completed."""

OF_VALUES = {"type": EVENTS, "state": STATES, "name": STAGES}
"""Event fields whose values are names."""


def keys_today(found: Mapping[str, Value], names: Mapping[str, str]) -> dict[str, Value]:
    """Returns the mapping under today's keys in the same order. If both keys are present, today's
    wins."""
    return {
        names.get(key, key): value
        for key, value in found.items()
        if key not in names or names[key] not in found
    }


def event_today(event: dict[str, Any]) -> dict[str, Any]:
    """Returns the event under today's names, changed in place where it can be. Most events have no
    former names."""
    if not FIELDS.keys().isdisjoint(event):
        event = keys_today(event, FIELDS)
    for field, names in OF_VALUES.items():
        if (value := names.get(str(event.get(field)))) is not None:
            event[field] = value
    return event


def events_of_today(events: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Returns the events under today's names. The usual log without former names is recognized as
    a whole, which is quicker than event by event."""
    keys = set().union(*events)
    try:
        renamed = not FIELDS.keys().isdisjoint(keys) or any(
            not names.keys().isdisjoint(map(str, {event.get(field) for event in events}))
            for field, names in OF_VALUES.items()
            if field in keys
        )
    except TypeError:
        renamed = True  # a value of a wrong type, such as a list
    if not renamed:
        return events
    return [event_today(event) for event in events]


def types_then(types: Collection[str]) -> list[str]:
    """Returns the event types and their former names, to look up in a stored table."""
    return [*types, *(old for old, new in EVENTS.items() if new in types)]


def in_keys(names: Mapping[str, str]) -> BeforeValidator:
    """Returns a validator for a model's mapping field that renames its keys to today's."""
    return BeforeValidator(lambda found: keys_today(found, names) if _is_map(found) else found)


def _is_map(found: object) -> bool:
    return isinstance(found, Mapping)


def summary_of_today(content: Mapping[str, Value]) -> dict[str, Any]:
    """Returns a summary under today's keys.

    The oldest summaries had only `valid` and `invalid_reason`, and called a run invalid when its
    system died. Today such a run is valid with another outcome.
    """
    summary: dict[str, Any] = keys_today(content, SUMMARY)
    oldest = "valid" in content and "not_completed" not in content and "outcome" in content
    if not oldest or "trusted" in content:
        return summary
    outcome = OUTCOMES.get(str(summary["outcome"]), "completed")
    failed = outcome != "completed"
    reason = summary.get("invalid_reason")
    valid = summary["valid"] is True or failed
    return summary | {
        "outcome": outcome,
        "outcome_reason": reason if failed else None,
        "not_completed": failed,
        "valid": valid,
        "invalid_reason": None if valid else reason,
        "coverage": 0.0 if failed else summary.get("coverage"),
    }


def manifest_of_today(content: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a manifest under today's keys.

    The oldest manifests had one `invalid_reason`, both for a failed system and for wrong
    conditions.
    """
    manifest = keys_today(content, MANIFEST)
    link = manifest.get("link")
    if isinstance(link, Mapping):
        manifest["link"] = link = keys_today(link, LINK)
    reason = manifest.pop("invalid_reason", None)
    if "invalid_reasons" in manifest or manifest.get("outcome") is None:
        return manifest
    outcome = OUTCOMES.get(str(manifest["outcome"]), "completed")
    failed = outcome != "completed"
    of_link = link.get("invalid_reason") if isinstance(link, Mapping) else None
    reasons = list(dict.fromkeys(line for line in (reason, of_link) if line))
    return manifest | {
        "outcome": outcome,
        "outcome_reason": reasons[0] if failed and reasons else None,
        "invalid_reasons": [] if failed else reasons,
    }
