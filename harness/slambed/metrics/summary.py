# SPDX-License-Identifier: Apache-2.0
"""summary.json: the numbers of one run by their keys, and what is decided by some of them."""

from pathlib import Path
from typing import Self

from slambed.files.json_file import read_object
from slambed.older_names import METRICS, keys_today, summary_of_today

Value = float | int | bool | str | None


class Summary(dict[str, Value]):
    """Flat; its keys, types and units are those of the list of metrics (`metrics/catalog.py`)."""

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """From a file of any version; None when it is not there or not whole."""
        content = read_object(path)
        return None if content is None else cls(summary_of_today(keys_today(content, METRICS)))

    @property
    def valid(self) -> bool:
        """Whether the run counts."""
        return self.get("valid") is True

    @property
    def outcome(self) -> str:
        """How the system ended."""
        return str(self.get("outcome"))

    @property
    def completed(self) -> bool:
        """Whether the system came to its end."""
        return self.get("outcome") == "completed"

    def text(self, key: str) -> str | None:
        """A value that is words; None without any."""
        value = self.get(key)
        return value if isinstance(value, str) else None

    def number(self, key: str) -> float | None:
        """A value that is a number; None where it was not measured."""
        value = self.get(key)
        return value if isinstance(value, int | float) else None
