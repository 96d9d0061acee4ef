# SPDX-License-Identifier: Apache-2.0
"""`params_from:` of a system.yaml: parameters that several systems share."""

from typing import Any

from slambed.files.yaml_source import YamlSource, load_yaml

KEY = "params_from"


def with_shared_params(source: YamlSource) -> YamlSource:
    """Returns the description with its own parameters followed by those of the file that
    `params_from` names (relative to this file). Fields given for a shared parameter override only
    those fields.

    Raises SlambedError if that file is missing or holds no parameters.
    """
    data = source.data
    if not isinstance(data, dict) or KEY not in data:
        return source
    if not isinstance(data[KEY], str):
        raise source.complaint(f"'{KEY}': expected the path of a file", (KEY,))
    shared = load_yaml(source.path.parent / data[KEY])
    if not isinstance(shared.data, dict) or not all(
        isinstance(p, dict) for p in shared.data.values()
    ):
        raise shared.complaint("expected parameters: a mapping of names to their fields")
    own = data.get("params") or {}
    if not isinstance(own, dict):
        return source
    params: dict[str, Any] = {name: own[name] for name in own if name not in shared.data}
    for name, fields in shared.data.items():
        change = own.get(name, {})
        params[name] = {**fields, **change} if isinstance(change, dict) else change
    found = {key: value for key, value in data.items() if key != KEY} | {"params": params}
    return YamlSource(source.path, found, source.written_at)
