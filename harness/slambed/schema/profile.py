# SPDX-License-Identifier: Apache-2.0
"""Makes the schema of a link profile, which no single model reads: curves nest, and `$name` can
replace any number."""

from typing import Any

from slambed.link import curves
from slambed.link.impairments import Bandwidth, Gap, Jitter, PacketLoss
from slambed.link.traces import TraceFile
from slambed.schema.described import Schema, definitions_of

PARAMETER: Schema = {"type": "string", "pattern": r"^\$[A-Za-z_]"}
CURVE: Schema = {"$ref": "#/$defs/Curve"}
TEXT: Schema = {"type": "string"}
SIDE_MEANINGS = {
    "jitter": "extra delay per packet, of both directions",
    "loss": "packets dropped at random, of both directions",
    "rate": "bottleneck of each direction; not given: no limit",
}


def _ref(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _means(description: str, schema: Schema) -> Schema:
    return {**schema, "description": description}


def _or_null(schema: Schema) -> Schema:
    return {"anyOf": [schema, {"type": "null"}]}


def with_parameters(schema: Any) -> Any:
    """Returns the schema with `$name` allowed for every number."""
    if isinstance(schema, list):
        return [with_parameters(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if schema.get("type") in ("number", "integer"):
        return {"anyOf": [schema, PARAMETER]}
    return {key: with_parameters(value) for key, value in schema.items()}


def _curve(definitions: dict[str, Schema]) -> Schema:
    kinds: dict[str, Schema] = {
        "constant": with_parameters({"type": "number"}),
        "sum": {"type": "array", "items": CURVE, "minItems": 1},
        "trace": _ref(TraceFile.__name__),
    }
    kinds |= {kind: _ref(model.__name__) for kind, model in curves.PLAIN.items()}
    for kind, model in curves.LISTS.items():
        kinds[kind] = definitions[model.__name__]["properties"]["points"]
    for kind, model in curves.WRAPPERS.items():
        changed = definitions[model.__name__]["properties"]
        changed["of"] = _means(changed["of"]["description"], CURVE)
        kinds[kind] = _ref(model.__name__)
    mapping = {
        "type": "object", "properties": kinds, "additionalProperties": False,
        "minProperties": 1, "maxProperties": 1,
    }  # fmt: skip
    return {"anyOf": [with_parameters({"type": "number"}), mapping]}


def profile_definitions() -> dict[str, Schema]:
    """Returns `Profile`, `ProfileChoice` (as in experiments) and their parts."""
    models = [*curves.PLAIN.values(), *curves.LISTS.values(), *curves.WRAPPERS.values()]
    definitions: dict[str, Schema] = with_parameters(
        definitions_of([*models, TraceFile, Jitter, PacketLoss, Bandwidth, Gap])
    )
    definitions["Curve"] = _curve(definitions)
    of_a_side = {"jitter": Jitter, "loss": PacketLoss, "rate": Bandwidth}
    sides = {kind: _or_null(_ref(model.__name__)) for kind, model in of_a_side.items()}
    side = _or_null({"type": "object", "properties": sides, "additionalProperties": False})
    ways = {
        "type": "object", "properties": {"up": CURVE, "down": CURVE},
        "required": ["up", "down"], "additionalProperties": False,
    }  # fmt: skip
    number_or_null = _or_null(with_parameters({"type": "number", "minimum": 0}))
    share = with_parameters({"type": "number", "minimum": 0, "maximum": 1})
    definitions["Profile"] = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "name": _means("name of the profile, as of the file", TEXT),
            "description": _means("one line for lists and reports", TEXT),
            "source": _means("where its numbers come from", TEXT),
            "params": _means(
                "name -> number; `$name` stands for it wherever a number is asked for",
                {"type": "object", "additionalProperties": {"type": "number"}},
            ),
            "duration_s": _means(
                "length of the profile in lists and plots, at most 100,000 s; every link follows "
                "the curves beyond it, live or virtual; not given: until the curves are constant",
                number_or_null,
            ),
            "rtt_ms": _means("RTT over run time; or give `one_way_ms`", CURVE),
            "one_way_ms": _means(
                "delay of each direction, a curve each under `up` and `down`", ways
            ),
            "up_share": _means(
                "share of `rtt_ms` on the way from mobile to edge; not given: 0.5", share
            ),
            **{kind: _means(SIDE_MEANINGS[kind], schema) for kind, schema in sides.items()},
            "up": _means("mobile to edge: its own `jitter`, `loss` and `rate`", side),
            "down": _means("edge to mobile: its own `jitter`, `loss` and `rate`", side),
            "gaps": _means(
                "outages of both directions", _or_null({"type": "array", "items": _ref("Gap")})
            ),
            "gap_mode": _means(
                "`hold` delays what comes in a gap to its end, `drop` loses it; not given: `hold`",
                {"enum": ["hold", "drop"]},
            ),
            "rate_sha256": _means(
                "name of a Mahimahi file -> its digest; another content is an error",
                {"type": "object", "additionalProperties": TEXT},
            ),
        },
        "oneOf": [{"required": ["rtt_ms"]}, {"required": ["one_way_ms"]}],
        "dependentRequired": {"up_share": ["rtt_ms"]},
    }
    referred = {
        "type": "object",
        "additionalProperties": False,
        "required": ["profile"],
        "properties": {
            "profile": TEXT,
            "params": {"type": "object", "additionalProperties": {"type": "number"}},
            "name": TEXT,
        },
    }
    definitions["ProfileChoice"] = {
        "anyOf": [TEXT, {"type": "number", "minimum": 0}, referred, _ref("Profile")]
    }
    return definitions


def profile_schema() -> Schema:
    """Returns the schema of a file in netem_profiles/."""
    definitions = profile_definitions()
    del definitions["ProfileChoice"]
    return {**definitions.pop("Profile"), "$defs": definitions}
