# SPDX-License-Identifier: Apache-2.0
"""CPU, memory and throttling of a node over playback, from the sampler's counters."""

from dataclasses import dataclass

import numpy as np
import pandas as pd


@dataclass(frozen=True)
class Resources:
    """CPU in percent of one core; memory in MB; None where the counters were missing."""

    cpu_percent_mean: float | None
    cpu_percent_p50: float | None
    cpu_percent_p95: float | None
    memory_mb_peak: float | None
    throttled_ms: float | None
    throttled_share: float | None


NOTHING = Resources(None, None, None, None, None, None)


def resources_of(samples: pd.DataFrame, node: str, end_s: float | None) -> Resources:
    """Of one node from run time 0 to `end_s`; CPU by the cumulative counter, not by averaging."""
    if samples.empty or "node" not in samples:
        return NOTHING
    own = samples[(samples["node"] == node) & (samples["t_s"] >= 0)]
    if end_s is not None:
        own = own[own["t_s"] <= end_s]
    own = own.sort_values("t_s", kind="stable")
    percent = _column(own, "cpu_percent")
    memory = _column(own, "memory_mb")
    throttled = _increase(own, "throttled_s")
    span = _span(own)
    cpu = _increase(own, "cpu_s")
    return Resources(
        cpu_percent_mean=100.0 * cpu / span if cpu is not None and span else None,
        cpu_percent_p50=float(np.quantile(percent, 0.5)) if len(percent) else None,
        cpu_percent_p95=float(np.quantile(percent, 0.95)) if len(percent) else None,
        memory_mb_peak=float(memory.max()) if len(memory) else None,
        throttled_ms=1e3 * throttled if throttled is not None else None,
        throttled_share=throttled / span if throttled is not None and span else None,
    )


def _column(own: pd.DataFrame, name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    if name not in own:
        return np.zeros(0)
    return own[name].dropna().to_numpy(np.float64)


def _increase(own: pd.DataFrame, name: str) -> float | None:
    values = _column(own, name)
    return float(values[-1] - values[0]) if len(values) > 1 else None


def _span(own: pd.DataFrame) -> float | None:
    if len(own) < 2:
        return None
    return float(own["t_s"].iloc[-1] - own["t_s"].iloc[0]) or None
