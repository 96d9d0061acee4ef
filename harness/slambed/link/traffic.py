# SPDX-License-Identifier: Apache-2.0
"""Traffic for link measurements: one-way UDP, a TCP connection that reports its RTT, and floods."""

import contextlib
import select
import socket
import struct
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slambed.link.probe import (
    ANCILLARY_BYTES,
    MSG_ERRQUEUE,
    SO_TIMESTAMPING,
    STAMP_FLAGS,
    sent_stamp,
    software_stamp,
)
from slambed.process.namespaces import inside

ONE_WAY_PORT, ECHO_PORT, FLOOD_PORT, UDP_PORT = 47091, 47092, 47093, 47094
TCPI_RTT_OFFSET = 68
"""struct tcp_info, linux/tcp.h: 8 bytes, then 15 words of 4 bytes before tcpi_rtt [us]."""
NS = 1_000_000_000
FLOOD_BURST = 100
SO_RCVBUFFORCE = 33  # asm-generic/socket.h: may exceed net.core.rmem_max
NUMBER = struct.Struct("!I")


@dataclass(frozen=True)
class Flood:
    """Numbered packets sent at full speed."""

    received: int
    reordered: int
    """Packets that arrived after one that was sent later."""
    seconds: float


@dataclass(frozen=True)
class OneWaySamples:
    """Packets of one direction."""

    sent_ns: NDArray[np.int64]
    """CLOCK_MONOTONIC."""
    delay_ms: NDArray[np.float64]
    """From kernel timestamps; NaN for a lost packet."""
    reordered: int
    """Packets that came after one sent later."""


def one_way(
    source: Path, target: Path, address: str, rate_hz: float, seconds: float, size: int = 64
) -> OneWaySamples:
    """Sends numbered packets and returns their one-way delays; both ends share this host's
    clock."""
    sender = inside(source, lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    receiver = inside(target, lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    sent: dict[int, int] = {}
    received: dict[int, int] = {}
    order: list[int] = []
    with sender, receiver:
        for each in (sender, receiver):
            each.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, STAMP_FLAGS)
            each.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
            each.setblocking(False)
        receiver.bind((address, ONE_WAY_PORT))
        start = time.monotonic()
        count = int(seconds * rate_hz)
        for number in range(count):
            _take_one_way(sender, receiver, start + number / rate_hz, sent, received, order)
            packet = NUMBER.pack(number).ljust(size, b"\0")
            sender.sendto(packet, (address, ONE_WAY_PORT))
        _take_one_way(sender, receiver, time.monotonic() + 1.0, sent, received, order)
    to_monotonic = time.clock_gettime_ns(time.CLOCK_MONOTONIC) - time.clock_gettime_ns(
        time.CLOCK_REALTIME
    )
    numbers = sorted(sent)
    delays = [(received[n] - sent[n]) / 1e6 if n in received else np.nan for n in numbers]
    highest = np.maximum.accumulate(np.array(order or [0]))
    return OneWaySamples(
        sent_ns=np.array([sent[n] for n in numbers], dtype=np.int64) + to_monotonic,
        delay_ms=np.array(delays, dtype=float),
        reordered=int(np.count_nonzero(np.array(order or [0]) < highest)),
    )


def _take_one_way(
    sender: socket.socket,
    receiver: socket.socket,
    until_s: float,
    sent: dict[int, int],
    received: dict[int, int],
    order: list[int],
) -> None:
    poller = select.poll()
    poller.register(receiver, select.POLLIN)
    poller.register(sender, select.POLLERR)
    while True:
        left = until_s - time.monotonic()
        if not poller.poll(max(0.0, left * 1e3)):
            return
        with contextlib.suppress(OSError):
            while True:
                _, ancillary, _, _ = sender.recvmsg(2048, ANCILLARY_BYTES, MSG_ERRQUEUE)
                number, stamp = sent_stamp(ancillary)
                sent[number] = stamp
        with contextlib.suppress(OSError):
            while True:
                packet, ancillary, _, _ = receiver.recvmsg(2048, ANCILLARY_BYTES)
                # OPT_TSONLY removes the data only from the error queue; the receiver gets the
                # payload.
                (number,) = NUMBER.unpack_from(packet)
                received[number] = software_stamp(ancillary)
                order.append(number)
        if left <= 0:
            return


class TcpRttProbe:
    """A TCP connection with a small echo every 100 ms, which records the kernel's tcpi_rtt."""

    def __init__(self, mobile: Path, edge: Path, edge_address: str, rate_hz: float = 10.0) -> None:
        self._server = inside(edge, lambda: socket.create_server((edge_address, ECHO_PORT)))
        self._client = inside(
            mobile, lambda: socket.create_connection((edge_address, ECHO_PORT), timeout=10)
        )
        self._peer, _ = self._server.accept()
        for each in (self._client, self._peer):
            each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            each.settimeout(0.2)
        self._interval_s = 1.0 / rate_hz
        self._stopped = threading.Event()
        self.samples: list[tuple[int, float]] = []
        """(CLOCK_MONOTONIC ns, tcpi_rtt ms)."""
        self._threads = [
            threading.Thread(target=self._echo, daemon=True),
            threading.Thread(target=self._ask, daemon=True),
        ]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stopped.set()
        for thread in self._threads:
            thread.join()
        for each in (self._client, self._peer, self._server):
            each.close()

    def _echo(self) -> None:
        while not self._stopped.is_set():
            with contextlib.suppress(TimeoutError):
                self._peer.sendall(self._peer.recv(4096))

    def _ask(self) -> None:
        due = time.monotonic()
        while not self._stopped.is_set():
            self._client.sendall(bytes(64))
            due += self._interval_s
            self._stopped.wait(max(0.0, due - time.monotonic()))
            with contextlib.suppress(TimeoutError):
                self._client.recv(4096)
            info = self._client.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
            (rtt_us,) = struct.unpack_from("=I", info, TCPI_RTT_OFFSET)
            self.samples.append((time.monotonic_ns(), rtt_us / 1e3))


def tcp_throughput_mbps(
    source: Path, target: Path, address: str, seconds: float, skip_s: float = 0.5
) -> float:
    """Measures the goodput of one TCP connection, without the first `skip_s`."""
    server = inside(target, lambda: socket.create_server((address, FLOOD_PORT)))
    client = inside(source, lambda: socket.create_connection((address, FLOOD_PORT), timeout=10))
    peer, _ = server.accept()
    stopped = threading.Event()

    def flood() -> None:
        block = bytes(1 << 20)
        with contextlib.suppress(OSError):
            while not stopped.is_set():
                client.sendall(block)

    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    start = time.monotonic()
    counted = 0
    began = ended = start
    try:
        while (ended := time.monotonic()) < start + seconds:
            size = len(peer.recv(1 << 20))
            if ended < start + skip_s:
                began = ended
                continue
            counted += size
    finally:
        stopped.set()
        for each in (peer, client, server):
            each.close()
        thread.join()
    return counted * 8 / (ended - began) / 1e6


def udp_flood(source: Path, target: Path, address: str, count: int, size: int = 200) -> Flood:
    """Sends `count` numbered packets in bursts; reports how many came out of order."""
    sender = inside(source, lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    receiver = inside(target, lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    receiver.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 64 << 20)
    receiver.bind((address, UDP_PORT))
    receiver.settimeout(1.0)
    order: list[int] = []

    def take() -> None:
        with contextlib.suppress(TimeoutError):
            while len(order) < count:
                order.append(NUMBER.unpack_from(receiver.recv(2048))[0])

    with sender, receiver:
        thread = threading.Thread(target=take, daemon=True)
        start = time.monotonic()
        thread.start()
        for number in range(count):
            with contextlib.suppress(BlockingIOError):
                sender.sendto(NUMBER.pack(number).ljust(size, b"\0"), (address, UDP_PORT))
            # Lets the receiving thread run; the socket buffer holds the packets in between.
            if number % FLOOD_BURST == 0:
                time.sleep(0.002)
        thread.join()
    numbers = np.array(order or [0])
    late = np.count_nonzero(numbers < np.maximum.accumulate(numbers))
    return Flood(len(order), int(late), time.monotonic() - start)
