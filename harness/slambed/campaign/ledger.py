# SPDX-License-Identifier: Apache-2.0
"""The history of a campaign: one JSON object per line, appended and synced to disk.

The run folders define which runs exist; the ledger reports how they came about.
"""

import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any


def utc_now() -> str:
    """ISO 8601, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


class Ledger:
    """Reads and appends to ledger.jsonl."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def append(self, event: str, **fields: Any) -> None:
        """Appends one line and syncs it to disk."""
        line = json.dumps({"time_utc": utc_now(), "event": event, "pid": os.getpid(), **fields})
        with self.path.open("ab") as out:
            if out.tell() > 0 and not self._ends_with_newline():
                out.write(b"\n")  # Keeps the partial line of a killed writer separate.
            out.write(line.encode() + b"\n")
            out.flush()
            os.fsync(out.fileno())

    def read(self) -> list[dict[str, Any]]:
        """Returns all complete lines; a truncated one is skipped."""
        entries: list[dict[str, Any]] = []
        if not self.path.exists():
            return entries
        for line in self.path.read_text(errors="replace").splitlines():
            try:
                entry = json.loads(line)
            except ValueError:
                continue
            if isinstance(entry, dict) and "event" in entry:
                entries.append(entry)
        return entries

    def attempts(self, run_key: str) -> int:
        """Returns how often a run was started."""
        return sum(
            1 for e in self.read() if e["event"] == "run_started" and e.get("run_key") == run_key
        )

    def _ends_with_newline(self) -> bool:
        with self.path.open("rb") as handle:
            handle.seek(-1, os.SEEK_END)
            return handle.read(1) == b"\n"
