# SPDX-License-Identifier: Apache-2.0
"""The published numbers that our devices were fitted to; agreement with these is no evidence."""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import pandas as pd

from slambed.errors import SlambedError
from slambed.files.yaml_source import load_yaml
from slambed.native import repository_root


@dataclass(frozen=True)
class DeviceFit:
    """One file of catalog/devices/fits: ids (patterns) of published numbers, and the devices fitted
    to them."""

    name: str
    patterns: tuple[str, ...]
    devices: frozenset[str]

    def has(self, cell: str) -> bool:
        """Returns whether the fit used a published number."""
        return any(fnmatchcase(cell, pattern) for pattern in self.patterns)


def read_fits(folder: Path | None = None) -> list[DeviceFit]:
    """Returns all fits that name published numbers (`fits:`). Raises SlambedError on a malformed
    file."""
    found = []
    for path in sorted(
        (folder or repository_root() / "catalog" / "devices" / "fits").glob("*.yaml")
    ):
        content = load_yaml(path).data
        if not isinstance(content, dict) or not content.get("fits"):
            continue
        try:
            # A `given` device was not fitted, so its runs alone involve no fitted number.
            fitted = (d for d in content.get("devices", {}).values() if not d.get("given"))
            devices = frozenset(str(n) for d in fitted for n in (d["device"], *d.get("also", [])))
        except (AttributeError, KeyError, TypeError):
            raise SlambedError(f"{path}: devices: expected roles, each with a 'device'") from None
        found.append(DeviceFit(path.stem, tuple(map(str, content["fits"])), devices))
    return found


def fits_used(fits: list[DeviceFit], runs: pd.DataFrame) -> list[DeviceFit]:
    """Returns the fits whose devices made any of these runs."""
    columns = [c for c in ("device_mobile", "device_edge") if c in runs]
    names = {str(name) for c in columns for name in runs[c].dropna().unique()}
    return [fit for fit in fits if fit.devices & names]
