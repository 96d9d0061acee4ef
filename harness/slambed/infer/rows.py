# SPDX-License-Identifier: Apache-2.0
"""Turns a point of the plan into rows of experiments: what is changed where, and under which
label."""

import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any

from slambed.campaign.datasets import sensor_of
from slambed.errors import SlambedError
from slambed.files.yaml_source import YamlSource
from slambed.infer.design import Point, shown
from slambed.infer.inference_plan import Change, Inference, OpenItem
from slambed.infer.keys import OF_A_DEVICE, Key, split_key
from slambed.infer.slots import Places, Slot
from slambed.link.named_profile import read_profile
from slambed.spec.device import DeviceChange
from slambed.spec.inputs import FROM_DATASET, find_input
from slambed.spec.library import Library
from slambed.spec.matrix import label_of
from slambed.spec.system import Scalar, System
from slambed.suggestion import suggestion


@dataclass(frozen=True)
class Made:
    """A slot at a point: the cell of the experiment written for it."""

    experiment: str
    dataset: str
    label: str
    profile: str | None
    """Name in the written experiment."""


@dataclass
class Rows:
    """Applies the items of a plan to the rows that its cells need."""

    plan: Inference
    source: YamlSource
    places: Places

    def check(self) -> None:
        """Raises SlambedError, with a location in the plan's file, for an item that changes nothing
        or has an invalid value."""
        for name, item in self.plan.open.items():
            if not any(self._applies(name, item, slot) for slot in self._all):
                raise self.source.complaint(*self._idle(name, item))
            for slot in self._all:
                if self._applies(name, item, slot):
                    self._check_values(name, item, slot)
        self._check_changes()
        for pattern in self.plan.instead:
            if not any(fnmatchcase(s, pattern) for s in self._systems):
                message = f"{pattern} is no system of the fitted or held-out cells"
                raise self.source.complaint(
                    message, ("instead", pattern), suggestion(pattern, sorted(self._systems))
                )

    def unfitted(self) -> list[str]:
        """Returns the open items that no fitted cell depends on, so they cannot be fitted."""
        slots = self.places.slots(self.plan.fit)
        return [
            n for n, i in self.plan.open.items() if not any(self._applies(n, i, s) for s in slots)
        ]

    def made(self, slot: Slot, point: Point) -> Made:
        """Returns the cell for this slot at this point. Items that do not apply to the slot are
        left out, so all their values share one cell."""
        own = [(n, v) for n, v in point.values if self._applies(n, self.plan.open[n], slot)]
        base = self.places.bases[slot.experiment]
        row = label_of(base.plan.experiment.systems[slot.row], base.systems[slot.row])
        words = ", ".join(f"{n} {shown(v)}" for n, v in own)
        label = f"{row} @ {words}" if words else row
        dataset = self._instead(own, "datasets", slot.dataset)
        profile = None if slot.profile is None else self._instead(own, "profiles", slot.profile)
        return Made(slot.experiment, dataset, label.replace("/", "-"), profile)

    def entry(self, slot: Slot, point: Point) -> dict[str, Any]:
        """Returns the row as in an experiment's file, without its profiles."""
        base = self.places.bases[slot.experiment]
        written = base.source.data["systems"][slot.row]
        entry: dict[str, Any] = deepcopy(written)
        entry["label"] = self.made(slot, point).label
        for change in (*self._throughout(slot), *self._cases(slot, point)):
            _change(entry, change)
        for name, value in point.values:
            item = self.plan.open[name]
            if item.set is None or not self._applies(name, item, slot):
                continue
            key = split_key(item.set)
            if key.kind == "params":
                entry["params"] = {**(entry.get("params") or {}), key.name: value}
            elif key.kind == "devices":
                usual = base.source.data.get("devices") or {}
                own = entry.setdefault("devices", {})
                own[key.name] = changed_device(own.get(key.name, usual.get(key.name)), key, value)
        self._anchor(entry, base.source, base.systems[slot.row])
        return entry

    @cached_property
    def _all(self) -> list[Slot]:
        return self.places.slots((*self.plan.fit, *self.plan.held_out))

    @cached_property
    def _systems(self) -> set[str]:
        return set().union(*(self._called(slot) for slot in self._all))

    def _called(self, slot: Slot) -> set[str]:
        return self.places.paper_systems[slot.experiment, slot.row]

    def _about(self, slot: Slot, patterns: list[str] | None) -> bool:
        return patterns is None or any(
            fnmatchcase(name, pattern) for name in self._called(slot) for pattern in patterns
        )

    def _applies(self, name: str, item: OpenItem, slot: Slot) -> bool:
        if item.cases is not None:
            patterns = [p for case in item.cases.values() for p in case]
            return self._about(slot, patterns)
        assert item.set is not None
        key = split_key(item.set)
        system = self.places.bases[slot.experiment].systems[slot.row]
        if not self._about(slot, item.systems):
            return False
        match key.kind:
            case "params":
                return key.name in system.params
            case "devices":
                return key.name == "mobile" or system.has_edge
            case "datasets":
                return key.name == slot.dataset
            case "profiles":
                return key.name == slot.profile and system.has_edge

    def _idle(self, name: str, item: OpenItem) -> tuple[str, tuple[str, ...], str]:
        place = ("open", name, "cases" if item.cases is not None else "set")
        if item.cases is not None:
            return f"no system of the cells is changed by {name}", place, ""
        key = split_key(str(item.set))
        kind = {"params": "parameter", "devices": "device", "datasets": "dataset",
                "profiles": "profile"}[key.kind]  # fmt: skip
        slots = [s for s in self._all if self._about(s, item.systems)]
        known: set[str] = set()
        for slot in slots:
            if key.kind == "params":
                known |= set(self.places.bases[slot.experiment].systems[slot.row].params)
            elif key.kind == "datasets":
                known.add(slot.dataset)
            elif slot.profile is not None:
                known.add(slot.profile)
        message = f"unknown {kind} '{key.name}': none of the fitted or held-out cells has it"
        return message, place, suggestion(key.name, sorted(known)) if known else ""

    def _check_changes(self) -> None:
        """Raises SlambedError for a variant or parameter in `instead` or cases that a system does
        not have."""
        changes = [(("instead", p), p, c) for p, c in self.plan.instead.items()]
        changes += [
            (("open", name), pattern, change)
            for name, item in self.plan.open.items()
            for case in (item.cases or {}).values()
            for pattern, change in case.items()
        ]
        for place, pattern, change in changes:
            for slot in (s for s in self._all if self._about(s, [pattern])):
                base = self.places.bases[slot.experiment]
                system, choice = base.systems[slot.row], base.plan.experiment.systems[slot.row]
                try:
                    variant = system.choose_variant(change.variant or choice.variant)
                    system.resolve(variant, {**choice.params, **change.params})
                except SlambedError as error:
                    raise self.source.complaint(str(error), place) from None

    def _check_values(self, name: str, item: OpenItem, slot: Slot) -> None:
        """Raises SlambedError for an invalid end or value of an item."""
        if item.set is None:
            return
        key = split_key(item.set)
        base = self.places.bases[slot.experiment]
        for value in (*(item.range or item.values or []), item.printed):
            try:
                if key.kind == "params":
                    base.systems[slot.row].params[key.name].check(value)
                elif key.kind == "datasets":
                    sensor_of(str(value))
                elif key.kind == "profiles":
                    read_profile(str(value), str(self.source.path))
                else:
                    self._device(slot, key, value)
            except (ValueError, SlambedError) as error:
                message = str(error).splitlines()[0]
                raise self.source.complaint(f"{item.set}: {message}", ("open", name)) from None

    def _device(self, slot: Slot, key: Key, value: Scalar) -> None:
        choice = self.places.bases[slot.experiment].plan.experiment
        own = getattr(choice.systems[slot.row].devices, key.name)
        asked = own if own is not None else getattr(choice.devices, key.name)
        if isinstance(asked, DeviceChange):
            asked = asked.model_dump(exclude_defaults=True)
        made, library = changed_device(asked, key, value), Library()
        if isinstance(made, Mapping):
            change = DeviceChange.model_validate(made)
            change.applied_to(library.device(change.device))
        else:
            library.device(str(made))

    def _instead(self, own: list[tuple[str, Scalar]], kind: str, name: str) -> str:
        for item, value in own:
            asked = self.plan.open[item].set
            if asked is not None and split_key(asked) == Key(kind, name):  # type: ignore[arg-type]
                return str(value)
        return name

    def _throughout(self, slot: Slot) -> list[Change]:
        return [c for p, c in self.plan.instead.items() if self._about(slot, [p])]

    def _cases(self, slot: Slot, point: Point) -> list[Change]:
        named = point.named
        return [
            change
            for name, item in self.plan.open.items()
            for pattern, change in (item.cases or {}).get(str(named[name]), {}).items()
            if self._about(slot, [pattern])
        ]

    def _anchor(self, entry: dict[str, Any], source: YamlSource, system: System) -> None:
        """Makes paths of files next to the experiment absolute, so the written experiment finds
        them."""
        for name, value in (entry.get("params") or {}).items():
            if name in system.file_params and value not in ("", FROM_DATASET):
                try:
                    entry["params"][name] = str(find_input(str(value), source.path.parent))
                except SlambedError as error:
                    raise source.complaint(str(error), ("systems",)) from None


def _change(entry: dict[str, Any], change: Change) -> None:
    if change.variant is not None:
        entry["variant"] = change.variant
    if change.params:
        entry["params"] = {**(entry.get("params") or {}), **change.params}


def changed_device(asked: Any, key: Key, value: Scalar) -> Any:
    """Returns a device as in an experiment's file, with one part changed."""
    if not key.part:
        return value
    device: dict[str, Any] = (
        dict(asked) if isinstance(asked, Mapping) else {"device": asked or "host"}
    )
    stage = key.part.removeprefix("jitter.")
    if stage != key.part:
        device["jitter"] = {**device.get("jitter", {}), stage: value}
    else:
        device[key.part] = value
    parts = [f"{k}{v}" for k, v in device.items() if k in OF_A_DEVICE]
    parts += [f"{k}-{v}" for k, v in device.get("jitter", {}).items()]
    device["name"] = re.sub(r"[^A-Za-z0-9_.-]", "-", "_".join([str(device["device"]), *parts]))
    return device
