# SPDX-License-Identifier: Apache-2.0
"""The relay's packet log: every packet with its actual delay."""

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

RECORD = np.dtype(
    [
        ("in_ns", "<i8"),
        ("due_ns", "<i8"),
        ("out_ns", "<i8"),
        ("profile_ns", "<i8"),
        ("queue_bytes", "<u4"),
        ("bytes", "<u4"),
        ("tag", "<u2"),
        ("direction", "u1"),
        ("fate", "u1"),
        ("protocol", "u1"),
        ("padding", "V3"),
    ]
)
"""struct PacketRecord of systems/apps/relay/packet_log.hpp; both must stay in sync."""

PACKET_LOG = "packets.bin"
"""File in the log folder of a link."""
SIDES = ["up", "down"]
ICMP, UDP = 1, 17


def read_packets(path: Path) -> pd.DataFrame:
    """Returns one row per packet, sorted by arrival at the relay; a truncated last record is
    dropped."""
    data = path.read_bytes() if path.exists() else b""
    whole = len(data) // RECORD.itemsize * RECORD.itemsize
    records = np.frombuffer(data[:whole], dtype=RECORD)
    frame = pd.DataFrame({name: records[name] for name in RECORD.names or () if name != "padding"})
    return frame.sort_values("in_ns", kind="stable", ignore_index=True)


def delivered(packets: pd.DataFrame, direction: int) -> pd.DataFrame:
    """Returns the delivered packets of one direction (0 up, 1 down)."""
    return packets[(packets["direction"] == direction) & (packets["fate"] == 0)]


def lateness_ms(packets: pd.DataFrame) -> NDArray[np.float64]:
    """Returns how much later than due each packet was delivered."""
    arrived = packets[packets["fate"] == 0]
    late: NDArray[np.float64] = (arrived["out_ns"] - arrived["due_ns"]).to_numpy() / 1e6
    return late
