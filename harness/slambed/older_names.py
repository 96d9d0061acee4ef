# SPDX-License-Identifier: Apache-2.0
"""Names of before, and what they are today: the one place that knows them. Kept results and users'
own files may hold the old ones; whatever reads such a file asks here."""

from collections.abc import Collection, Mapping
from typing import Any, TypeVar

from pydantic import BeforeValidator

Value = TypeVar("Value")

EVENTS = {"initialised": "initialized", "relocalised": "relocalized"}
"""Types of events."""

FIELDS = {
    "incarnation": "session",
    "labelled_keyframes": "labeled_keyframes",
    "relocalisation": "relocalization",
    "travelled_m": "traveled_m",
}
"""Fields of events, and columns of events.parquet."""

STAGES = {
    "relocalise": "relocalize",
    "serialise": "serialize",
    "serialise_text": "serialize_text",
}
"""Stages of nodes: `name` of events `stage`, keys of a device's cost model."""

STATES = {"not_initialised": "not_initialized"}
"""States of tracking: `state` of events."""

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

OF_VALUES = {"type": EVENTS, "state": STATES, "name": STAGES}
"""Fields of events with names in them."""


def keys_today(found: Mapping[str, Value], names: Mapping[str, str]) -> dict[str, Value]:
    """The same under today's keys, in the same order; what has both keeps today's."""
    return {
        names.get(key, key): value
        for key, value in found.items()
        if key not in names or names[key] not in found
    }


def event_today(event: dict[str, Any]) -> dict[str, Any]:
    """An event in today's words: itself where it has no other ones, which is nearly always."""
    if not FIELDS.keys().isdisjoint(event):
        event = keys_today(event, FIELDS)
    for field, names in OF_VALUES.items():
        if (value := names.get(str(event.get(field)))) is not None:
            event[field] = value
    return event


def types_then(types: Collection[str]) -> list[str]:
    """Types of events with those that they had before, to look for in a stored table."""
    return [*types, *(old for old, new in EVENTS.items() if new in types)]


def in_keys(names: Mapping[str, str]) -> BeforeValidator:
    """For a field of a model that is a mapping: its keys in today's words."""
    return BeforeValidator(lambda found: keys_today(found, names) if _is_map(found) else found)


def _is_map(found: object) -> bool:
    return isinstance(found, Mapping)
