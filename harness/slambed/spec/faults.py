# SPDX-License-Identifier: Apache-2.0
"""`faults:` of an experiment: which faults are injected into its runs, and when."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

EdgeFault = Literal["kill", "freeze", "restart"]
FAULT_FILE = "faults.jsonl"
"""File in the raw run folder that records which fault was injected when."""
LASTING = ("freeze", "cut")
"""Faults that end after `for_s`."""
LATEST_S = 100_000.0
"""As long as a link profile may last: a cut becomes a gap of the profile."""


class Fault(BaseModel):
    """One fault at a run time."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    at_s: float = Field(ge=0, le=LATEST_S)
    """Run time at which it begins."""
    edge: EdgeFault | None = None
    """kill: SIGKILL. freeze: SIGSTOP, then SIGCONT after `for_s`; the kernel's TCP stack keeps
    running. restart: the killed program starts again in the same namespace and cgroups. Kill and
    restart are for live engines only."""
    link: Literal["cut"] | None = None
    """No packet arrives for `for_s`, in either direction; also those are dropped that were under
    way. A profile with gaps of its own needs `gap_mode: drop`."""
    for_s: float | None = Field(default=None, gt=0, le=LATEST_S)
    """How long it lasts; of `freeze` and `cut` only, which need it."""

    @model_validator(mode="after")
    def _is_one(self) -> "Fault":
        if (self.edge is None) == (self.link is None):
            raise ValueError("give one of edge (kill, freeze, restart), link (cut)")
        if (self.for_s is None) == (self.kind in LASTING):
            missing = self.for_s is None
            raise ValueError(f"{self.kind} {'needs' if missing else 'has no'} for_s")
        return self

    @property
    def kind(self) -> str:
        """Returns kill, freeze, restart or cut."""
        return str(self.edge or self.link)

    @property
    def target(self) -> str:
        """Returns edge or link."""
        return "edge" if self.edge else "link"

    @property
    def end_s(self) -> float:
        """Run time at which the fault ends; kill and restart end at `at_s`."""
        return self.at_s + (self.for_s or 0.0)


def check_faults(faults: list[Fault]) -> list[Fault]:
    """Returns the list if its faults are possible in this order. Raises ValueError otherwise."""
    if any(later.at_s < earlier.at_s for earlier, later in pairwise(faults)):
        raise ValueError("faults are not in the order of at_s")
    dead = False
    busy_until_s = {"edge": 0.0, "link": 0.0}
    for fault in faults:
        if fault.at_s < busy_until_s[fault.target]:
            state = "frozen" if fault.target == "edge" else "cut"
            until = f"{busy_until_s[fault.target]:g} s"
            raise ValueError(f"{fault.kind} at {fault.at_s:g} s: {state} until {until}")
        if fault.edge is not None and dead != (fault.edge == "restart"):
            raise ValueError(
                f"{fault.kind} at {fault.at_s:g} s: the edge is {'dead' if dead else 'alive'} then"
            )
        dead = fault.edge == "kill" or (dead and fault.edge != "restart")
        busy_until_s[fault.target] = fault.end_s
    return faults


def cuts(faults: list[Fault]) -> list[Fault]:
    """Returns the faults of the link."""
    return [fault for fault in faults if fault.link is not None]


def with_cuts(content: Mapping[str, Any], faults: list[Fault]) -> dict[str, Any]:
    """Returns a profile's content with the cuts as gaps that drop all packets.

    Raises ValueError for a profile whose own gaps only delay packets.
    """
    found = dict(content)
    if cut := cuts(faults):
        own = list(found.get("gaps") or [])
        if own and found.get("gap_mode", "hold") == "hold":
            raise ValueError("a cut drops packets, but the profile's own gaps hold them")
        found["gaps"] = own + [{"start_s": c.at_s, "length_s": c.for_s} for c in cut]
        found["gap_mode"] = "drop"
    return found


def as_json(faults: list[Fault]) -> list[dict[str, Any]]:
    """Returns the faults as they are written to a file."""
    return [fault.model_dump(mode="json", exclude_none=True) for fault in faults]
