# SPDX-License-Identifier: Apache-2.0
"""Link profiles: RTT, jitter, loss and rate as pure functions of run time.

netem_profiles/*.yaml contain named profiles; docs/explanation/link.md describes every key. A value
is an RTT; half of it is applied per direction unless `up_share` or `one_way_ms` is given.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from slambed.errors import SlambedError
from slambed.files.outputs import is_file
from slambed.files.yaml_source import in_words, load_yaml
from slambed.link.curves import LONGEST_MS, Curve, Times
from slambed.link.impairments import Bandwidth, Gap, Jitter, PacketLoss, Side
from slambed.link.profile_reader import ProfileReader, substitute, used_params
from slambed.link.traces import (
    check_digest,
    find_trace,
    lasting_name,
    read_rate_trace,
    sha256_of,
)
from slambed.native import repository_root
from slambed.spec.recorded_part import RecordedPart
from slambed.suggestion import suggestion

LONGEST_S = 100_000.0
"""Longest profile; a longer one indicates a wrong unit."""
CHECK_STEP_S = 0.01
CHECK_FOREVER_S = 900.0
"""Range in which a profile that never settles is checked as often."""
CHECK_LATER_STEP_S = 1.0
"""From there on, as a slow wave may become negative in a long run only."""

KEYS = [
    "name", "description", "source", "params", "duration_s", "rtt_ms", "one_way_ms", "up_share",
    "jitter", "loss", "rate", "up", "down", "gaps", "gap_mode", "rate_sha256",
]  # fmt: skip


@dataclass(frozen=True)
class Profile:
    """A checked profile. Run time 0 is the first played frame; the value at 0 also holds before
    it."""

    name: str
    description: str
    source: str
    """Source of its numbers."""
    duration: float | None
    """Its length in lists and plots [s]; None for a profile that never settles and says nothing.
    Every link follows the curves, see `settled_s`."""
    up_curve: Curve
    down_curve: Curve
    up_share: float
    down_share: float
    up: Side = field(default_factory=Side)
    down: Side = field(default_factory=Side)
    gaps: tuple[Gap, ...] = ()
    gap_mode: Literal["hold", "drop"] = "hold"
    rate_traces: Mapping[str, list[int]] = field(default_factory=dict)
    """File name -> delivery opportunities of the Mahimahi trace in ms."""
    content: Mapping[str, Any] = field(default_factory=dict)
    """Input with which `parse_profile` recreates the profile; includes digests of traces."""
    remarks: tuple[str, ...] = ()
    """What was assumed about its traces, a line each."""
    recorded: tuple[RecordedPart, ...] = ()
    """Traces of round-trip times that play for as long as a run lasts."""

    def up_ms(self, t: Times) -> Times:
        """Returns the one-way delay mobile to edge at run times `t` [s]."""
        return self.up_share * self.up_curve.at(np.asarray(t, dtype=float))

    def down_ms(self, t: Times) -> Times:
        """Returns the one-way delay edge to mobile."""
        return self.down_share * self.down_curve.at(np.asarray(t, dtype=float))

    def rtt_series_ms(self, t: Times) -> Times:
        """Returns the RTT at run times `t` [s]."""
        return self.up_ms(t) + self.down_ms(t)

    def rtt_ms(self, t: float) -> float:
        """Returns the RTT at run time `t` [s], without jitter, queueing and the path's base RTT."""
        return float(self.rtt_series_ms(np.array([t]))[0])

    def delays_ms(self, t: float) -> tuple[float, float]:
        """Returns the one-way delays (up, down) at run time `t` [s]."""
        at = np.array([t])
        return float(self.up_ms(at)[0]), float(self.down_ms(at)[0])

    @property
    def settled_s(self) -> float | None:
        """Seconds after which its delays are constant; None if they never settle."""
        ends = [curve.duration_s() for curve in (self.up_curve, self.down_curve)]
        return None if None in ends else max(end for end in ends if end is not None)

    @property
    def needs_seed(self) -> bool:
        """True for random impairments, which only the relay can reproduce."""
        return any(side.jitter or side.loss for side in (self.up, self.down))

    @property
    def is_none(self) -> bool:
        """True when the link adds nothing."""
        free = not (self.needs_seed or self.up.rate or self.down.rate or self.gaps)
        return free and self.settled_s == 0.0 and self.rtt_ms(0.0) == 0.0


MUCH_LOSS = 0.5
"""Larger shares are allowed, but hardly meant."""


def profiles_folder() -> Path:
    """Returns netem_profiles/ of the checkout."""
    return repository_root() / "netem_profiles"


def profile_names() -> list[str]:
    """Returns the names of all profile files."""
    return sorted(path.stem for path in profiles_folder().glob("*.yaml"))


def load_profile(name_or_path: str | Path, params: Mapping[str, float] | None = None) -> Profile:
    """Loads a profile by name (`ramp_85`) or by path (ends in .yaml or .yml)."""
    text = str(name_or_path)
    named = not text.endswith((".yaml", ".yml"))
    path = profiles_folder() / f"{text}.yaml" if named else Path(text)
    if named and not is_file(path):
        near = suggestion(text, profile_names())
        raise SlambedError(f"unknown profile '{text}', no {path}; {near}")
    source = load_yaml(path)
    if not isinstance(source.data, dict):
        raise source.complaint("expected a mapping of keys")
    if named and source.data.get("name", text) != text:
        raise source.complaint(f"name is not '{text}', as the file's name says", ("name",))
    data = {"name": path.stem, **source.data}
    return _build(data, params or {}, ProfileReader(str(path), path.parent))


def parse_profile(
    mapping: str | float | Mapping[str, Any], where: str, near: Path | None = None
) -> Profile:
    """Parses a profile as written in an experiment.

    It is a name, a number (constant RTT), `{profile: ramp, params: {peak_ms: 50}, name: mild}`, or
    a whole inline profile. `where` names the place in errors, `near` is the folder that the traces
    of an inline profile are named from.
    """
    reader = ProfileReader(where, near)
    if isinstance(mapping, str):
        try:
            return load_profile(mapping)
        except SlambedError as error:
            if near is not None and is_file(near / f"{mapping}.yaml"):
                advice = f"for {mapping}.yaml beside the experiment write ./{mapping}.yaml"
                raise reader.complaint(f"unknown profile '{mapping}'", advice=advice) from None
            raise SlambedError(f"{error} ({where})", error.code) from None
    if isinstance(mapping, int | float) and not isinstance(mapping, bool):
        data = {"name": f"rtt_{mapping:g}", "rtt_ms": mapping}
        return _build(data, {}, reader)
    if not isinstance(mapping, Mapping):
        found = in_words(mapping)
        raise reader.complaint(f"expected a profile's name, milliseconds or a mapping, not {found}")
    if "profile" in mapping:
        return _refer(mapping, reader)
    return _build({"name": "inline", **mapping}, {}, reader)


def _refer(mapping: Mapping[str, Any], reader: ProfileReader) -> Profile:
    data = reader.only(mapping, ["profile", "params", "name"], "")
    params, wanted = _mapping(data, "params", reader), _text(data, "profile", reader)
    try:
        profile = load_profile(wanted, params)
    except SlambedError as error:
        raise SlambedError(f"{error} ({reader.where})", error.code) from None
    written = ",".join(f"{key}={value:g}" for key, value in params.items())
    name = data.get("name") or (f"{profile.name}[{written}]" if written else profile.name)
    # Its traces are found without a folder; one of the experiment's may have files of their names.
    return _build({**profile.content, "name": name}, {}, ProfileReader(reader.where))


def _build(data: Mapping[str, Any], overrides: Mapping[str, Any], reader: ProfileReader) -> Profile:
    data = reader.only(data, KEYS, "")
    params = _params(_mapping(data, "params", reader), overrides, reader)
    data.pop("params", None)
    used = used_params(data)
    data = {key: substitute(value, params, reader, key) for key, value in data.items()}
    if unused := [name for name in params if name not in used]:
        raise reader.complaint(f"nothing uses parameter '{unused[0]}'", "params", "remove it")
    up_curve, down_curve, up_share, down_share = _curves(data, reader)
    up, down = (_side(data, side, reader) for side in ("up", "down"))
    for name, side in (("up", up), ("down", down)):
        if side.loss is not None and (share := side.loss.mean()) > MUCH_LOSS:
            reader.remarks.append(f"{share:.0%} of packets {name} are lost; 0.01 is 1 %")
    gaps = data.get("gaps") or []
    if not isinstance(gaps, list):
        raise reader.complaint(f"expected a list of gaps, not {in_words(gaps)}", "gaps")
    gap_mode = data.get("gap_mode", "hold")
    if gap_mode not in ("hold", "drop"):
        found = in_words(gap_mode)
        raise reader.complaint(f"unknown gap_mode {found}", "gap_mode", "known: hold, drop")
    traces = _rate_traces((up, down), _mapping(data, "rate_sha256", reader), reader)
    content = reader.pin_traces({k: v for k, v in data.items() if k != "rate_sha256"})
    if traces:
        content["rate_sha256"] = {
            lasting_name(name, reader.near): sha256_of(find_trace(name, reader.near))
            for name in sorted(traces)
        }
    profile = Profile(
        name=_text(data, "name", reader),
        description=_text(data, "description", reader),
        source=_text(data, "source", reader),
        duration=None,
        up_curve=up_curve,
        down_curve=down_curve,
        up_share=up_share,
        down_share=down_share,
        up=up,
        down=down,
        gaps=tuple(reader.model(Gap, g, f"gaps[{i}]") for i, g in enumerate(gaps)),
        gap_mode=gap_mode,
        rate_traces=traces,
        content=content,
        recorded=tuple(reader.recorded),
    )
    _check_values(profile, reader)
    unexplained = (
        silence.remark
        for silence in reader.silences
        if not any(
            begin < silence.end_s and end > silence.begin_s
            for gap in profile.gaps
            for begin, end in gap.within(silence.end_s)
        )
    )
    return replace(
        profile,
        duration=_duration(data, profile, reader),
        remarks=tuple(dict.fromkeys([*reader.remarks, *unexplained])),
    )


def _mapping(data: Mapping[str, Any], key: str, reader: ProfileReader) -> dict[str, Any]:
    value = data.get(key) or {}
    return reader.only(value, list(value) if isinstance(value, Mapping) else [], key)


def _params(
    declared: Mapping[str, Any], overrides: Mapping[str, Any], reader: ProfileReader
) -> dict[str, float]:
    params = dict(declared)
    for key in overrides:
        if key not in params:
            raise reader.complaint(f"unknown parameter '{key}'", "params", suggestion(key, params))
    params.update(overrides)
    for key, value in params.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not math.isfinite(value):
            raise reader.complaint(f"expected a number, not {in_words(value)}", f"params.{key}")
    return params


def _curves(data: Mapping[str, Any], reader: ProfileReader) -> tuple[Curve, Curve, float, float]:
    if ("rtt_ms" in data) == ("one_way_ms" in data):
        raise reader.complaint("give one of rtt_ms, one_way_ms")
    if "rtt_ms" in data:
        share = data.get("up_share", 0.5)
        if isinstance(share, bool) or not isinstance(share, int | float) or not 0 <= share <= 1:
            raise reader.complaint(f"expected a share 0..1, not {in_words(share)}", "up_share")
        rtt = reader.curve(data["rtt_ms"], "rtt_ms")
        return rtt, rtt, float(share), 1.0 - float(share)
    if "up_share" in data:
        raise reader.complaint("up_share means nothing beside one_way_ms", "up_share", "remove it")
    ways = reader.only(data["one_way_ms"], ["up", "down"], "one_way_ms")
    if len(ways) != 2:
        raise reader.complaint("expected both up and down", "one_way_ms")
    up, down = (reader.curve(ways[side], f"one_way_ms.{side}") for side in ("up", "down"))
    return up, down, 1.0, 1.0


def _side(data: Mapping[str, Any], side: str, reader: ProfileReader) -> Side:
    """Returns the impairments of one direction: those for both, overridden by its own (null =
    none)."""
    kinds: dict[str, type[Jitter] | type[PacketLoss] | type[Bandwidth]]
    kinds = {"jitter": Jitter, "loss": PacketLoss, "rate": Bandwidth}
    own = reader.only(data.get(side) or {}, list(kinds), side)
    found: dict[str, Any] = {}
    for kind, model in kinds.items():
        place = f"{side}.{kind}" if kind in own else kind
        value = own.get(kind, data.get(kind))
        found[kind] = None if value is None else reader.model(model, value, place)
    return Side(**found)


def _rate_traces(
    sides: tuple[Side, Side], digests: Mapping[str, str], reader: ProfileReader
) -> dict[str, list[int]]:
    traces: dict[str, list[int]] = {}
    for side in sides:
        if side.rate is not None and (name := side.rate.trace) is not None:
            check_digest(find_trace(name, reader.near), digests.get(name))
            traces[name] = read_rate_trace(name, reader.near)
    if unused := digests.keys() - traces.keys():
        known = suggestion(min(unused), traces) or "there is no trace of a rate"
        raise reader.complaint(f"no rate has the trace '{min(unused)}'", "rate_sha256", known)
    return traces


def _text(data: Mapping[str, Any], key: str, reader: ProfileReader) -> str:
    value = data.get(key, "")
    if not isinstance(value, str):
        raise reader.complaint(f"expected text, not {in_words(value)}", key)
    return value.strip()


def _duration(data: Mapping[str, Any], profile: Profile, reader: ProfileReader) -> float | None:
    if (asked := data.get("duration_s")) is not None:
        is_number = isinstance(asked, int | float) and not isinstance(asked, bool)
        if not is_number or not 0 <= asked <= LONGEST_S:
            found = in_words(asked)
            raise reader.complaint(
                f"expected seconds up to {LONGEST_S:g}, not {found}", "duration_s"
            )
        return float(asked)
    return profile.settled_s


def _check_values(profile: Profile, reader: ProfileReader) -> None:
    ends = [curve.duration_s() for curve in (profile.up_curve, profile.down_curve)]
    horizon = max([CHECK_FOREVER_S if end is None else end for end in ends])
    if not horizon <= LONGEST_S:
        raise reader.complaint(
            f"the profile lasts {horizon:g} s, more than {LONGEST_S:g} s",
            advice="times are seconds; of a long trace give start_s and length_s",
        )
    t = np.arange(0.0, horizon + CHECK_STEP_S, CHECK_STEP_S)
    if None in ends:
        t = np.append(t, np.arange(t[-1] + CHECK_LATER_STEP_S, LONGEST_S, CHECK_LATER_STEP_S))
    for side, values in (("up", profile.up_ms(t)), ("down", profile.down_ms(t))):
        if (bad := np.flatnonzero(~np.isfinite(values))).size:
            raise reader.complaint(f"latency is not a number at {t[bad[0]]:.2f} s ({side})")
        if (bad := np.flatnonzero(values < 0)).size:
            raise reader.complaint(
                f"negative latency {values[bad[0]]:.3g} ms one way at {t[bad[0]]:.2f} s ({side})",
                advice="wrap the curve in clamp: {min_ms: 0, of: ...}",
            )
        if values.max() > LONGEST_MS:
            raise reader.complaint(
                f"latency of {values.max() / 1e3:g} s ({side})", advice="values are milliseconds"
            )
