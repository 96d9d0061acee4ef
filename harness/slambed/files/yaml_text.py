# SPDX-License-Identifier: Apache-2.0
"""Safe YAML parsing (no Python tags), with the C parser where PyYAML has it: 10 times as fast."""

from collections.abc import Callable
from typing import Any, TypeVar

import yaml

FAST: type[yaml.SafeLoader] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
Read = TypeVar("Read")


def with_parser(read: Callable[[type[yaml.SafeLoader]], Read]) -> Read:
    """Calls `read` with the C parser and, if that fails, with the Python one. The latter accepts
    some valid YAML that the former rejects (`{a:}`), and its errors are clearer."""
    try:
        return read(FAST)
    except yaml.YAMLError:
        return read(yaml.SafeLoader)


def read_yaml(text: str) -> Any:
    """Parses the single document in `text`. Raises yaml.YAMLError."""
    return with_parser(lambda parser: yaml.load(text, Loader=parser))
