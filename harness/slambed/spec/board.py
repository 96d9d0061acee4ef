# SPDX-License-Identifier: Apache-2.0
"""`roles:` of an experiment: a mobile node that runs on a real board:
docs/how-to/use-a-real-board.md."""

from ipaddress import AddressValueError, IPv4Address
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from slambed.files.names import Address, Name
from slambed.spec.device import Device, Limits

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True)
NETWORK = "network"
"""Link backend of a run on a board: the real network between the two machines, unmodified."""


def _ipv4(text: str) -> str:
    try:
        return str(IPv4Address(text))
    except AddressValueError:
        raise ValueError(f"'{text}' is no IPv4 address") from None


class RoleHost(BaseModel):
    """Another machine that a node runs on."""

    model_config = STRICT

    host: Address
    """The board's SSH address: `user@machine`, `ssh://user@machine:port`, or an alias."""
    over: Literal["ssh"] = "ssh"
    """How the harness reaches the board's Docker daemon."""
    name: Name | None = None
    """Name of the board in tables; `host` when not given."""
    ssh: list[str] = Field(default_factory=list)
    """Further arguments of the ssh command, such as `-p` and a port."""
    edge_address: Annotated[str, AfterValidator(_ipv4)] | None = None
    """IPv4 address of this machine at which the board reaches the edge. Null takes the address
    that the board's ssh connection used."""

    @property
    def called(self) -> str:
        """Name of the board in tables, manifests and messages."""
        return self.name or self.host


class Roles(BaseModel):
    """The nodes that run on another machine."""

    model_config = STRICT

    mobile: RoleHost
    """The board that runs the mobile node."""


class Board(BaseModel):
    """The machine that executes the mobile node of a run: the facts that enter the run key."""

    model_config = STRICT

    name: str
    """Name in the experiment's file."""
    architecture: str = ""
    """Architecture as the kernel reports it, such as aarch64 or x86_64; empty until the board
    has been contacted."""
    model: str = ""
    """Model of the board, or of its CPU where the board reports no model."""
    cores: int = 0
    """Number of online CPUs."""

    def meaning(self) -> dict[str, Any]:
        """Part of the run key: a result of one board is no result of another."""
        return self.model_dump(mode="json")

    @property
    def device(self) -> Device:
        """The board as the run's mobile device, without limits."""
        hardware = f"{self.model}, {self.cores} cores, {self.architecture}"
        return Device(
            name=self.name,
            title=f"Board {self.name}",
            limits=Limits(),
            hardware=hardware if self.cores else "",
        )
