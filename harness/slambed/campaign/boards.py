# SPDX-License-Identifier: Apache-2.0
"""Live runs whose mobile node is on a real board: connection, data and link."""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import docker
import numpy as np

from slambed.campaign.executors import Played
from slambed.engines.base import Engine
from slambed.engines.board.connection import BoardConnection
from slambed.engines.board.engine import BoardEngine
from slambed.engines.board.leftovers import clean_boards
from slambed.engines.docker_image import connect
from slambed.errors import SlambedError
from slambed.link.facts import LinkDetails, LinkFacts
from slambed.link.probe import Probe, measure_base_ms
from slambed.link.record import series_frame
from slambed.spec.board import NETWORK, Board, RoleHost
from slambed.spec.run_spec import RunSpec

PROBE_HZ = 20.0
LAST_ECHO_S = 0.5


def take_board(here: Engine, role: RoleHost, notify: Callable[[str], None]) -> BoardEngine:
    """Returns the engine for such runs after removing what killed campaigns left on boards.
    Raises a one-line SlambedError for an unreachable or unsuitable board."""
    client: docker.DockerClient | None = None
    with contextlib.suppress(SlambedError):  # without Docker there is no image to copy
        client = connect()
    engine = BoardEngine(here, role, client, notify)
    clean_boards(notify, but=role)
    return engine


def look_at_board(role: RoleHost) -> Board:
    """Returns the board's facts without locking it or cleaning up."""
    connection = BoardConnection(role, alone=False)
    try:
        return connection.board
    finally:
        connection.close()


def bring_sequences(engine: BoardEngine, played: Played) -> None:
    """Copies the sequences before the first run: a copy takes longer than a run may wait."""
    for sequence, _ in played.values():
        engine.bring(sequence)


@dataclass
class BoardLinks:
    """The unmodified network between this machine and the board. There is no link proof, but the
    RTT is measured with kernel timestamps, as on every link."""

    engine: BoardEngine

    def __call__(
        self, spec: RunSpec, mobile_ns: Path, edge_ns: Path, log_dir: Path, longest_s: float
    ) -> "BoardLink":
        """Opens the link of one run."""
        return BoardLink(self.engine, edge_ns, log_dir)


class BoardLink:
    """The network to the board during one run."""

    def __init__(self, engine: BoardEngine, edge_ns: Path, log_dir: Path) -> None:
        self._engine = engine
        self._log_dir = log_dir
        self._base_ms = measure_base_ms(edge_ns, engine.address)
        self._probe = Probe(edge_ns, engine.address, PROBE_HZ)
        self._t0_ns = time.monotonic_ns()
        self._facts: LinkFacts | None = None

    def start(self, t0_ns: int) -> None:
        """Sets run time 0 on CLOCK_MONOTONIC."""
        self._t0_ns = t0_ns
        self._probe.start()

    def alive(self) -> bool:
        """Returns False once the board is unreachable."""
        return self._engine.alive()

    def stop(self) -> LinkFacts:
        """Writes the measured RTTs and returns the facts; calling it again returns the same
        facts."""
        if self._facts is None:
            echoes = self._probe.stop(LAST_ECHO_S)
            back = np.isfinite(echoes.rtt_ms)
            sent_s = (echoes.sent_ns[back] - self._t0_ns) / 1e9
            frame = series_frame({"probe_rtt_ms": (sent_s, echoes.rtt_ms[back])})
            frame.to_parquet(self._log_dir / "link.parquet")
            details = LinkDetails(base_ms=self._base_ms)
            base_ms = self._base_ms if np.isfinite(self._base_ms) else None
            self._facts = LinkFacts(backend=NETWORK, base_rtt_ms=base_ms, details=details)
        return self._facts
