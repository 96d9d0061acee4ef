# SPDX-License-Identifier: Apache-2.0
"""CPU, memory and throttling of a node over playback, from the sampler's counters."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Resources:
    """CPU in percent of one core; memory in MiB; None if the counters were missing."""

    cpu_percent_mean: float | None
    memory_mb_peak: float | None
    memory_mb_mean: float | None
    memory_mb_per_min: float | None
    """Slope of the least-squares line through the samples."""
    throttled_ms: float | None
    throttled_share: float | None
    cpu_wait_share: float | None
    """Share of the time in which its threads were runnable within their limits that they spent
    waiting, for other processes or for each other."""
    cpu_wait_ms: float | None
    """The same as a time, summed over all threads."""


NOTHING = Resources(None, None, None, None, None, None, None, None)


def resources_of(samples: pd.DataFrame, node: str, end_s: float | None) -> Resources:
    """Evaluates one node from run time 0 to `end_s`; the mean CPU use comes from the cumulative
    counter."""
    if samples.empty or "node" not in samples:
        return NOTHING
    own = _Rows(samples, node, end_s)
    memory = own.column("memory_mb")
    throttled = own.increase("throttled_s")
    span, cpu = own.span_s(), own.increase("cpu_s")
    waited = _waited_s(own.increase("run_delay_s"), throttled)
    return Resources(
        cpu_percent_mean=100.0 * cpu / span if cpu is not None and span else None,
        memory_mb_peak=float(memory.max()) if len(memory) else None,
        memory_mb_mean=float(memory.mean()) if len(memory) else None,
        memory_mb_per_min=own.slope_per_min("memory_mb"),
        throttled_ms=1e3 * throttled if throttled is not None else None,
        throttled_share=throttled / span if throttled is not None and span else None,
        cpu_wait_share=None if waited is None or not cpu else waited / (waited + cpu),
        cpu_wait_ms=1e3 * waited if waited is not None else None,
    )


def _waited_s(delay_s: float | None, throttled_s: float | None) -> float | None:
    """On most kernels the delay includes throttling, which is caused by the limits and not by
    the host."""
    return None if delay_s is None else max(0.0, delay_s - (throttled_s or 0.0))


class _Rows:
    """The samples of one node over playback, sorted by time, by column."""

    def __init__(self, samples: pd.DataFrame, node: str, end_s: float | None) -> None:
        t_s = samples["t_s"].to_numpy(np.float64)
        inside = (samples["node"] == node).to_numpy(bool) & (t_s >= 0)
        if end_s is not None:
            inside &= t_s <= end_s
        rows = np.flatnonzero(inside)
        self._samples = samples
        self._rows = rows[np.argsort(t_s[rows], kind="stable")]
        self._t_s = t_s[self._rows]

    def column(self, name: str) -> Floats:
        """Returns the measured values of a column."""
        if name not in self._samples:
            return np.zeros(0)
        values = self._samples[name].to_numpy(np.float64)[self._rows]
        measured: Floats = values[~np.isnan(values)]
        return measured

    def slope_per_min(self, name: str) -> float | None:
        """Returns the slope of the least-squares line through the measured values."""
        if name not in self._samples:
            return None
        values = self._samples[name].to_numpy(np.float64)[self._rows]
        there = ~np.isnan(values)
        if there.sum() < 2 or np.ptp(self._t_s[there]) == 0:
            return None
        return 60.0 * float(np.polyfit(self._t_s[there], values[there], 1)[0])

    def increase(self, name: str) -> float | None:
        """Returns the increase of a counter between its first and last sample."""
        values = self.column(name)
        return float(values[-1] - values[0]) if len(values) > 1 else None

    def span_s(self) -> float | None:
        """Returns the time between the first and the last sample."""
        return float(self._t_s[-1] - self._t_s[0]) or None if len(self._t_s) > 1 else None
