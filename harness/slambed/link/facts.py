# SPDX-License-Identifier: Apache-2.0
"""Facts about a link in the manifest."""

from slambed.files.json_file import Record
from slambed.link.proof import LinkProof
from slambed.spec.device import VIRTUAL


class RelayCounters(Record):
    """Counters of slambed-relay for one direction, in packets if no unit is given."""

    bytes: int
    """Bytes received."""
    delivered: int
    """Delivered to the other side."""
    held_bytes_max: int
    """Maximum number of bytes held at the same time."""
    in_gap: int
    """Dropped because they were in flight during an outage."""
    late_us_max: float
    """Maximum time by which a packet was delivered late."""
    lost: int
    """Dropped by the profile's packet loss."""
    overflow: int
    """Dropped because the relay held too many packets."""
    packets: int
    """Packets received."""
    queue_full: int
    """Dropped by the full queue before the rate."""
    write_errors: int
    """Rejected by the other side's device."""


class KernelDrops(Record):
    """Packets dropped by the kernel at the relay's devices."""

    edge_rx: int
    """Receive drops at the edge."""
    edge_tx: int
    """Transmit drops at the edge."""
    mobile_rx: int
    """Receive drops at the mobile node."""
    mobile_tx: int
    """Transmit drops at the mobile node."""


class RelaySummary(Record):
    """The relay's `relay_summary.json`; empty if the relay could not write it."""

    down: RelayCounters | None = None
    """Edge to mobile."""
    kernel_drops: KernelDrops | None = None
    """Kernel drops at its devices."""
    real_time: bool | None = None
    """Whether it got real-time priority."""
    seed: int | None = None
    """Seed of losses and jitter."""
    up: RelayCounters | None = None
    """Mobile to edge."""


class LinkDetails(Record):
    """Details that depend on the backend."""

    real_time: bool | None = None
    """Relay: whether it got real-time priority."""
    kernel_drops: int | None = None
    """Relay: drops over all devices."""
    relay: RelaySummary | None = None
    """Relay: its counters since its start."""
    carried_bytes: dict[str, int] | None = None
    """Relay: bytes of the nodes' packets delivered `up` and `down`, including IP headers and
    ACKs, without the probe's echoes."""
    updates: int | None = None
    """Netem: number of delay updates."""
    longest_step_ms: float | None = None
    """Netem: longest time between two updates."""
    tcp: dict[str, dict[str, str]] | None = None
    """TCP settings of each node's kernel, by name in /proc/sys."""
    base_ms: float | None = None
    """RTT of the path before any delay was added."""


class LinkFacts(Record):
    """The manifest's `link`."""

    backend: str | None = None
    """Null if it is unknown because the link's process died."""
    base_rtt_ms: float | None = None
    """RTT of the path before any delay was added."""
    drops: dict[str, int] | None = None
    """Packets dropped `up` and `down`, intended or not; null in a virtual run."""
    died: str | None = None
    """Why the link failed before it was stopped; null when it did not."""
    proof: LinkProof | None = None
    """Commanded versus measured RTT; null in a virtual run."""
    invalid_reason: str | None = None
    """Why the link did not match its profile."""
    details: LinkDetails = LinkDetails()
    """Details that depend on the backend."""

    @staticmethod
    def virtual() -> "LinkFacts":
        """Returns the facts of a modeled link: exact by construction, so without a proof."""
        return LinkFacts(
            backend=VIRTUAL,
            base_rtt_ms=0.0,
            drops=None,
            died=None,
            proof=None,
            details=LinkDetails(),
        )

    @staticmethod
    def gone(why: str) -> "LinkFacts":
        """Returns the facts of a link whose helper process died and took its log along."""
        return LinkFacts(
            backend=None,
            base_rtt_ms=None,
            drops=None,
            died=why,
            proof=None,
            invalid_reason=f"the link went away: {why}",
            details=LinkDetails(),
        )
