# SPDX-License-Identifier: Apache-2.0
"""systems/*/parameters.hpp: C++ declarations of a system's parameters, written by `python -m
slambed.document`. The C++ build therefore needs neither Python packages nor YAML."""

import json

from slambed.spec.system import Parameter, System

HEADER = "parameters.hpp"
MADE = {"int": "integer", "float": "real", "bool": "boolean", "str": "choice", "path": "path"}


def parameter_header(system: System) -> str:
    """Returns types, ranges and choices of all parameters that nodes receive. Defaults are left
    out: run.json holds every value."""
    specs = "".join(
        f"      ParameterSpec::{_spec(name, parameter)},\n"
        for name, parameter in system.params.items()
        if name != system.network_param
    )
    return f"""\
// SPDX-License-Identifier: Apache-2.0
// Written from system.yaml by 'python -m slambed.document': change that file.
#pragma once

#include "node/parameters.hpp"

namespace slambed::{system.name} {{

// clang-format off
inline std::vector<ParameterSpec> parameter_specs() {{
  return {{
{specs}  }};
}}
// clang-format on

}}  // namespace slambed::{system.name}
"""


def _spec(name: str, parameter: Parameter) -> str:
    arguments = [json.dumps(name)]
    if parameter.type in ("int", "float"):
        if parameter.min is None or parameter.max is None:
            raise ValueError(f"parameter {name}: a number needs min and max")
        arguments += [_number(parameter.min), _number(parameter.max)]
    elif parameter.type == "str":
        arguments.append(
            f"{{{', '.join(json.dumps(choice) for choice in parameter.choices or [])}}}"
        )
    return f"{MADE[parameter.type]}({', '.join(arguments)})"


def _number(value: int | float) -> str:
    return f"{value:.0f}" if value == int(value) else repr(value)
