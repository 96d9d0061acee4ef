# SPDX-License-Identifier: Apache-2.0
"""A veth pair between two namespaces, and the backend none, which uses only that pair."""

import contextlib
import os
from pathlib import Path
from typing import Any

from pyroute2.netlink.exceptions import NetlinkError

from slambed.errors import SlambedError, environment_error
from slambed.link.facts import LinkDetails
from slambed.link.namespaces import by_netlink
from slambed.link.netlink import NetemControl, without_segmentation_offload
from slambed.link.profile import Profile
from slambed.link.proof import ExtraDelays
from slambed.link.session import (
    DEVICE,
    EDGE_ADDRESS,
    MOBILE_ADDRESS,
    PREFIX_LENGTH,
    LinkOptions,
    ShaperReport,
)
from slambed.process.namespaces import inside


class VethPair:
    """Two devices, one per namespace, up and with addresses."""

    def __init__(self, mobile: Path, edge: Path, options: LinkOptions) -> None:
        self._mobile = mobile
        fd = os.open(edge, os.O_RDONLY | os.O_CLOEXEC)
        try:
            peer = {"ifname": DEVICE, "net_ns_fd": fd}
            by_netlink(mobile, lambda n: n.link("add", ifname=DEVICE, kind="veth", peer=peer))
        except NetlinkError as error:
            raise environment_error(
                f"cannot make the veth pair {DEVICE}: {error}; remove a device of that name"
            ) from None
        finally:
            os.close(fd)
        try:
            for namespace, address in ((mobile, MOBILE_ADDRESS), (edge, EDGE_ADDRESS)):
                _no_ipv6(namespace)
                self._bring_up(namespace, address, options)
                without_segmentation_offload(namespace, DEVICE)
        except BaseException:
            self.remove()
            raise

    @staticmethod
    def _bring_up(namespace: Path, address: str, options: LinkOptions) -> None:
        def work(netlink: Any) -> None:
            (index,) = netlink.link_lookup(ifname=DEVICE)
            netlink.link("set", index=index, mtu=options.mtu, txqlen=options.tx_queue_packets)
            netlink.addr("add", index=index, address=address, prefixlen=PREFIX_LENGTH)
            netlink.link("set", index=index, state="up")

        by_netlink(namespace, work)

    def remove(self) -> None:
        """Removes the pair; deleting one end removes both."""

        def work(netlink: Any) -> None:
            for index in netlink.link_lookup(ifname=DEVICE):
                netlink.link("del", index=index)

        # The namespace or the device may already be gone.
        with contextlib.suppress(NetlinkError, OSError, SlambedError):
            by_netlink(self._mobile, work)


def _no_ipv6(namespace: Path) -> None:
    def work() -> None:
        with contextlib.suppress(OSError):
            Path(f"/proc/sys/net/ipv6/conf/{DEVICE}/disable_ipv6").write_text("1", "ascii")

    inside(namespace, work)


class PlainShaper:
    """Backend none: a veth pair without impairments, as a control for comparisons."""

    name = "none"

    def __init__(
        self, mobile: Path, edge: Path, profile: Profile, seed: int, log_dir: Path, o: LinkOptions
    ) -> None:
        self._pair = VethPair(mobile, edge, o)
        # Each holds its namespace: the pair would go with that of a node that has ended.
        self._ends: list[NetemControl] = []
        try:
            for namespace in (mobile, edge):
                self._ends.append(NetemControl(namespace, DEVICE))
        except BaseException:
            self.abort()
            raise

    def apply(self) -> None:
        """Does nothing."""

    def start(self, t0_ns: int) -> None:
        """Does nothing."""

    def died(self) -> str | None:
        """Returns None while the device exists."""
        there = all(end.device_there() for end in self._ends)
        return None if there else f"device {DEVICE} went away"

    def stop(self, t0_ns: int) -> ShaperReport:
        """Removes the pair."""
        self.abort()
        return ShaperReport(
            {}, {"up": 0, "down": 0}, lambda e: ExtraDelays.none(len(e)), None, LinkDetails()
        )

    def abort(self) -> None:
        """Removes the pair."""
        for end in self._ends:
            end.close()
        self._pair.remove()
