# SPDX-License-Identifier: Apache-2.0
"""The messages of a run: a table for one's own analysis, and the ones that a full queue dropped."""

from collections import Counter
from pathlib import Path

import pandas as pd

from slambed.errors import SlambedError
from slambed.explain.run_log import NS_PER_S, RunLog
from slambed.files.outputs import writing

NS_PER_MS = 1e6


def messages_of(run: RunLog) -> pd.DataFrame:
    """Returns one row per message in the order of sending: channel, direction (up: mobile to
    edge), type, sequence number, bytes, run times in s at which it was queued, sent and received,
    how long it waited for its channel and how long it was under way in ms, and whether it was
    dropped."""
    found = run.of("message").reindex(
        columns=["channel", "direction", "message", "sequence", "bytes", "queued_ns", "sent_ns",
                 "received_ns", "dropped"]
    )  # fmt: skip
    queued, sent, received = (
        pd.to_numeric(found[f"{when}_ns"]) for when in ("queued", "sent", "received")
    )
    table = pd.DataFrame(
        {
            "channel": found["channel"],
            "direction": found["direction"],
            "message": found["message"],
            "sequence": found["sequence"].astype("Int64"),
            "bytes": found["bytes"].astype("Int64"),
            "queued_s": queued / NS_PER_S,
            "sent_s": sent / NS_PER_S,
            "received_s": received / NS_PER_S,
            "waited_ms": (sent - queued) / NS_PER_MS,
            "under_way_ms": (received - sent) / NS_PER_MS,
            "dropped": found["dropped"].eq(True),
        }
    )
    return table.sort_values(["queued_s", "channel", "sequence"], kind="stable")


def write_messages(run: RunLog, path: Path) -> str:
    """Writes the table as CSV; returns a line about it."""
    if path.suffix != ".csv":
        raise SlambedError(f"unknown table format {path}; known: .csv")
    table = messages_of(run)
    if not len(table):
        raise SlambedError(f"no messages in {run.folder}: its system sends none, or has no edge")
    with writing(path, "--messages"):
        table.to_csv(path, index=False, float_format="%.6f")
    dropped = int(table["dropped"].sum())
    return f"{len(table)} messages, {dropped} of them dropped: {path}"


def dropped_lines(run: RunLog) -> list[str]:
    """Returns a line per channel and node whose full queue dropped messages."""
    messages = run.of("message")
    if "dropped" not in messages:
        return []
    lines = []
    of_all = Counter(zip(messages["channel"], messages["direction"], strict=True))
    dropped = messages[messages["dropped"].eq(True)]
    for (channel, direction, node), own in dropped.groupby(["channel", "direction", "node"]):
        # The receiver writes every message but those that the sender's queue did not take.
        side = "send" if own["sent_ns"].isna().all() else "receive"
        lines.append(
            f"{len(own)} of {of_all[(channel, direction)]} messages of channel {channel} "
            f"({direction}) dropped: the {side} queue of the {node} node was full"
        )
    return lines
