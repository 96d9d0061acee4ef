# SPDX-License-Identifier: Apache-2.0
"""Converts plain YAML values to curves and impairments; each complaint is one line with its
place."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from slambed.errors import SlambedError
from slambed.files.yaml_source import in_words, mistake
from slambed.link import curves
from slambed.link.curves import Curve
from slambed.link.traces import (
    Silence,
    TraceFile,
    find_trace,
    lasting_name,
    read_rtt_trace,
    sha256_of,
)
from slambed.spec.recorded_part import RecordedPart
from slambed.spec.run_spec import with_trace_names
from slambed.suggestion import suggestion

Model = TypeVar("Model", bound=BaseModel)


AS_MAPPING = {
    "loss": "loss: {{random: {}}}", "rate": "rate: {{mbps: {}}}", "jitter": "jitter: {{sd_ms: {}}}",
}  # fmt: skip
"""How a plain number is written where a mapping is expected."""


class ProfileReader:
    """Reads one profile; `where` names it in errors, `near` is the folder of its traces."""

    def __init__(self, where: str, near: Path | None = None) -> None:
        self.where = where
        self.near = near
        self.remarks: list[str] = []
        """What was assumed about its traces, a line each."""
        self.silences: list[Silence] = []
        """Silences of its traces across which a line leads."""
        self.recorded: list[RecordedPart] = []
        """Traces of round-trip times that play for as long as a run lasts."""

    def complaint(self, what: str, place: str = "", advice: str = "") -> SlambedError:
        spot = f"{self.where} at {place}" if place else self.where
        return SlambedError(f"{what}, {spot}" + (f"; {advice}" if advice else ""))

    def only(self, data: Any, known: list[str], place: str) -> dict[str, Any]:
        """Returns `data` as a dict; raises a complaint about unknown keys."""
        if not isinstance(data, Mapping):
            number = isinstance(data, int | float) and not isinstance(data, bool)
            example = AS_MAPPING.get(place.rpartition(".")[2], "") if number else ""
            advice = f"write '{example.format(data)}'" if example else ""
            raise self.complaint(f"expected a mapping of keys, not {in_words(data)}", place, advice)
        for key in data:
            if key not in known:
                raise self.complaint(f"unknown key '{key}'", place, suggestion(str(key), known))
        return dict(data)

    def model(self, model: type[Model], data: Any, place: str) -> Model:
        """Returns `data` validated against a pydantic model."""
        given = self.only(data, list(model.model_fields), place)
        try:
            made = model.model_validate(given)
        except ValidationError as error:
            errors = error.errors()
            first = errors[0]
            path = ".".join([place, *(str(part) for part in first["loc"])])
            if first["type"] == "extra_forbidden":
                raise self.complaint(f"unknown key '{first['loc'][-1]}'", path) from None
            if first["type"] == "missing":
                raise self.complaint("missing", path) from None
            if isinstance(first["input"], bool) and first["type"].startswith(_LIMITS):
                raise self.complaint(_TRUTH, path) from None
            same = [item for item in errors if item["loc"] == first["loc"]]
            raise self.complaint(mistake(same), path) from None
        if (truth := _truth_at(given, made, place)) is not None:
            raise self.complaint(_TRUTH, truth)
        return made

    def curve(self, data: Any, place: str) -> Curve:
        """Returns a curve from a number or a mapping with one key."""
        if isinstance(data, bool | str):
            raise self.complaint(f"expected a number or a curve, not {in_words(data)}", place)
        if isinstance(data, int | float):
            return self._constant(data, place)
        if not isinstance(data, Mapping):
            found = in_words(data)
            raise self.complaint(f"expected a number or one curve, not {found}", place, _KNOWN)
        if len(data) != 1:
            raise self.complaint("expected a number or one curve", place, _KNOWN)
        kind, inner = next(iter(data.items()))
        below = f"{place}.{kind}"
        if kind == "constant":
            return self._constant(inner, below)
        if kind == "sum":
            return self._sum(inner, below)
        if kind == "trace":
            description = self.model(TraceFile, inner, below)
            trace = read_rtt_trace(description, self.near)
            self.remarks += trace.remarks
            if trace.silence is not None:
                self.silences.append(trace.silence)
            if description.length_s is None:
                length_s = float(trace.curve.times_s[-1])
                self.recorded.append(RecordedPart(description.file, description.start_s, length_s))
            return trace.curve
        if kind in curves.PLAIN:
            plain: Curve = self.model(curves.PLAIN[kind], inner, below)  # type: ignore[assignment]
            return plain
        if kind in curves.LISTS:
            model = curves.LISTS[kind]
            listed: Curve = self.model(model, {"points": inner}, below)  # type: ignore[assignment]
            return listed
        if kind in curves.WRAPPERS:
            return self._wrapped(curves.WRAPPERS[kind], inner, below)
        raise self.complaint(f"unknown curve '{kind}'", place, suggestion(str(kind), curves.KINDS))

    def _constant(self, value: Any, place: str) -> Curve:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.complaint(f"expected milliseconds, not {in_words(value)}", place)
        if not math.isfinite(value):
            raise self.complaint(f"latency is {value}", place, "give a finite number")
        if value < 0:
            raise self.complaint(f"negative latency {value:g} ms", place, "give 0 or more")
        return curves.Constant(value_ms=float(value))

    def _sum(self, parts: Any, place: str) -> Curve:
        if not isinstance(parts, list) or not parts:
            found = "an empty list" if parts == [] else in_words(parts)
            raise self.complaint(f"expected a list of curves, not {found}", place)
        return curves.Sum(parts=[self.curve(p, f"{place}[{i}]") for i, p in enumerate(parts)])

    def _wrapped(self, model: type[curves.Wrapped], data: Any, place: str) -> Curve:
        mapping = self.only(data, list(model.model_fields), place)
        if "of" not in mapping:
            raise self.complaint("key 'of' is missing", place, "give the curve to work on")
        known, earlier = len(self.recorded), len(self.silences)
        inner = self.curve(mapping["of"], f"{place}.of")
        if not model.plays_on:
            del self.recorded[known:]
        wrapped = self.model(model, {**mapping, "of": inner}, place)
        if isinstance(wrapped, curves.Delayed):
            self.silences[earlier:] = [s.later(wrapped.by_s) for s in self.silences[earlier:]]
        found: Curve = wrapped  # type: ignore[assignment]
        return found

    def pin_traces(self, data: Any) -> Any:
        """Returns `data` with the digest of every trace file added, so that it identifies its
        content, and with names by which the files are found from any folder."""
        return with_trace_names(
            data,
            lambda name: lasting_name(name, self.near),
            lambda name: sha256_of(find_trace(name, self.near)),
        )


_TRUTH = "expected a number, not true or false (yes, no, on, off)"
_LIMITS = ("greater_than", "less_than")
"""Errors of pydantic about numbers that are out of their range."""


def _truth_at(given: Any, made: Any, place: str) -> str | None:
    """Returns where a true or false of a file was made a number, if anywhere."""
    if isinstance(given, bool):
        return None if isinstance(made, bool) else place
    if isinstance(given, Mapping) and isinstance(made, BaseModel):
        parts = [(key, value, getattr(made, key)) for key, value in given.items()]
    elif isinstance(given, list) and isinstance(made, list | tuple):
        parts = [(str(i), *pair) for i, pair in enumerate(zip(given, made, strict=True))]
    else:
        return None
    found = (_truth_at(inner, value, f"{place}.{name}") for name, inner, value in parts)
    return next(filter(None, found), None)


_KNOWN = f"known: {', '.join(sorted(curves.KINDS))}"


def used_params(data: Any) -> set[str]:
    """Returns the names of the parameters that `data` mentions as '$name'."""
    if isinstance(data, Mapping):
        return set().union(*map(used_params, data.values()))
    if isinstance(data, list):
        return set().union(*map(used_params, data))
    return {data[1:]} if isinstance(data, str) and data.startswith("$") else set()


def substitute(data: Any, params: Mapping[str, float], reader: ProfileReader, place: str) -> Any:
    """Replaces every string '$name' by the value of that parameter."""
    if isinstance(data, Mapping):
        return {
            key: substitute(value, params, reader, f"{place}.{key}") for key, value in data.items()
        }
    if isinstance(data, list):
        return [
            substitute(value, params, reader, f"{place}[{index}]")
            for index, value in enumerate(data)
        ]
    if isinstance(data, str) and data.startswith("$"):
        name = data[1:]
        if name not in params:
            raise reader.complaint(f"unknown parameter '{data}'", place, suggestion(name, params))
        return params[name]
    return data
