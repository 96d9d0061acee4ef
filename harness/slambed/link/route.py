# SPDX-License-Identifier: Apache-2.0
"""Route attribute that makes TCP acknowledge every segment immediately.

A delayed ACK adds up to 40 ms to tcpi_rtt, as much as DynNetSLAM's offloading limit, if the
receiving process does not set TCP_QUICKACK in time (the option is not sticky). As a metric of the
route it applies to every connection, whatever the programs do.
"""

from pathlib import Path
from typing import Any

from pyroute2.netlink.exceptions import NetlinkError

from slambed.errors import environment_error
from slambed.link.namespaces import by_netlink

SCOPE_LINK, PROTOCOL_KERNEL = 253, 2


def acknowledge_at_once(namespace: Path, device: str, network: str, address: str) -> None:
    """Sets the quickack metric on the route to the peer."""

    def work(netlink: Any) -> None:
        (index,) = netlink.link_lookup(ifname=device)
        netlink.route(
            "replace",
            dst=network,
            oif=index,
            prefsrc=address,
            scope=SCOPE_LINK,
            proto=PROTOCOL_KERNEL,
            metrics={"quickack": 1},
        )

    try:
        by_netlink(namespace, work)
    except NetlinkError as error:
        raise environment_error(
            f"cannot set the route to {network}: {error}, {namespace}; run as root"
        ) from None
