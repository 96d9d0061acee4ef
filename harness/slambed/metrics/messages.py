# SPDX-License-Identifier: Apache-2.0
"""The messages of a run as a table."""

import pandas as pd

NS_PER_S = 1e9
NS_PER_MS = 1e6


def messages_of(events: pd.DataFrame) -> pd.DataFrame:
    """Returns one row per event `message` in the order of sending: channel, direction (up: mobile
    to edge), type, sequence number, bytes, run times in s at which it was queued, sent and
    received, how long it waited for its channel and how long it was under way in ms, and whether it
    was dropped."""
    found = events.reindex(
        columns=["channel", "direction", "message", "sequence", "bytes", "queued_ns", "sent_ns",
                 "received_ns", "dropped"]
    )  # fmt: skip
    # Another program's events may have anything where a number belongs.
    queued, sent, received, sequence, size = (
        pd.to_numeric(found[name], errors="coerce")
        for name in ("queued_ns", "sent_ns", "received_ns", "sequence", "bytes")
    )
    table = pd.DataFrame(
        {
            "channel": found["channel"],
            "direction": found["direction"],
            "message": found["message"],
            "sequence": sequence.where(sequence % 1 == 0).astype("Int64"),
            "bytes": size.where(size % 1 == 0).astype("Int64"),
            "queued_s": queued / NS_PER_S,
            "sent_s": sent / NS_PER_S,
            "received_s": received / NS_PER_S,
            "waited_ms": (sent - queued) / NS_PER_MS,
            "under_way_ms": (received - sent) / NS_PER_MS,
            "dropped": found["dropped"].eq(True),
        }
    )
    return table.sort_values(["queued_s", "channel", "sequence"], kind="stable")
