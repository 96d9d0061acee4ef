# SPDX-License-Identifier: Apache-2.0
"""What is segmented in a run: by which network, and for virtual runs the masks that stand for it
(docs/explanation/masks.md)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from pydantic import BaseModel, ConfigDict

from slambed.errors import SlambedError
from slambed.segment import TRUTH
from slambed.segment.network import load_network
from slambed.spec.system import Scalar, System


@dataclass(frozen=True)
class MasksAsked:
    """What masks hang on besides the sequence."""

    network: str
    quality: int
    n_m: float

    @classmethod
    def of(cls, system: System, params: Mapping[str, Scalar], label: str) -> Self | None:
        """What a system with these parameters wants; None where it segments nothing.

        Raises SlambedError for a network that is not known, and for the truth under another name:
        whoever reads a table must see it."""
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
        """This, and the same with each other threshold that a system which adapts may ask for."""
        table = str(params.get("table_n_m", "")) if params.get("adapt") else ""
        asked = dict.fromkeys([self.n_m, *map(float, table.split())])
        return [replace(self, n_m=n_m) for n_m in asked]


class Masks(BaseModel):
    """The masks of a run: the network that made them and, once they are made, their file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    network: str
    n_m: float
    path: str = ""
    key: str = ""
    """What the file was made of; path and key are in no run key, the content is."""
    sha256: str = ""
    """Of the file; in live runs, which have none, of the network's."""

    def meaning(self) -> dict[str, Any]:
        """What of them a run means."""
        return {"network": self.network, "n_m": self.n_m, "sha256": self.sha256}
