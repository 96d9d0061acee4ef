# SPDX-License-Identifier: Apache-2.0
"""The names that a mapping may use: systems, datasets, profiles, devices and metrics of this
checkout."""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

from slambed.files.yaml_source import load_yaml
from slambed.metrics.catalog import SUMMARY_KEYS
from slambed.metrics.tracking import Tracking
from slambed.metrics.update_round import PART_FIELDS
from slambed.papers.fits import read_fits
from slambed.spec.library import Library
from slambed.spec.system import System

SPECIAL_KEYS = ("rmse_vs_reference_live_m",)
"""Computed when runs are compared, because they need a second run."""
DELAYS = (*PART_FIELDS, "T_Total", "T_Computed")


@dataclass(frozen=True)
class Checkout:
    """The files of one checkout that papers/*/paper.yaml refer to."""

    library: Library

    @cached_property
    def systems(self) -> dict[str, System]:
        return {name: self.library.system(name) for name in self.library.systems()}

    @cached_property
    def datasets(self) -> set[str]:
        """Returns the names in catalog/datasets/."""
        return self._stems("catalog/datasets")

    @cached_property
    def profiles(self) -> set[str]:
        """Returns the names in netem_profiles/, and `rtt_0`, which experiments make from a
        constant."""
        return self._stems("netem_profiles") | {"rtt_0"}

    @cached_property
    def devices(self) -> set[str]:
        """Returns the names in catalog/devices/, and of devices that experiments derive from
        them."""
        found = set(self.library.devices())
        for path in sorted((self.root / "experiments").glob("*.yaml")):
            content = _yaml(path)
            for system in content.get("systems") or []:
                changes = (system.get("devices") or {}).values() if isinstance(system, dict) else ()
                found |= {str(c["name"]) for c in changes if isinstance(c, dict) and "name" in c}
        return found

    @cached_property
    def keys(self) -> set[str]:
        """Returns all metric keys that runs can have."""
        own = {key for system in self.systems.values() for key in system.metrics}
        return set(SUMMARY_KEYS) | own | set(SPECIAL_KEYS)

    @cached_property
    def fits(self) -> dict[str, list[str]]:
        """Maps every fit to the patterns of the cells that it was fitted to."""
        found = read_fits(self.root / "catalog" / "devices" / "fits")
        return {fit.name: list(fit.patterns) for fit in found}

    @property
    def root(self) -> Path:
        return self.library.root

    def has_key(self, key: str) -> bool:
        source, _, part = key.partition(".")
        if part and source == "delay":
            return part in DELAYS
        if part and source == "tracking":
            return part in Tracking.__dataclass_fields__ or hasattr(Tracking, part)
        return key in self.keys

    def has_param(self, column: str, systems: set[str] | None = None) -> bool:
        """Returns whether `params.<name>` is a parameter of one of these systems, or of any."""
        name = column.removeprefix("params.")
        chosen = [s for n, s in self.systems.items() if systems is None or n in systems]
        return any(name in system.params for system in chosen)

    def value_of(self, kind: str, name: str, key: str) -> Any:
        """Returns the value at a dotted path of netem_profiles/<name>.yaml or
        catalog/datasets/<name>.yaml; None if there is none."""
        folder = {"profile": "netem_profiles", "dataset": "catalog/datasets"}[kind]
        value: Any = _yaml(self.root / folder / f"{name}.yaml")
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        return value

    def first_of(self, dataset: str) -> list[str]:
        """Returns the sequences of which the first available one is played, or the dataset
        itself."""
        chosen = _yaml(self.root / "catalog" / "datasets" / f"{dataset}.yaml").get("first_of")
        return [str(name) for name in chosen] if isinstance(chosen, list) else [dataset]

    def _stems(self, folder: str) -> set[str]:
        return {path.stem for path in (self.root / folder).glob("*.yaml")}


def fits_any(pattern: str, names: set[str]) -> bool:
    """Returns whether a pattern matches at least one name."""
    return any(fnmatchcase(name, pattern) for name in names)


def _yaml(path: Path) -> dict[str, Any]:
    content = load_yaml(path).data
    return content if isinstance(content, dict) else {}
