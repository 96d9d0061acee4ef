# SPDX-License-Identifier: Apache-2.0
"""`roles:` of an experiment: a mobile node that runs on a real board:
docs/how-to/use-a-real-board.md."""

from ipaddress import AddressValueError, IPv4Address
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from slambed.spec.device import Device, Limits

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True)
NETWORK = "network"
"""Link backend of such a run: what lies between the two machines, as it is."""


def _ipv4(text: str) -> str:
    try:
        return str(IPv4Address(text))
    except AddressValueError:
        raise ValueError(f"'{text}' is no IPv4 address") from None


class RoleHost(BaseModel):
    """The machine that a node runs on, instead of this one."""

    model_config = STRICT

    host: Annotated[str, Field(pattern=r"^[^-\s]\S*$")]
    """Where ssh finds it: `user@machine`, `ssh://user@machine:port`, an alias."""
    over: Literal["ssh"] = "ssh"
    """How its Docker is reached."""
    name: str | None = Field(default=None, pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")
    """What tables call it; `host` when not given."""
    ssh: list[str] = Field(default_factory=list)
    """Further words for the ssh command, such as `-p` and a port."""
    edge_address: Annotated[str, AfterValidator(_ipv4)] | None = None
    """IPv4 address of this machine at which the board finds the edge; null: that which its ssh
    connection came from."""

    @property
    def called(self) -> str:
        """Its name in tables, manifests and messages."""
        return self.name or self.host


class Roles(BaseModel):
    """Which nodes run on another machine than this one."""

    model_config = STRICT

    mobile: RoleHost
    """The board."""


class Board(BaseModel):
    """The machine that executes the mobile node of a run, as far as the run means it."""

    model_config = STRICT

    name: str
    """In the experiment's file."""
    architecture: str = ""
    """As its kernel names it: aarch64, x86_64. Empty until somebody has looked."""
    model: str = ""
    """Of the board, or of its CPU where it names no board."""
    cores: int = 0
    """CPUs that are online."""

    def meaning(self) -> dict[str, Any]:
        """Part of a run's key: what one board did is no result of another."""
        return self.model_dump(mode="json")

    @property
    def device(self) -> Device:
        """The mobile device of such a run: itself, without limits."""
        hardware = f"{self.model}, {self.cores} cores, {self.architecture}"
        return Device(
            name=self.name,
            title=f"Board {self.name}",
            limits=Limits(),
            hardware=hardware if self.cores else "",
        )
