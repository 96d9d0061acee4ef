# SPDX-License-Identifier: Apache-2.0
"""Common to both engines of this host: both nodes and their clock are here."""

import json
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

from slambed.engines.base import Node, Sidecar, allot_cpus
from slambed.engines.result import NETWORK_EDGE_ADDRESS, START_AHEAD_S
from slambed.engines.sidecar_client import SidecarClient
from slambed.files.atomic import replacing
from slambed.process.cpus import own_cpus
from slambed.records.board import BoardFacts
from slambed.spec.device import Limits
from slambed.spec.system import Role


def write_start(run_dir: Path, t0_ns: int) -> None:
    """Writes `start.json`, which the nodes of this host wait for."""
    with replacing(run_dir / "start.json") as start:
        start.write_text(json.dumps({"t0_ns": t0_ns}))
        start.chmod(0o644)


class ThisHostEngine(ABC):
    """An engine whose nodes are all on this host."""

    unprivileged = False
    edge_address = NETWORK_EDGE_ADDRESS
    start_ahead_s = START_AHEAD_S

    @abstractmethod
    def sidecar_command(
        self, module: str, writable: list[Path], readable: Sequence[Path] = ()
    ) -> list[str]:
        """See `Engine`."""

    def allot(self, limits: dict[Role, Limits]) -> dict[Role, list[int]]:
        """Returns CPUs of this host."""
        host = own_cpus()
        return allot_cpus(limits["mobile"], limits.get("edge"), host)

    def start_sidecar(
        self,
        nodes: dict[Role, Node],
        limits: dict[Role, Limits],
        cpus: dict[Role, list[int]],
        run_dir: Path,
        whole_groups: bool,
    ) -> Sidecar:
        """Starts a process on this host."""
        return SidecarClient(self, nodes, limits, cpus, run_dir, whole_groups)

    def send_start(self, run_dir: Path, t0_ns: int) -> None:
        """Writes one file for all nodes."""
        write_start(run_dir, t0_ns)

    def board_facts(self) -> BoardFacts | None:
        """Returns None."""
        return None
