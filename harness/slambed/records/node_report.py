# SPDX-License-Identifier: Apache-2.0
"""node.json: the last file that a node writes."""

from slambed.files.json_file import Record


class NodeReport(Record):
    """The fields that the harness reads; all are missing if the node could not write the file."""

    role: str | None = None
    """`mobile` or `edge`."""
    exit_reason: str | None = None
    """Plain text."""
    stopped: bool | None = None
    """Whether SIGTERM or SIGINT ended it early."""
    messages_refused: int = 0
    """Number of malformed messages; 0 if absent. Each one is also a `warning` event."""
