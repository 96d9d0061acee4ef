# SPDX-License-Identifier: Apache-2.0
"""Problems that the lint reports."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One problem: where (an id, or a part of the file) and what."""

    where: str
    what: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}"
