# SPDX-License-Identifier: Apache-2.0
"""What the lint finds."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One mistake: where (an id, or a part of the file) and what."""

    where: str
    what: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}"
