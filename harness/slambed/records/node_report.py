# SPDX-License-Identifier: Apache-2.0
"""node.json: the last thing that a node writes."""

from slambed.files.json_file import Record


class NodeReport(Record):
    """What the harness reads of it; a node that could not write it says nothing."""

    role: str | None = None
    """`mobile` or `edge`."""
    exit_reason: str | None = None
    """In words."""
    stopped: bool | None = None
    """Whether SIGTERM or SIGINT ended it early."""
    messages_refused: int = 0
    """Messages that it could not read; absent: none. Each is a `warning` event, too."""
