# SPDX-License-Identifier: Apache-2.0
"""Segmentation of a run: the network and, for virtual runs, its precomputed masks
(docs/explanation/masks.md)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from pydantic import BaseModel, ConfigDict

from slambed.errors import SlambedError
from slambed.files.outputs import is_file
from slambed.segment import TRUTH
from slambed.segment.network import load_network
from slambed.spec.inputs import sha256_of
from slambed.spec.system import Scalar, System


@dataclass(frozen=True)
class MasksAsked:
    """The settings that masks depend on besides the sequence."""

    network: str
    quality: int
    n_m: float

    @classmethod
    def of(cls, system: System, params: Mapping[str, Scalar], label: str) -> Self | None:
        """Returns the masks that a system with these parameters needs; None if it segments nothing.

        Raises SlambedError for an unknown network, and for ground-truth masks whose label does not
        mention them: readers of a table must see that.
        """
        if system.network_param is None or not params[system.network_param]:
            return None
        network = str(params[system.network_param])
        if network != TRUTH:
            load_network(network)
        elif TRUTH not in label.lower():
            raise SlambedError(
                f"masks are the generator's truth, an upper bound: label '{label}' must say "
                f"'{TRUTH}'"
            )
        return cls(network, int(params["jpeg_quality"]), float(params["n_m"]))

    def with_table(self, params: Mapping[str, Scalar]) -> list[Self]:
        """Returns these settings, plus copies for the other thresholds that an adaptive system
        may select."""
        table = str(params.get("table_n_m", "")) if params.get("adapt") else ""
        asked = dict.fromkeys([self.n_m, *map(float, table.split())])
        return [replace(self, n_m=n_m) for n_m in asked]


@lru_cache(maxsize=256)
def _digest(path: str, size: int, mtime_ns: int) -> str:
    """Returns the digest of a file, computed once as long as the file stays as it is."""
    return sha256_of(Path(path))


class Masks(BaseModel):
    """The masks of a run: the network that computes them and, once they exist, their file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    network: str
    n_m: float
    path: str = ""
    key: str = ""
    """Identifies what the file was computed from. Path and key are in no run key; the content
    is."""
    sha256: str = ""
    """Digest of the file; in live runs, which have no file, digest of the network."""

    def must_be_there(self) -> None:
        """Raises SlambedError if the file is gone, or is not the one that the run was planned
        with."""
        if not self.path:
            return  # a live run, which segments by itself
        file = Path(self.path)
        if not is_file(file):
            raise SlambedError(f"{self.path} is gone; start the campaign again, which makes masks")
        now = file.stat()
        if self.sha256 and _digest(self.path, now.st_size, now.st_mtime_ns) != self.sha256:
            raise SlambedError(f"{self.path} has changed since the campaign began; start it again")

    def meaning(self) -> dict[str, Any]:
        """Returns the part of the run key."""
        return {"network": self.network, "n_m": self.n_m, "sha256": self.sha256}
