# SPDX-License-Identifier: Apache-2.0
"""The keys that an open item may set in an experiment."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal["params", "devices", "datasets", "profiles"]
ROLES = ("mobile", "edge")
OF_A_DEVICE = ("cores", "speed", "background")
"""Numbers of a device that may be changed, besides the jitter of its stages."""
ADVICE = (
    "set is params.<name>, devices.<mobile|edge>, "
    "devices.<role>.<cores|speed|background|jitter.<stage>>, datasets.<name> or profiles.<name>"
)


@dataclass(frozen=True)
class Key:
    """`params.n_orb`, `devices.mobile.jitter.track`, `datasets.paper_office`, `profiles.sine`."""

    kind: Kind
    name: str
    """Name of the parameter, the role, the dataset or the profile."""
    part: str = ""
    """Part of a device: `cores`, `speed`, `background`, `jitter.<stage>`; empty for the whole
    device."""


def split_key(text: str) -> Key:
    """Parses a key. Raises ValueError for a key that cannot be set."""
    kind, _, name = text.partition(".")
    if not name or kind not in ("params", "devices", "datasets", "profiles"):
        raise ValueError(f"'{text}' cannot be set; {ADVICE}")
    if kind == "params":
        return Key("params", name)
    if kind == "datasets":
        return Key("datasets", name)
    if kind == "profiles":
        return Key("profiles", name)
    role, _, part = name.partition(".")
    stage = part.startswith("jitter.") and len(part) > len("jitter.")
    if role not in ROLES or not (part in ("", *OF_A_DEVICE) or stage):
        raise ValueError(f"'{text}' cannot be set; {ADVICE}")
    return Key("devices", role, part)
