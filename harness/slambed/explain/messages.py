# SPDX-License-Identifier: Apache-2.0
"""Writes a run's messages for one's own analysis, and tells which ones a full queue dropped."""

from collections import Counter
from pathlib import Path

from slambed.errors import SlambedError
from slambed.explain.run_log import RunLog
from slambed.files.outputs import writing
from slambed.metrics.messages import messages_of


def write_messages(run: RunLog, path: Path) -> str:
    """Writes the table as CSV; returns a line about it."""
    if path.suffix != ".csv":
        raise SlambedError(f"unknown table format {path}; known: .csv")
    table = messages_of(run.of("message"))
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
