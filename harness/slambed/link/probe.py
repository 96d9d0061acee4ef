# SPDX-License-Identifier: Apache-2.0
"""Independent RTT measurement for the link proof: ICMP echo with kernel timestamps.

The mobile node's kernel stamps the request before any device queue and the reply on arrival; the
edge's kernel answers. No user-space program is inside the measured interval, so load on the harness
cannot distort it.
"""

import contextlib
import os
import select
import socket
import struct
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slambed.errors import environment_error
from slambed.process.namespaces import inside

# linux/net_tstamp.h, linux/errqueue.h
SO_TIMESTAMPING = 37
RX_SOFTWARE, REPORT_SOFTWARE, TX_SCHED = 1 << 3, 1 << 4, 1 << 8
OPT_ID, OPT_TSONLY = 1 << 7, 1 << 11
# TX_SCHED stamps before the queueing discipline. The plain software stamp comes after it, when
# netem has already delayed the packet.
STAMP_FLAGS = TX_SCHED | RX_SOFTWARE | REPORT_SOFTWARE | OPT_ID | OPT_TSONLY
MSG_ERRQUEUE, IP_RECVERR = 0x2000, 11
_TIMESPEC = struct.Struct("@qq")
_EXTENDED_ERROR = struct.Struct("@IBBBBII")

ECHO_REQUEST, ECHO_REPLY = 8, 0
HEADER = struct.Struct("!BBHHH")
PAYLOAD = bytes(48)
"""76 bytes with headers: negligible at any rate."""
ANCILLARY_BYTES = 512
LARGEST_SEQUENCE = 65_535
OFFSET_TRIES = 3
CLOCK_SET_NS = 1_000_000
"""Clock slewing (0.5 ms per second) moves the offset by less than this during an echo."""


@dataclass(frozen=True)
class Echoes:
    """Echo requests and their RTTs, in order of sending."""

    sequence: NDArray[np.int64]
    sent_ns: NDArray[np.int64]
    """CLOCK_MONOTONIC."""
    rtt_ms: NDArray[np.float64]
    """NaN for a lost echo."""

    def __len__(self) -> int:
        return len(self.sent_ns)


class Pinger:
    """A raw ICMP socket inside a namespace."""

    def __init__(self, namespace: str | Path, target: str) -> None:
        self._target = target
        self._identifier = os.getpid() & 0xFFFF
        self._socket = inside(namespace, _open_socket)
        self._user_sent: dict[int, int] = {}
        self._kernel_sent: dict[int, int] = {}
        self._received: dict[int, int] = {}
        self._offset_sent: dict[int, int] = {}
        self._offset_received: dict[int, int] = {}
        self._next = 0

    def send(self) -> None:
        """Sends one echo request."""
        sequence = self._next % LARGEST_SEQUENCE + 1
        header = HEADER.pack(ECHO_REQUEST, 0, 0, self._identifier, sequence)
        check = _checksum(header + PAYLOAD)
        packet = HEADER.pack(ECHO_REQUEST, 0, check, self._identifier, sequence) + PAYLOAD
        self._user_sent[self._next] = time.clock_gettime_ns(time.CLOCK_REALTIME)
        self._offset_sent[self._next] = to_monotonic_ns()
        self._next += 1
        # A full queue or a missing device: the echo counts as lost.
        with contextlib.suppress(OSError):
            self._socket.sendto(packet, (self._target, 0))

    def collect(self, until_s: float) -> None:
        """Receives replies and timestamps until this time (time.monotonic)."""
        poller = select.poll()
        poller.register(self._socket, select.POLLIN | select.POLLERR)
        while (left := until_s - time.monotonic()) > 0:
            if not poller.poll(left * 1e3):
                return
            self._drain()

    def _drain(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                _, ancillary, _, _ = self._socket.recvmsg(2048, ANCILLARY_BYTES, MSG_ERRQUEUE)
                number, stamp = sent_stamp(ancillary)
                if stamp:
                    self._kernel_sent[number] = stamp
        with contextlib.suppress(OSError):
            while True:
                packet, ancillary, _, _ = self._socket.recvmsg(2048, ANCILLARY_BYTES)
                self._take_reply(packet, software_stamp(ancillary))

    def _take_reply(self, packet: bytes, stamp: int) -> None:
        start = (packet[0] & 0x0F) * 4
        if len(packet) < start + HEADER.size:
            return
        kind, _, _, identifier, sequence = HEADER.unpack_from(packet, start)
        if kind != ECHO_REPLY or identifier != self._identifier or not stamp:
            return
        # The most recent request with this 16-bit number; numbers repeat after 65,535 echoes.
        number = (self._next - 1) - (self._next - sequence) % LARGEST_SEQUENCE
        if number not in self._received:
            self._received[number] = stamp
            self._offset_received[number] = to_monotonic_ns()

    def echoes(self) -> Echoes:
        """Returns all echoes so far."""
        numbers = list(range(self._next))
        sent = [self._kernel_sent.get(n, self._user_sent[n]) for n in numbers]
        rtt = [
            (self._received[n] - stamp + self._set_meanwhile_ns(n)) / 1e6
            if n in self._received
            else np.nan
            for n, stamp in zip(numbers, sent, strict=True)
        ]
        offsets = [self._offset_sent[n] for n in numbers]
        return Echoes(
            sequence=np.array([n % LARGEST_SEQUENCE + 1 for n in numbers], dtype=np.int64),
            sent_ns=np.array(sent, dtype=np.int64) + np.array(offsets, dtype=np.int64),
            rtt_ms=np.array(rtt, dtype=float),
        )

    def _set_meanwhile_ns(self, number: int) -> int:
        """Returns the clock step of CLOCK_REALTIME while an echo was in flight."""
        by_ns = self._offset_received[number] - self._offset_sent[number]
        return by_ns if abs(by_ns) > CLOCK_SET_NS else 0

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()


def to_monotonic_ns() -> int:
    """Returns CLOCK_MONOTONIC - CLOCK_REALTIME, which changes when the clock is set. Takes the
    fastest of a few tries because the process may be preempted between two readings."""
    tries = []
    for _ in range(OFFSET_TRIES):
        before = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
        real = time.clock_gettime_ns(time.CLOCK_REALTIME)
        after = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
        tries.append((after - before, (before + after) // 2 - real))
    return min(tries)[1]


def _open_socket() -> socket.socket:
    try:
        raw = socket.socket(socket.AF_INET, socket.SOCK_RAW | socket.SOCK_NONBLOCK, 1)
    except PermissionError:
        raise environment_error("cannot open a raw socket for the RTT probe; run as root") from None
    raw.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, STAMP_FLAGS)
    return raw


def software_stamp(ancillary: list[tuple[int, int, bytes]]) -> int:
    """Returns the kernel timestamp of a message's ancillary data [ns, CLOCK_REALTIME]; 0 if
    none."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPING:
            seconds, nanoseconds = _TIMESPEC.unpack_from(data)
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return 0


def sent_stamp(ancillary: list[tuple[int, int, bytes]]) -> tuple[int, int]:
    """Returns packet number and send time from the error queue."""
    number = 0
    for level, kind, data in ancillary:
        if level == socket.SOL_IP and kind == IP_RECVERR:
            number = int(_EXTENDED_ERROR.unpack_from(data)[6])
    return number, software_stamp(ancillary)


def _checksum(packet: bytes) -> int:
    total = sum(struct.unpack(f"!{len(packet) // 2}H", packet))
    total = (total >> 16) + (total & 0xFFFF)
    return int(~(total + (total >> 16)) & 0xFFFF)


class Probe:
    """Sends echoes at a constant rate from a thread, from `start` to `stop`."""

    def __init__(self, namespace: str | Path, target: str, rate_hz: float = 20.0) -> None:
        self._pinger = Pinger(namespace, target)
        self._interval_s = 1.0 / rate_hz
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="rtt-probe", daemon=True)

    def start(self) -> None:
        """Starts sending."""
        self._thread.start()

    def stop(self, wait_s: float) -> Echoes:
        """Stops sending, waits for outstanding replies and returns all echoes."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()
            self._pinger.collect(time.monotonic() + wait_s)
        echoes = self._pinger.echoes()
        self._pinger.close()
        return echoes

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopped.is_set():
            self._pinger.send()
            # After a stall of the host the missed echoes are skipped instead of sent in a burst.
            due = max(due + self._interval_s, time.monotonic())
            self._pinger.collect(due)


def measure_base_ms(
    namespace: str | Path, target: str, count: int = 20, interval_s: float = 0.02
) -> float:
    """Returns the current median RTT of the path; NaN without any reply."""
    pinger = Pinger(namespace, target)
    try:
        for _ in range(count):
            pinger.send()
            pinger.collect(time.monotonic() + interval_s)
        rtt = pinger.echoes().rtt_ms
        return float(np.nanmedian(rtt)) if np.isfinite(rtt).any() else float("nan")
    finally:
        pinger.close()
