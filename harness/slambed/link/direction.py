# SPDX-License-Identifier: Apache-2.0
"""A link as slambed-relay and slambed-sim read it: they have the same model."""

from typing import Literal

from slambed.files.json_file import Record


class JitterConfig(Record):
    """What is added to the delay of each packet; packets stay in order."""

    shape: str
    """`normal` or `pareto`."""
    scale_us: float
    """`normal`: standard deviation; `pareto`: mean."""
    pareto_shape: float
    """`pareto`: tail index, smaller = heavier."""
    max_us: float
    """Where it is cut off; 0: nowhere."""
    correlation: float
    """Between one packet and the next."""
    correlation_time_s: float
    """Instead, by time: exp(-dt / this); 0: not by time."""


class LossConfig(Record):
    """A chain of a good and a bad state, in time or one step per packet. Independent loss is the
    chain that stays in its good state."""

    good_s: float | None = None
    """In time: mean length of the good state."""
    bad_s: float | None = None
    """In time: mean length of the bad state."""
    to_bad: float | None = None
    """Per packet: probability of good to bad."""
    to_good: float | None = None
    """Per packet: probability of bad to good."""
    loss_good: float
    """Share of packets that are lost in the good state."""
    loss_bad: float
    """Share of packets that are lost in the bad state."""


class RateConfig(Record):
    """The bottleneck."""

    queue_bytes: int
    """What may wait before it."""
    opportunities_ms: list[int] | None = None
    """Of a trace: when a packet may leave; repeats from its start."""
    bits_per_s: float | None = None
    """Else: constant."""


class DirectionConfig(Record):
    """One direction; what is left out does nothing."""

    delay_us: list[float]
    """One-way delay at 0, `step_ms`, 2 `step_ms` ...; the last one for ever."""
    jitter: JitterConfig | None = None
    """What is added to it, drawn per packet."""
    loss: LossConfig | None = None
    """What is dropped at random."""
    rate: RateConfig | None = None
    """The bottleneck before the delay."""
    gaps_s: list[tuple[float, float]] | None = None
    """Begin and end of each time in which nothing arrives."""
    gap_drops: int | None = None
    """With gaps: 1 drops what is under way, 0 holds it back."""


class ModeledLink(Record):
    """Both directions, from run time 0 on."""

    step_ms: float
    """Between two values of the delays."""
    interpolation: str
    """`linear`: between two of them."""
    up: DirectionConfig
    """Mobile to edge."""
    down: DirectionConfig
    """Edge to mobile."""


class RelayEnd(Record):
    """One of the two devices that slambed-relay makes."""

    namespace: str
    """File of the network namespace."""
    device: str
    """Its name there."""
    address: str
    """IPv4."""


class RelayConfig(Record):
    """relay.json: what slambed-relay is to do. It refuses keys that it does not know."""

    format: Literal["slambed-link"]
    """Of the file."""
    version: Literal[1]
    """Of the format."""
    mobile: RelayEnd
    """Of the mobile node."""
    edge: RelayEnd
    """Of the edge."""
    prefix_length: int
    """Of both addresses."""
    mtu: int
    """Largest packet in bytes, IP header included."""
    tx_queue_packets: int
    """That the kernel keeps for a device at most."""
    seed: int
    """Of losses and jitter."""
    step_ms: float
    """Between two values of the delays."""
    interpolation: str
    """`linear`: between two of them."""
    up: DirectionConfig
    """Mobile to edge; as `link.up` in `sim.json`."""
    down: DirectionConfig
    """Edge to mobile."""
    spin_us: float
    """How long before a packet is due the relay wakes and polls."""
    fifo_priority: int
    """Of SCHED_FIFO, where that is permitted; 0: not asked for."""
    parent_pid: int
    """The process with which it ends."""
    packet_log: str
    """File: a record per packet."""
    summary: str
    """File: its counters, written at its end."""
