# SPDX-License-Identifier: Apache-2.0
"""Netem settings as raw netlink messages, fast enough to update both ends every 10 ms."""

import array
import ctypes
import errno
import fcntl
import os
import socket
import struct
import threading
from dataclasses import dataclass
from pathlib import Path

from slambed.errors import SlambedError, environment_error
from slambed.process.namespaces import CLONE_NEWNET, inside

# linux/rtnetlink.h, linux/pkt_sched.h
RTM_NEWQDISC = 36
NLM_F_REQUEST, NLM_F_ACK, NLM_F_REPLACE, NLM_F_CREATE = 0x1, 0x4, 0x100, 0x400
NLMSG_ERROR = 2
TC_H_ROOT, HANDLE = 0xFFFFFFFF, 0x10000
TCA_KIND, TCA_OPTIONS = 1, 2
TCA_NETEM_RATE, TCA_NETEM_RATE64, TCA_NETEM_LATENCY64 = 6, 8, 10
LONGEST_U32 = 0xFFFFFFFF
ETHERNET_HEADER_BYTES = 14
# linux/ethtool.h, linux/sockios.h
SIOCETHTOOL, SIOCGIFFLAGS = 0x8946, 0x8913
ETHTOOL_STSO, ETHTOOL_SGSO = 0x1F, 0x24

_HEADER = struct.Struct("=IHHII")
_TC = struct.Struct("=BBHiIII")
_ATTRIBUTE = struct.Struct("=HH")
ANSWER_TIMEOUT_S = 2.0


@dataclass(frozen=True)
class NetemSettings:
    """Parameters of netem."""

    delay_ms: float
    limit_packets: int
    rate_bytes_per_s: int
    """Always set, even if unlimited: with a rate netem keeps packets in order when the delay
    falls."""
    lost: bool = False
    """Drops all packets."""

    def options(self) -> bytes:
        """Returns struct tc_netem_qopt and its attributes."""
        plain = struct.pack("=6I", 0, self.limit_packets, LONGEST_U32 * self.lost, 0, 0, 0)
        short = min(self.rate_bytes_per_s, LONGEST_U32)
        # A veth device has a header that the relay's and the model's packets lack: the rate is one
        # of IP packets everywhere.
        rate = _attribute(TCA_NETEM_RATE, struct.pack("=IiIi", short, -ETHERNET_HEADER_BYTES, 0, 0))
        rate64 = _attribute(TCA_NETEM_RATE64, struct.pack("=Q", self.rate_bytes_per_s))
        latency = _attribute(TCA_NETEM_LATENCY64, struct.pack("=q", round(self.delay_ms * 1e6)))
        return plain + rate + (rate64 if self.rate_bytes_per_s > LONGEST_U32 else b"") + latency


def _attribute(kind: int, payload: bytes) -> bytes:
    size = _ATTRIBUTE.size + len(payload)
    return _ATTRIBUTE.pack(size, kind) + payload + b"\0" * (-size % 4)


class NetemControl:
    """Controls netem of one device through a netlink socket in the device's namespace."""

    def __init__(self, namespace: Path, device: str) -> None:
        self._device = device
        self._namespace = namespace
        self._socket, self._ioctl, self._index = inside(namespace, lambda: _open(device))
        self._sequence = 0

    def set(self, settings: NetemSettings, create: bool = False) -> None:
        """Installs netem as the root qdisc of the device (`create`) or changes its settings."""
        code = self._request(settings, create)
        if code == 0:
            return
        line = f"cannot set netem: {os.strerror(code)}, device {self._device} in {self._namespace}"
        if code == errno.ENOENT and create:
            line = "this kernel has no netem (sch_netem); use link backend relay"
        raise environment_error(line)

    def _request(self, settings: NetemSettings, create: bool) -> int:
        self._sequence += 1
        tc = _TC.pack(0, 0, 0, self._index, HANDLE, TC_H_ROOT, 0)
        kind = _attribute(TCA_KIND, b"netem\0")
        body = tc + kind + _attribute(TCA_OPTIONS, settings.options())
        flags = NLM_F_REQUEST | NLM_F_ACK | (NLM_F_CREATE | NLM_F_REPLACE if create else 0)
        size = _HEADER.size + len(body)
        self._socket.send(_HEADER.pack(size, RTM_NEWQDISC, flags, self._sequence, 0) + body)
        while True:
            try:
                answer = self._socket.recv(8192)
            except TimeoutError:
                return errno.ETIMEDOUT
            _, kind_of, _, sequence, _ = _HEADER.unpack_from(answer)
            if kind_of == NLMSG_ERROR and sequence == self._sequence:
                return -int(struct.unpack_from("=i", answer, _HEADER.size)[0])

    def device_there(self) -> bool:
        """Returns False once the device has gone."""
        try:
            fcntl.ioctl(self._ioctl, SIOCGIFFLAGS, struct.pack("16s24x", self._device.encode()))
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Closes the sockets."""
        self._socket.close()
        self._ioctl.close()


def _open(device: str) -> tuple[socket.socket, socket.socket, int]:
    control = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE)
    control.bind((0, 0))
    control.settimeout(ANSWER_TIMEOUT_S)
    plain = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    return control, plain, socket.if_nametoindex(device)


def without_segmentation_offload(namespace: Path, device: str) -> None:
    """Disables TSO and GSO so that packets have MTU size: rate and queue would handle a 64 KiB
    super-packet as one."""

    def work() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
            for command in (ETHTOOL_STSO, ETHTOOL_SGSO):
                value = array.array("B", struct.pack("=II", command, 0))
                address, _ = value.buffer_info()
                request = struct.pack("16sP16x", device.encode(), address)
                fcntl.ioctl(plain, SIOCETHTOOL, request)

    try:
        inside(namespace, work)
    except OSError as error:
        raise environment_error(
            f"cannot switch offload off: {error.strerror}, device {device}; run as root"
        ) from None


def kernel_has_netem() -> bool:
    """Tests netem on the loopback device of a temporary namespace of a thread."""
    found: list[bool] = []

    def visit() -> None:
        if ctypes.CDLL(None).unshare(CLONE_NEWNET) != 0:
            return
        try:
            control = NetemControl(Path("/proc/thread-self/ns/net"), "lo")
            control.set(NetemSettings(1.0, 1000, 10**9), create=True)
            control.close()
            found.append(True)
        except (SlambedError, OSError):
            return

    thread = threading.Thread(target=visit, name="netem-probe")
    thread.start()
    thread.join()
    return bool(found)
