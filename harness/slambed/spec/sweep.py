# SPDX-License-Identifier: Apache-2.0
"""`grid:` and `--set`: parameter sweeps and overrides, applied before the experiment is checked.

A grid point is identical to a cell written by hand: the run key does not depend on how parameters
were written.
"""

import re
from copy import deepcopy
from itertools import product
from pathlib import Path
from typing import Any

from slambed.errors import SlambedError
from slambed.files.yaml_source import Location, YamlSource, in_words, value_of
from slambed.suggestion import suggestion

SYSTEMS = "systems"
GRID = "grid"
PARAMS = "params."
RTT = "link.rtt_ms"
OF_A_SYSTEM = ("variant", "devices.mobile", "devices.edge")
ADVICE = f"a grid varies {PARAMS}<name>, {', '.join(OF_A_SYSTEM)}"
SLOT = re.compile(r"\{(\w+)\}")
"""Placeholder in a label: `{n_orb}` for the value of params.n_orb, `{mobile}` for a device."""


def swept(source: YamlSource) -> YamlSource:
    """Expands the grids: each system appears once per point of its own grid, or else of the
    experiment's."""
    data = source.data
    entries = data.get(SYSTEMS) if isinstance(data, dict) else None
    entries = entries if isinstance(entries, list) else []
    if not isinstance(data, dict) or not any(_has_grid(item) for item in (data, *entries)):
        return source
    found = {key: value for key, value in data.items() if key != GRID}
    written_at = {
        place: written
        for place, written in source.written_at.items()
        if place[:1] != (SYSTEMS,) or len(place) == 1
    }
    grid = _checked(source, data[GRID], (GRID,), RTT) if GRID in data else {}
    if RTT in grid:
        link = found.get("link", {})
        if not isinstance(link, dict) or "profiles" in link:
            raise source.complaint(f"{RTT} of a grid and link.profiles are two links", (GRID, RTT))
        found["link"] = {**link, "profiles": grid.pop(RTT)}
        written_at |= _places_below(source, (GRID, RTT), ("link", "profiles"))
    if entries:
        found[SYSTEMS] = []
    for index, entry in enumerate(entries):
        of_entry = _places_below(source, (SYSTEMS, index), ())
        for made in _points(source, index, entry, grid):
            at = (SYSTEMS, len(found[SYSTEMS]))
            written_at |= {(*at, *place): written for place, written in of_entry.items()}
            found[SYSTEMS].append(made)
    return YamlSource(source.path, found, written_at)


def changed(source: YamlSource, settings: list[str]) -> YamlSource:
    """Applies `key=value` of the command line to a key of the file (`playback.end_s`) or to
    `params.<name>` of every system. Raises SlambedError for malformed settings."""
    if not settings or not isinstance(source.data, dict):
        return source
    data, written_at = deepcopy(source.data), dict(source.written_at)
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals or not key:
            raise SlambedError(f"--set {setting}: write KEY=VALUE, as in params.n_orb=750")
        if key == "id":
            raise SlambedError(f"--set {setting}: the id is the name of the file; copy the file")
        value = value_of(text, f"--set {setting}")
        entries = data.get(SYSTEMS)
        if key.startswith(PARAMS) and isinstance(entries, list):
            name = key.removeprefix(PARAMS)
            for index, entry in enumerate(entries):
                if not isinstance(entry, dict):
                    continue
                params = entry.get("params")
                # What is no mapping is left to the check of the systems.
                if params is None or isinstance(params, dict):
                    entry["params"] = {**(params or {}), name: value}
                    _write_at(written_at, (SYSTEMS, index, "params", name), setting)
        else:
            _put(data, key.split("."), value, setting)
            _write_at(written_at, tuple(key.split(".")), setting)
    return YamlSource(source.path, data, written_at)


def _has_grid(item: Any) -> bool:
    return isinstance(item, dict) and GRID in item


def _checked(source: YamlSource, grid: Any, at: Location, *further: str) -> dict[str, list[Any]]:
    """Checks a grid and returns it; `further` are allowed keys besides those of a system."""
    advice = ", ".join((ADVICE, *further))
    if not isinstance(grid, dict) or not grid:
        raise source.complaint("expected keys with lists of values", at, advice)
    for key, values in grid.items():
        place = (*at, key)
        name = str(key)
        if key not in (*OF_A_SYSTEM, *further) and name.removeprefix(PARAMS) in ("", name):
            raise source.complaint(f"a grid cannot vary '{key}'", place, advice)
        if not isinstance(values, list) or not values:
            raise source.complaint(f"'{key}' of a grid is a list of values", place)
        if any(isinstance(value, dict | list) or value is None for value in values):
            changes = "give a changed device its own entry of systems, with devices"
            advice = changes if name.startswith("devices.") else ""
            raise source.complaint(f"'{key}' of a grid has plain values", place, advice)
        if len({str(value) for value in values}) < len(values):
            raise source.complaint(f"'{key}' of a grid has a value twice", place)
    return dict(grid)


def _points(source: YamlSource, index: int, entry: Any, grid: dict[str, list[Any]]) -> list[Any]:
    """Returns an entry of `systems` at every point of its own grid, or else of the experiment's."""
    if not isinstance(entry, dict):
        return [entry]  # an error that the check of the systems reports
    if GRID in entry:
        grid = _checked(source, entry[GRID], (SYSTEMS, index, GRID))
        entry = {key: value for key, value in entry.items() if key != GRID}
    if not grid:
        return [entry]
    return [
        _at(source, index, entry, dict(zip(grid, point, strict=True)))
        for point in product(*grid.values())
    ]


def _at(source: YamlSource, index: int, entry: dict[str, Any], point: dict[str, Any]) -> Any:
    """Returns a system at one grid point, with a label that names the point."""
    made = deepcopy(entry)
    values = {}
    for key, value in point.items():
        name = key.removeprefix(PARAMS)
        part, _, leaf = ("params." + name if name != key else key).rpartition(".")
        if part and made.get(part) is None:
            made[part] = {}
        inside = made[part] if part else made
        if not isinstance(inside, dict):
            found = f"expected a mapping, not {in_words(inside)}"
            raise source.complaint(found, (SYSTEMS, index, part))
        if leaf in inside:
            raise source.complaint(f"{key} is in the grid and here", (SYSTEMS, index))
        inside[leaf] = value
        values[leaf] = str(value).replace("/", "_")  # a label has no '/'
    label = entry.get("label")
    if isinstance(label, str) and (slots := SLOT.findall(label)):
        for slot in slots:
            if slot not in values:
                message = f"the grid varies no '{slot}' for the label"
                raise source.complaint(message, (SYSTEMS, index, "label"), suggestion(slot, values))
        return {**made, "label": SLOT.sub(lambda found: values[found[1]], label)}
    base = label or _called(entry.get("system"))
    if not label and entry.get("variant"):
        base = f"{base}:{entry['variant']}"
    words = ", ".join(f"{leaf} {value}" for leaf, value in values.items())
    return {**made, "label": f"{base} {words}"}


def _called(system: Any) -> Any:
    """Returns the system's name in a label; of a path the file's, or that of the folder of a
    system.yaml."""
    if not isinstance(system, str) or not system.endswith((".yaml", ".yml")):
        return system
    path = Path(system)
    return path.stem if path.name != "system.yaml" else path.parent.name or path.stem


def _put(data: dict[str, Any], path: list[str], value: Any, setting: str) -> None:
    inside: Any = data
    for depth, part in enumerate(path[:-1], 1):
        inside = inside.setdefault(part, {})
        if not isinstance(inside, dict):
            whole, key = ".".join(path[:depth]), ".".join(path[depth:])
            if isinstance(inside, list):
                raise SlambedError(
                    f"--set {setting}: {whole} is a list; set the whole of it: "
                    f"--set '{whole}=[...]'"
                )
            same = f"device: {inside}, name: NAME, " if path[0] == "devices" else ""
            raise SlambedError(
                f"--set {setting}: {whole} is {in_words(inside)} and has no keys; write "
                f"--set '{whole}={{{same}{key}: {setting.partition('=')[2]}}}'"
            )
    inside[path[-1]] = value


def _write_at(written_at: dict[Location, int | str], path: Location, setting: str) -> None:
    """Notes that this option and no line of the file has what is at `path`."""
    for place in [place for place in written_at if place[: len(path)] == path]:
        del written_at[place]
    for length in range(1, len(path) + 1):
        written_at.setdefault(path[:length], f"--set {setting}")


def _places_below(source: YamlSource, old: Location, new: Location) -> dict[Location, int | str]:
    """Returns what is written below `old` as if below `new`, so that complaints about what is made
    of an entry name the line or option that was written. Those of a grid, which is gone, are left
    out."""
    return {
        (*new, *place[len(old) :]): written
        for place, written in source.written_at.items()
        if place[: len(old)] == old and place[len(old) : len(old) + 1] != (GRID,)
    }
