# SPDX-License-Identifier: Apache-2.0
"""The history of a campaign: one JSON object per line, appended and flushed to disk.

The run folders are the truth about what exists; the ledger reports how it came about.
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
    """Appends to ledger.jsonl."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def append(self, event: str, **fields: Any) -> None:
        """One line, on disk when this returns."""
        line = json.dumps({"time_utc": utc_now(), "event": event, "pid": os.getpid(), **fields})
        with self.path.open("ab") as out:
            if out.tell() > 0 and not self._ends_with_newline():
                out.write(b"\n")  # A killed writer left half a line: keep it apart.
            out.write(line.encode() + b"\n")
            out.flush()
            os.fsync(out.fileno())

    def read(self) -> list[dict[str, Any]]:
        """All whole lines; a torn one is skipped."""
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
        """How often a run was started."""
        return sum(
            1 for e in self.read() if e["event"] == "run_started" and e.get("run_key") == run_key
        )

    def _ends_with_newline(self) -> bool:
        with self.path.open("rb") as handle:
            handle.seek(-1, os.SEEK_END)
            return handle.read(1) == b"\n"
