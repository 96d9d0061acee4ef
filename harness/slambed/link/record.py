# SPDX-License-Identifier: Apache-2.0
"""The results of a link: its log and its proof."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.link.facts import LinkDetails, LinkFacts
from slambed.link.proof import LinkProof

SERIES = [
    "asked_rtt_ms", "applied_up_ms", "applied_down_ms", "probe_rtt_ms", "probe_error_ms",
    "drops_up", "drops_down", "queue_bytes_up", "queue_bytes_down",
    "lost_up", "lost_down",
]  # fmt: skip
"""Series of link.parquet (docs/reference/samples.md)."""
ASKED_STEP_S = 0.1


@dataclass(frozen=True)
class LinkRecord:
    """The results of a link after the run."""

    backend: str
    frame: pd.DataFrame
    """t_s, series, value: the content of link.parquet."""
    drops: dict[str, int]
    """Packets dropped `up` and `down`, intended or not."""
    proof: LinkProof
    """Commanded, applied and measured RTT, with a verdict."""
    died: str | None = None
    """Why the link failed before it was stopped; None when it did not."""
    details: LinkDetails = field(default_factory=LinkDetails)
    """TCP settings, granted priority and counters of the backend."""

    @property
    def facts(self) -> LinkFacts:
        """Returns the facts for the manifest."""
        return LinkFacts(
            backend=self.backend,
            base_rtt_ms=self.details.base_ms,
            drops=self.drops,
            died=self.died,
            proof=self.proof,
            invalid_reason=None if self.proof.valid else self.proof.reason,
            details=self.details,
        )


def series_frame(
    series: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> pd.DataFrame:
    """Returns the long table of link.parquet from (times, values) per series."""
    parts = [
        pd.DataFrame({"t_s": times, "series": name, "value": values})
        for name, (times, values) in series.items()
        if len(times)
    ]
    if not parts:
        return pd.DataFrame({"t_s": [], "series": [], "value": []})
    return pd.concat(parts, ignore_index=True)
