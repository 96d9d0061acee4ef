# SPDX-License-Identifier: Apache-2.0
"""Which published numbers our devices were fitted to: agreement there is no evidence."""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import pandas as pd

from slambed.files.yaml_source import load_yaml
from slambed.native import repository_root


@dataclass(frozen=True)
class DeviceFit:
    """One file of catalog/devices/fits: ids (patterns) of published numbers, and devices fitted."""

    name: str
    patterns: tuple[str, ...]
    devices: frozenset[str]

    def has(self, cell: str) -> bool:
        """Whether a published number was used."""
        return any(fnmatchcase(cell, pattern) for pattern in self.patterns)


def read_fits(folder: Path | None = None) -> list[DeviceFit]:
    """All fits that name published numbers (`fits:`). Raises SlambedError on a torn file."""
    found = []
    for path in sorted(
        (folder or repository_root() / "catalog" / "devices" / "fits").glob("*.yaml")
    ):
        content = load_yaml(path).data
        if not isinstance(content, dict) or not content.get("fits"):
            continue
        # A device that is `given` was not fitted: its runs alone hold no fitted number.
        fitted = (d for d in content.get("devices", {}).values() if not d.get("given"))
        devices = frozenset(str(d["device"]) for d in fitted)
        found.append(DeviceFit(path.stem, tuple(map(str, content["fits"])), devices))
    return found


def fits_used(fits: list[DeviceFit], runs: pd.DataFrame) -> list[DeviceFit]:
    """Those whose devices made any of these runs."""
    columns = [c for c in ("device_mobile", "device_edge") if c in runs]
    names = {str(name) for c in columns for name in runs[c].dropna().unique()}
    return [fit for fit in fits if fit.devices & names]
