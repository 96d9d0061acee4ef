# SPDX-License-Identifier: Apache-2.0
"""The kinds of YAML files, where they are, and the schema of each."""

import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import partial

from slambed.calibrate.targets import Targets
from slambed.data.recipe import Dataset
from slambed.infer.inference_plan import Inference
from slambed.papers.published.paper import Paper
from slambed.papers.published.paper_plan import PaperPlan
from slambed.schema.described import DIALECT, Schema, schema_of
from slambed.schema.profile import profile_definitions, profile_schema
from slambed.segment.network import Network
from slambed.spec.device import Device
from slambed.spec.experiment import Experiment
from slambed.spec.hosts import Hosts
from slambed.spec.input_recipe import InputRecipe
from slambed.spec.sweep import GRID, OF_A_SYSTEM, RTT
from slambed.spec.system import System

PLAIN: Schema = {"type": ["string", "number", "boolean"]}


def _experiment() -> Schema:
    """Returns the schema with parts that are expanded before validation: a grid, and inline
    profiles."""
    found = schema_of(Experiment)
    found["properties"][GRID] = _grid("values whose combinations every system is compared at", RTT)
    definitions = found["$defs"]
    own = "instead of the experiment's grid; `{n_orb}` of the label is the value of params.n_orb"
    definitions["SystemChoice"]["properties"][GRID] = _grid(own)
    # A grid's link.rtt_ms replaces the profiles.
    link = definitions["LinkChoice"]
    link["properties"]["profiles"]["items"] = {"$ref": "#/$defs/ProfileChoice"}
    del link["required"]
    with_rtt = {"properties": {GRID: {"required": [RTT]}}, "required": [GRID]}
    needs = {"properties": {"link": {"anyOf": [{"type": "null"}, {"required": ["profiles"]}]}}}
    found |= {"if": with_rtt, "else": needs}
    found["$defs"] = {**definitions, **profile_definitions()}
    return found


def _grid(description: str, *further: str) -> Schema:
    values = {"type": "array", "items": PLAIN, "minItems": 1, "uniqueItems": True}
    return {
        "type": "object",
        "minProperties": 1,
        "properties": dict.fromkeys((*OF_A_SYSTEM, *further), values),
        "patternProperties": {"^params\\..": values},
        "additionalProperties": False,
        "description": description,
    }


def _system() -> Schema:
    """Returns the schema with `params_from`, which takes some of a parameter's fields from another
    file."""
    found = schema_of(System)
    found["properties"]["params_from"] = {
        "type": "string",
        "description": "file of parameters that several systems share",
    }
    partly = deepcopy(found["$defs"]["Parameter"])
    partly.pop("required", None)
    found["$defs"]["PartOfParameter"] = partly
    own = found["properties"]["params"]
    whole = own["additionalProperties"]
    own["additionalProperties"] = {"$ref": "#/$defs/PartOfParameter"}
    alone = {"properties": {"params": {"additionalProperties": whole}}}
    return found | {"if": {"required": ["params_from"]}, "else": alone}


def _shared_params() -> Schema:
    found = schema_of(System)
    return {
        "type": "object",
        "additionalProperties": found["properties"]["params"]["additionalProperties"],
        "$defs": {"Parameter": found["$defs"]["Parameter"]},
    }


@dataclass(frozen=True)
class Kind:
    """One kind of file."""

    title: str
    places: tuple[str, ...]
    """Patterns from the root of a checkout, as in editors; `!` excludes."""
    make: Callable[[], Schema]


KINDS: dict[str, Kind] = {
    "experiment": Kind(
        "An experiment of slambed", ("experiments/*.yaml", "**/*_beside_ours.yaml"), _experiment
    ),
    "system": Kind(
        "A system under test", ("**/system.yaml", "examples/*/*_odometry.yaml"), _system
    ),
    "shared-params": Kind(
        "Parameters that several systems share", ("systems/core/*/params.yaml",), _shared_params
    ),
    "device": Kind(
        "A device that a node may be", ("catalog/devices/*.yaml",), partial(schema_of, Device)
    ),
    "device-fit": Kind(
        "What devices are fitted to", ("catalog/devices/fits/*.yaml",), partial(schema_of, Targets)
    ),
    "dataset": Kind("A sequence", ("catalog/datasets/*.yaml",), partial(schema_of, Dataset)),
    "profile": Kind(
        "How the latency of a link changes", ("netem_profiles/*.yaml",), profile_schema
    ),
    "paper": Kind("Published numbers", ("papers/*/paper.yaml",), partial(schema_of, Paper)),
    "plan": Kind(
        "What a paper's campaign decides", ("papers/*/plan.yaml",), partial(schema_of, PaperPlan)
    ),
    "input": Kind("A prepared input", ("catalog/inputs/*.yaml",), partial(schema_of, InputRecipe)),
    "network": Kind(
        "A network for masks", ("catalog/networks/*.yaml",), partial(schema_of, Network)
    ),
    "inference": Kind(
        "What is fitted and what predicted",
        ("papers/*/inference/*.yaml",),
        partial(schema_of, Inference),
    ),
    "hosts": Kind("Machines for live runs", ("**/hosts.yaml",), partial(schema_of, Hosts)),
}


def schema_text(kind: str) -> str:
    """Returns the schema as the text of a file."""
    item = KINDS[kind]
    schema = item.make() | {"$schema": DIALECT, "title": item.title}
    return json.dumps(schema, indent=1, sort_keys=True) + "\n"
