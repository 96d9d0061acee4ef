# SPDX-License-Identifier: Apache-2.0
"""summary.json: the metrics of one run by key, and properties derived from them."""

from pathlib import Path
from typing import Self

from slambed.files.json_file import read_object
from slambed.older_names import METRICS, keys_today, summary_of_today

Value = float | int | bool | str | None


class Summary(dict[str, Value]):
    """A flat dict; its keys, types and units are those of the list of metrics
    (`metrics/catalog.py`)."""

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """Reads a file of any version; None if it is missing or truncated."""
        content = read_object(path)
        return None if content is None else cls(summary_of_today(keys_today(content, METRICS)))

    @property
    def valid(self) -> bool:
        """Whether the run is valid."""
        return self.get("valid") is True

    @property
    def outcome(self) -> str:
        """Outcome of the system."""
        return str(self.get("outcome"))

    @property
    def completed(self) -> bool:
        """Whether the system completed the run."""
        return self.get("outcome") == "completed"

    def text(self, key: str) -> str | None:
        """Returns a text value; None if it is no text."""
        value = self.get(key)
        return value if isinstance(value, str) else None

    def number(self, key: str) -> float | None:
        """Returns a numeric value; None if it was not measured."""
        value = self.get(key)
        return value if isinstance(value, int | float) else None
