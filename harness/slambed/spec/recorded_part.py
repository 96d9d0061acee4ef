# SPDX-License-Identifier: Apache-2.0
"""Parts of recordings that link profiles play."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RecordedPart:
    """A recording from `start_s` to its end, `length_s` later; a run plays as much as it lasts."""

    file: str
    start_s: float
    length_s: float

    def __str__(self) -> str:
        return self.file + (f" from {self.start_s:g} s on" if self.start_s else "")
