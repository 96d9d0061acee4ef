# SPDX-License-Identifier: Apache-2.0
"""What a manifest says about a link."""

from slambed.files.json_file import Record
from slambed.link.proof import LinkProof
from slambed.spec.device import VIRTUAL


class RelayCounters(Record):
    """What slambed-relay counted in one direction, in packets where nothing else is said."""

    bytes: int
    """That came in."""
    delivered: int
    """To the other side."""
    held_bytes_max: int
    """Waiting at once, at most."""
    in_gap: int
    """Dropped because they were under way during a gap."""
    late_us_max: float
    """Written so long after it was due, at most."""
    lost: int
    """Dropped as the profile's loss asks."""
    overflow: int
    """Dropped because the relay held too many."""
    packets: int
    """That came in."""
    queue_full: int
    """Dropped before the rate."""
    write_errors: int
    """That the other side's device refused."""


class KernelDrops(Record):
    """Packets that the kernel dropped at the relay's devices."""

    edge_rx: int
    """Received, at the edge."""
    edge_tx: int
    """Sent, at the edge."""
    mobile_rx: int
    """Received, at the mobile node."""
    mobile_tx: int
    """Sent, at the mobile node."""


class RelaySummary(Record):
    """What slambed-relay leaves as `relay_summary.json`; empty where it could not."""

    down: RelayCounters | None = None
    """Edge to mobile."""
    kernel_drops: KernelDrops | None = None
    """At its devices."""
    real_time: bool | None = None
    """Whether it got real-time priority."""
    seed: int | None = None
    """Of losses and jitter."""
    up: RelayCounters | None = None
    """Mobile to edge."""


class LinkDetails(Record):
    """Of a backend, in its own terms."""

    real_time: bool | None = None
    """Relay: whether it got real-time priority."""
    kernel_drops: int | None = None
    """Relay: of all devices."""
    relay: RelaySummary | None = None
    """Relay: its own counters, from its start on."""
    carried_bytes: dict[str, int] | None = None
    """Relay: the nodes' own packets that arrived `up` and `down`, IP headers and acknowledgments
    included."""
    updates: int | None = None
    """Netem: how often the delay was set."""
    longest_step_ms: float | None = None
    """Netem: between two of them."""
    tcp: dict[str, dict[str, str]] | None = None
    """TCP settings of each node's kernel, by their names in /proc/sys."""
    base_ms: float | None = None
    """RTT of the path before anything was added to it."""


class LinkFacts(Record):
    """The manifest's `link`."""

    backend: str | None = None
    """Null where nobody knew any more."""
    base_rtt_ms: float | None = None
    """RTT of the path before anything was added to it."""
    drops: dict[str, int] | None = None
    """Packets dropped `up` and `down`, on purpose or not; null in a virtual run."""
    died: str | None = None
    """Why the link went away before it was stopped; null when it did not."""
    proof: LinkProof | None = None
    """Asked against measured RTT; null in a virtual run."""
    invalid_reason: str | None = None
    """Why this is not the link that was asked for."""
    details: LinkDetails = LinkDetails()
    """Of the backend, in its own terms."""

    @staticmethod
    def virtual() -> "LinkFacts":
        """Of a modeled link: it is what was asked for, and nothing is proved."""
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
        """Of a link whose keeper took all it knew with it."""
        return LinkFacts(
            backend=None,
            base_rtt_ms=None,
            drops=None,
            died=why,
            proof=None,
            invalid_reason=f"the link went away: {why}",
            details=LinkDetails(),
        )
