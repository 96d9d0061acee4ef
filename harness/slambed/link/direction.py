# SPDX-License-Identifier: Apache-2.0
"""Link configuration shared by slambed-relay and slambed-sim."""

from typing import Literal

from slambed.files.json_file import Record


class JitterConfig(Record):
    """Random delay added to each packet; packets stay in order."""

    shape: str
    """`normal` or `pareto`."""
    scale_us: float
    """`normal`: standard deviation; `pareto`: mean."""
    pareto_shape: float
    """`pareto`: tail index; a smaller index means a heavier tail."""
    max_us: float
    """Upper limit; 0: none."""
    correlation: float
    """Correlation between successive packets."""
    correlation_time_s: float
    """Time constant of correlation in time, exp(-dt / this); 0: per-packet correlation."""


class LossConfig(Record):
    """A chain of a good and a bad state, in time or with one step per packet. For independent
    loss the chain stays in its good state."""

    good_s: float | None = None
    """In time: mean length of the good state."""
    bad_s: float | None = None
    """In time: mean length of the bad state."""
    to_bad: float | None = None
    """Per packet: transition probability from good to bad."""
    to_good: float | None = None
    """Per packet: transition probability from bad to good."""
    loss_good: float
    """Probability of packet loss in the good state."""
    loss_bad: float
    """Probability of packet loss in the bad state."""


class RateConfig(Record):
    """The bottleneck."""

    queue_bytes: int
    """Size of the queue before it."""
    opportunities_ms: list[int] | None = None
    """For a trace: times at which a packet may leave, repeated from its start."""
    bits_per_s: float | None = None
    """For a constant rate."""


class DirectionConfig(Record):
    """One direction; omitted impairments are off."""

    delay_us: list[float]
    """One-way delay at 0, `step_ms`, 2 `step_ms` ...; the last value holds until the end."""
    jitter: JitterConfig | None = None
    """Random delay added per packet."""
    loss: LossConfig | None = None
    """Random packet loss."""
    rate: RateConfig | None = None
    """Bottleneck rate, applied before the delay."""
    gaps_s: list[tuple[float, float]] | None = None
    """Begin and end of each outage, in which no packet arrives."""
    gap_drops: int | None = None
    """With outages: 1 drops packets in flight, 0 delays them until the end of the outage."""


class ModeledLink(Record):
    """Both directions, from run time 0."""

    step_ms: float
    """Time between two values of the delays."""
    interpolation: str
    """`linear`: between two values of the delays."""
    up: DirectionConfig
    """Mobile to edge."""
    down: DirectionConfig
    """Edge to mobile."""


class RelayEnd(Record):
    """One of the two network devices that slambed-relay creates."""

    namespace: str
    """File of the network namespace."""
    device: str
    """Name of the device in that namespace."""
    address: str
    """IPv4 address."""


class RelayConfig(Record):
    """relay.json: the configuration of slambed-relay. It rejects unknown keys."""

    format: Literal["slambed-link"]
    """Name of the format."""
    version: Literal[1]
    """Version of the format."""
    mobile: RelayEnd
    """Device of the mobile node."""
    edge: RelayEnd
    """Device of the edge."""
    prefix_length: int
    """Prefix length of both addresses."""
    mtu: int
    """Largest packet in bytes, IP header included."""
    tx_queue_packets: int
    """Queue length of each device in the kernel."""
    seed: int
    """Seed of losses and jitter."""
    step_ms: float
    """Time between two values of the delays."""
    interpolation: str
    """`linear`: between two values of the delays."""
    up: DirectionConfig
    """Mobile to edge; as `link.up` in `sim.json`."""
    down: DirectionConfig
    """Edge to mobile."""
    spin_us: float
    """How long before a packet is due the relay wakes up and starts polling."""
    fifo_priority: int
    """SCHED_FIFO priority, if permitted; 0: none."""
    parent_pid: int
    """Process whose end also ends the relay."""
    packet_log: str
    """File with one record per packet."""
    summary: str
    """File with the relay's counters, written when it ends."""
