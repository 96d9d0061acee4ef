# SPDX-License-Identifier: Apache-2.0
"""State of the TCP connections of a namespace, from the kernel's sock_diag without help of the
node."""

import socket
import struct
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from slambed.process.namespaces import inside

# linux/sock_diag.h, linux/inet_diag.h, linux/netlink.h
NETLINK_SOCK_DIAG = 4
SOCK_DIAG_BY_FAMILY = 20
NLM_F_REQUEST, NLM_F_DUMP = 0x1, 0x300
NLMSG_ERROR, NLMSG_DONE = 2, 3
TCP_ESTABLISHED = 1
INET_DIAG_INFO = 2
_HEADER = struct.Struct("=IHHII")
_ATTRIBUTE = struct.Struct("=HH")
# struct inet_diag_req_v2: family, protocol, extensions, padding, states, socket id of 48 bytes.
_REQUEST = struct.Struct("=BBBxI48x")
DIAG_MESSAGE_BYTES = 72
_PORTS = struct.Struct("!4xHH")
"""struct inet_diag_msg: local port and peer's port."""
# struct tcp_info, linux/tcp.h: 8 bytes, then words of 4 bytes.
LAST_ACK_RECEIVED_OFFSET = 56
RTT_OFFSET = 68
TOTAL_RETRANS_OFFSET = 100
ANSWER_BYTES = 65536
ANSWER_TIMEOUT_S = 0.5


@dataclass(frozen=True)
class TcpState:
    """State of all established connections together."""

    rtt_ms: float
    """tcpi_rtt of the connection with the most recent ACK."""
    retransmits: int
    """Sum over the connections."""


class TcpWatch:
    """Queries the kernel about the connections of one network namespace."""

    def __init__(self, namespace: Path | None, ports: Collection[int] | None = None) -> None:
        """`namespace` None is this process's own. `ports` restricts the result to connections
        with these peer ports, for a namespace that also has unrelated connections."""
        self._socket = _open() if namespace is None else inside(namespace, _open)
        self._ports = ports
        self._sequence = 0

    def read(self) -> TcpState | None:
        """Returns None while no connection is established."""
        self._sequence += 1
        extensions = 1 << (INET_DIAG_INFO - 1)
        body = _REQUEST.pack(socket.AF_INET, socket.IPPROTO_TCP, extensions, 1 << TCP_ESTABLISHED)
        size = _HEADER.size + len(body)
        flags = NLM_F_REQUEST | NLM_F_DUMP
        head = _HEADER.pack(size, SOCK_DIAG_BY_FAMILY, flags, self._sequence, 0)
        found: list[bytes] = []
        try:
            self._socket.send(head + body)
            while not self._take(self._socket.recv(ANSWER_BYTES), found):
                pass
        except OSError:
            return None
        return newest(found)

    def _take(self, answer: bytes, found: list[bytes]) -> bool:
        """Collects tcp_info of each connection; returns True at the end of the dump."""
        place = 0
        while place + _HEADER.size <= len(answer):
            size, kind, _, sequence, _ = _HEADER.unpack_from(answer, place)
            if sequence == self._sequence and kind in (NLMSG_DONE, NLMSG_ERROR):
                return True
            if sequence == self._sequence and kind == SOCK_DIAG_BY_FAMILY:
                message = answer[place + _HEADER.size : place + size]
                if self._ports is None or _PORTS.unpack_from(message)[1] in self._ports:
                    found += _infos(message[DIAG_MESSAGE_BYTES:])
            place += (size + 3) & ~3
        return False

    def close(self) -> None:
        self._socket.close()


def _open() -> socket.socket:
    asked = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, NETLINK_SOCK_DIAG)
    asked.settimeout(ANSWER_TIMEOUT_S)
    return asked


def _infos(attributes: bytes) -> list[bytes]:
    found = []
    place = 0
    while place + _ATTRIBUTE.size <= len(attributes):
        size, kind = _ATTRIBUTE.unpack_from(attributes, place)
        if size < _ATTRIBUTE.size:
            break
        if kind == INET_DIAG_INFO:
            found.append(attributes[place + _ATTRIBUTE.size : place + size])
        place += (size + 3) & ~3
    return found


def newest(infos: list[bytes]) -> TcpState | None:
    """Uses the connection with the most recent ACK: an idle one keeps an outdated RTT."""
    long_enough = [info for info in infos if len(info) >= TOTAL_RETRANS_OFFSET + 4]
    if not long_enough:
        return None

    def word(info: bytes, offset: int) -> int:
        return int(struct.unpack_from("=I", info, offset)[0])

    last = min(long_enough, key=lambda info: word(info, LAST_ACK_RECEIVED_OFFSET))
    return TcpState(
        rtt_ms=word(last, RTT_OFFSET) / 1e3,
        retransmits=sum(word(info, TOTAL_RETRANS_OFFSET) for info in long_enough),
    )
