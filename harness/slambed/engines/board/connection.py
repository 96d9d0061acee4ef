# SPDX-License-Identifier: Apache-2.0
"""Connection to a board: ssh with the agent on the board, and its Docker daemon over the same
connection."""

import contextlib
import socket
import struct
import tempfile
import time
from pathlib import Path
from typing import TypeVar

import docker

from slambed.engines.board.agent import ECHO
from slambed.engines.board.agent_source import agent_source
from slambed.engines.board.dial import DialStdio
from slambed.engines.board.messages import (
    AskClock,
    ClockReading,
    Echo,
    Echoing,
    Lock,
    Locked,
    Look,
    Seen,
)
from slambed.engines.docker_errors import DAEMON_ERRORS
from slambed.errors import KilledError, PassingError, SlambedError, environment_error
from slambed.link.clocks import ClockComparison, Exchange, compare_by
from slambed.process.line_protocol import LineProcess, Message
from slambed.spec.board import Board, RoleHost

ASKED_EVERY_S, UNANSWERED = 5, 3
SSH = (
    "ssh", "-T", "-o", "BatchMode=yes", "-o", "ConnectTimeout=15",
    "-o", f"ServerAliveInterval={ASKED_EVERY_S}", "-o", f"ServerAliveCountMax={UNANSWERED}",
)  # fmt: skip
"""Never prompts, and closes the connection after a board has been silent for 15 s."""
FIRST_ANSWER_S = 45.0
ANSWER_S = 30.0
DOCKER_S = 60
LAST_S = ASKED_EVERY_S * (UNANSWERED + 1.0)
"""Time from the end of the Docker stream until ssh notices a board without power."""
DATAGRAM_S = 0.25
"""Longer than the RTT of any network used for offloaded SLAM."""
DATAGRAM_TRIES = 4
END_S = 5.0
A = TypeVar("A", bound=Message)


class BoardConnection:
    """Holds the connection until `close`. Raises a SlambedError with the board's name if it does
    not answer, has no Docker, or is in use by another campaign."""

    def __init__(self, role: RoleHost, alone: bool = True) -> None:
        """`alone`: takes the board's lock; not needed to only query its facts."""
        self.role = role
        self.name = role.called
        self._folder = tempfile.TemporaryDirectory(prefix="slambed-board-")
        self._place = Path(self._folder.name)
        self._errors = self._place / "ssh.txt"
        self._process: LineProcess | None = None
        self._dial: DialStdio | None = None
        self._clock_socket: socket.socket | None = None
        try:
            control = ["-o", f"ControlPath={self._place}/ssh"]
            agent = f"exec python3 -c '{agent_source()}'"
            first = [*SSH, *control, "-o", "ControlMaster=yes", *role.ssh, "--", role.host, agent]
            self._process = LineProcess(first, "board", self._errors)
            self.seen = self._look()
            # Multiplexed over the same connection, which saves the handshakes.
            dial = [*SSH, *control, *role.ssh, "--", role.host, "docker system dial-stdio"]
            self._dial = DialStdio(self._place / "docker.sock", dial, self._place / "docker.txt")
            self.docker = self.client()
            self._check_docker()
            if alone and not self.ask(Lock(), Locked).ours:
                raise environment_error(
                    f"board {self.name}: another live campaign runs there; stop it, or wait for it"
                )
        except BaseException:
            self.close()
            raise

    @property
    def board(self) -> Board:
        """Returns the board as used in run keys."""
        seen = self.seen
        return Board(
            name=self.name,
            architecture=seen.architecture,
            model=seen.model,
            cores=len(seen.cpus),
        )

    @property
    def docker_url(self) -> str:
        """URL of its Docker daemon, for DOCKER_HOST."""
        assert self._dial is not None
        return self._dial.url

    def client(self) -> docker.DockerClient:
        """Returns a client of its Docker daemon, for one thread."""
        return docker.DockerClient(self.docker_url, version="1.40", timeout=DOCKER_S)

    def alive(self) -> bool:
        """Returns False once the connection has ended."""
        return self._process is not None and self._process.alive()

    def must_live(self, patience_s: float = 0.0) -> None:
        """Raises KilledError once the connection has ended. `patience_s`: how long to wait for
        that after a Docker failure, which may be noticed first."""
        deadline = time.monotonic() + patience_s
        while self.alive() and time.monotonic() < deadline:
            time.sleep(0.05)
        if not self.alive():
            raise KilledError(self.gone())

    def gone(self) -> str:
        """Returns one line about the lost board."""
        words = self._last_words(self._errors)
        return f"board {self.name} is gone" + (f": {words}" if words else "")

    def ask(self, request: Message, kind: type[A], timeout_s: float = ANSWER_S) -> A:
        """Returns the agent's answer."""
        if self._process is None:
            raise KilledError(self.gone())
        try:
            return self._process.ask(request, kind, timeout_s)
        except PassingError:
            self.must_live()
            raise

    def compare_clocks(self) -> ClockComparison:
        """Compares its clock with ours by UDP datagrams, or through ssh if none comes back."""
        if self._clock_socket is None:
            self._clock_socket = self._open_clock()
        if any(self._by_datagram(self._clock_socket) for _ in range(DATAGRAM_TRIES)):
            clock = self._clock_socket
            return compare_by(lambda: self._by_datagram(clock), "udp")
        return compare_by(self._by_ssh, "ssh")

    def _open_clock(self) -> socket.socket:
        address = self.seen.own_address
        port = self.ask(Echo(address=address), Echoing).port
        clock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        clock.connect((address, port))
        return clock

    @staticmethod
    def _by_datagram(clock: socket.socket) -> Exchange | None:
        number = time.monotonic_ns()
        deadline = time.monotonic() + DATAGRAM_S
        with contextlib.suppress(OSError):  # no answer in time, or no listener
            clock.send(struct.pack("!Q", number))
            while (left := deadline - time.monotonic()) > 0:
                clock.settimeout(left)
                data = clock.recv(64)
                back_ns = time.monotonic_ns()
                if len(data) == ECHO.size and (reading := ECHO.unpack(data))[0] == number:
                    # The number is also the send time.
                    return Exchange(number, reading[1], reading[2], back_ns)
        return None

    def _by_ssh(self) -> Exchange | None:
        sent_ns = time.monotonic_ns()
        reading = self.ask(AskClock(), ClockReading)
        return Exchange(sent_ns, reading.received_ns, reading.answered_ns, time.monotonic_ns())

    def _look(self) -> Seen:
        assert self._process is not None
        try:
            return self._process.ask(Look(), Seen, FIRST_ANSWER_S)
        except SlambedError as error:
            words = self._last_words(self._errors) or str(error)
            if "python3" in words and "not found" in words:
                words = "there is no python3, which samples and clock need; install it there"
            raise PassingError(f"board {self.name} does not answer: {words}") from None

    def _check_docker(self) -> None:
        try:
            self.docker.ping()
        except DAEMON_ERRORS as error:
            words = self._last_words(self._place / "docker.txt") or str(error).splitlines()[0]
            raise environment_error(
                f"board {self.name} has no Docker that answers: {words}; install docker there and "
                "put its user in the group docker"
            ) from None

    @staticmethod
    def _last_words(path: Path) -> str:
        try:
            lines = path.read_text(errors="replace").strip().splitlines()
        except OSError:
            return ""
        return lines[-1].strip().removeprefix("error: ") if lines else ""

    def close(self) -> None:
        """Ends the agent and all connections; safe to call twice."""
        if self._clock_socket is not None:
            self._clock_socket.close()
            self._clock_socket = None
        if self._dial is not None:
            self._dial.close()
        if self._process is not None:
            self._process.close(END_S)
        with contextlib.suppress(OSError):
            if self._place.is_dir():
                self._folder.cleanup()
