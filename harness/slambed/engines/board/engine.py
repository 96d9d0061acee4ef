# SPDX-License-Identifier: Apache-2.0
"""An engine with the mobile node on a board and the edge on this host, by another engine."""

import dataclasses
import json
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import docker
import psutil

from slambed.engines.base import (
    Engine,
    Node,
    NodePlan,
    SegmenterSidecar,
    Sidecar,
    allot_cpus,
    netns,
)
from slambed.engines.board.connection import BoardConnection
from slambed.engines.board.leftovers import note, remove_left, strike_out
from slambed.engines.board.node import BoardNode
from slambed.engines.board.shipping import SEQUENCE, bring_image, bring_sequence, must_be_known
from slambed.engines.board.sidecar import BoardSidecar
from slambed.engines.docker import OUTPUT
from slambed.engines.this_host import write_start
from slambed.errors import PassingError, SlambedError, environment_error
from slambed.link.probe import measure_base_ms
from slambed.process.cpus import own_cpus
from slambed.records.board import BoardFacts
from slambed.records.manifest import EngineFacts
from slambed.spec.board import RoleHost
from slambed.spec.device import Limits
from slambed.spec.runtime import Runtime
from slambed.spec.system import Role

START_AHEAD_S = 5.0
"""Time to send the start time to the board, over ssh and its Docker."""


class BoardEngine:
    """Runs edges with the engine `here` and mobile nodes on a board, until `close`."""

    unprivileged = False
    start_ahead_s = START_AHEAD_S

    def __init__(
        self,
        here: Engine,
        role: RoleHost,
        client: docker.DockerClient | None,
        notify: Callable[[str], None],
    ) -> None:
        """`client`: this host's Docker, whose image may be copied; None without Docker."""
        self.name = here.name
        self._here = here
        self._role = role
        self._client = client
        self._notify = notify
        self._connection: BoardConnection | None = None
        self._image: Any = None
        self._volumes: dict[Path, str] = {}
        self._node: BoardNode | None = None
        self._sidecar: BoardSidecar | None = None
        if here.unprivileged:
            raise environment_error(
                f"a mobile node on board {role.called} needs root here, for the RTT probe; run the "
                "same command with sudo"
            )
        self._connection = self._joined()
        seen = self._connection.seen
        self.board = self._connection.board
        notify(
            f"board {role.called}: {len(seen.cpus)} CPUs ({seen.model}, {seen.architecture}), "
            f"RTT {self._rtt_ms:.2f} ms; nothing limits the mobile node there, and nothing is "
            "added to the network"
        )

    def _joined(self) -> BoardConnection:
        """Returns a connection to the checked and cleaned board."""
        connection = BoardConnection(self._role)
        try:
            if found := remove_left(connection.docker, connection.name):
                self._notify(
                    f"board {connection.name}: removed what a killed campaign left: {found}"
                )
            strike_out(self._role)
            must_be_known(connection)
            self._image, self._volumes = None, {}
            self.edge_address = _edge_address(connection)
            self._rtt_ms = measure_base_ms(netns(os.getpid()), connection.seen.own_address)
            if not self._rtt_ms > 0:
                raise environment_error(
                    f"board {connection.name}: no ICMP echo comes back from "
                    f"{connection.seen.own_address}, so the RTT cannot be measured; let it through"
                )
            note(self._role)
            return connection
        except BaseException:
            connection.close()
            raise

    @property
    def connection(self) -> BoardConnection:
        """Connection to the board; reconnects if it was lost."""
        if self._connection is None or not self._connection.alive():
            if self._connection is not None:
                self._connection.close()
            self._connection = None
            self._connection = self._joined()
            seen = self._connection.seen
            now = (seen.architecture, seen.model, len(seen.cpus))
            if now != (self.board.architecture, self.board.model, self.board.cores):
                raise environment_error(f"board {self._role.called} came back as another one")
        return self._connection

    def bring(self, sequence: Path) -> None:
        """Makes sure that image and sequence are on the board."""
        connection = self.connection
        if self._image is None:
            self._image = bring_image(connection, self._client, self._notify)
        if sequence not in self._volumes:
            self._volumes[sequence] = bring_sequence(
                connection, self._image, sequence, self._notify
            )

    def sequence_path(self, sequence: Path, role: Role) -> str:
        """Path on the node's machine."""
        return SEQUENCE if role == "mobile" else self._here.sequence_path(sequence, role)

    def output_path(self, run_dir: Path, role: Role) -> str:
        """Path on the node's machine."""
        return OUTPUT if role == "mobile" else self._here.output_path(run_dir, role)

    def describe(self) -> EngineFacts:
        """Returns facts of the edge's engine; the board's image is among the facts of the board."""
        return self._here.describe()

    def image_ids(self, runtime: Runtime, system: str) -> dict[str, str]:
        """Raises SlambedError: boards do not support systems with their own programs."""
        raise SlambedError(f"system {system} is a program of its own, which no board executes yet")

    def allot(self, limits: dict[Role, Limits]) -> dict[Role, list[int]]:
        """Returns all CPUs of the board for the mobile node; the edge uses this host."""
        found: dict[Role, list[int]] = {"mobile": self.connection.seen.cpus}
        if (edge := limits.get("edge")) is not None:
            found["edge"] = allot_cpus(edge, edge, own_cpus())["edge"]
        return found

    def start(self, plan: NodePlan) -> Node:
        """Starts a node at the start barrier."""
        if plan.role == "edge":
            # The edge must be in the host's network namespace, which is reachable from outside;
            # that namespace outlives it, so it needs no other protection when it is killed.
            return self._here.start(dataclasses.replace(plan, host_network=True, dies=False))
        self._sidecar = None
        self.bring(plan.sequence)
        volume = self._volumes[plan.sequence]
        network = json.loads((plan.run_dir / "run.json").read_text())["network"] or {"ports": {}}
        ports = sorted(network["ports"].values())
        self._node = BoardNode(self.connection, str(self._image.id), volume, plan, ports)
        return self._node

    def start_again(self, plan: NodePlan, dead: Node) -> Node:
        """Restarts the edge."""
        return self._here.start_again(dataclasses.replace(plan, host_network=True), dead)

    def start_segmenter(self, plan: NodePlan, edge: Node, network: str) -> SegmenterSidecar:
        """Starts a segmenter next to the edge."""
        return self._here.start_segmenter(plan, edge, network)

    def sidecar_command(
        self, module: str, writable: list[Path], readable: Sequence[Path] = ()
    ) -> list[str]:
        """Returns the command for a sidecar on this host."""
        return self._here.sidecar_command(module, writable, readable)

    def start_sidecar(
        self,
        nodes: dict[Role, Node],
        limits: dict[Role, Limits],
        cpus: dict[Role, list[int]],
        run_dir: Path,
        whole_groups: bool,
    ) -> Sidecar:
        """Starts the edge's sidecar on this host and the mobile node's on the board."""
        edge: dict[Role, Node] = {role: n for role, n in nodes.items() if role == "edge"}
        own = {role: cpus[role] for role in edge}
        here = self._here.start_sidecar(
            edge, {role: limits[role] for role in edge}, own, run_dir, whole_groups
        )
        self._sidecar = BoardSidecar(here, self.connection, run_dir)
        return self._sidecar

    def send_start(self, run_dir: Path, t0_ns: int) -> None:
        """Sends the start to both nodes, each in its own clock. Raises PassingError if the board
        received it too late."""
        assert self._node is not None and self._sidecar is not None
        assert self._sidecar.clocks is not None, "the sidecar begins first"
        self._node.send_start(t0_ns + self._sidecar.clocks.before.offset_ns)
        write_start(run_dir, t0_ns)
        if (late_s := (time.monotonic_ns() - t0_ns) / 1e9) > 0:
            raise PassingError(f"board {self._role.called} heard of the start {late_s:.1f} s late")

    def board_facts(self) -> BoardFacts | None:
        """Returns facts about the board, and about its clock during the run."""
        connection, sidecar = self.connection, self._sidecar
        seen = connection.seen
        return BoardFacts(
            **self.board.model_dump(),
            address=seen.own_address,
            edge_address=self.edge_address,
            kernel=seen.kernel,
            docker=str(connection.docker.version()["Version"]),
            image_id=str(self._image.id),
            clocks=None if sidecar is None else sidecar.clocks,
            sampler_cpu_percent=None if sidecar is None else sidecar.sampler_cpu_percent,
            tcp=seen.tcp,
        )

    def alive(self) -> bool:
        """Returns whether the board is reachable."""
        return self._connection is not None and self._connection.alive()

    @property
    def address(self) -> str:
        """Address of the board."""
        return self.connection.seen.own_address

    def close(self) -> None:
        """Restores the board, but keeps image and sequences there. An error is only told: the
        results are there, and the record of the board stays."""
        if self._connection is None:
            return
        try:
            if self._connection.alive():
                remove_left(self._connection.docker, self._connection.name)
                strike_out(self._role)
        except SlambedError as error:
            self._notify(f"not cleaned, the next campaign does it: {error}")
        finally:
            self._connection.close()
            self._connection = None


def _edge_address(connection: BoardConnection) -> str:
    """Returns the address at which the board reaches this machine."""
    seen, asked = connection.seen, connection.role.edge_address
    ours = {item.address for items in psutil.net_if_addrs().values() for item in items}
    if ":" in seen.own_address or not seen.own_address:
        raise environment_error(
            f"board {connection.name}: ssh came to it by {seen.own_address or 'no address'}, but "
            "the link is IPv4; name its IPv4 address as host"
        )
    if (found := asked or seen.from_address) not in ours:
        raise environment_error(
            f"board {connection.name} would look for the edge at {found}, which is no address of "
            "this machine; give roles.mobile.edge_address"
        )
    return found
