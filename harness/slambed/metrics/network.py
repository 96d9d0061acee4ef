# SPDX-License-Identifier: Apache-2.0
"""Traffic over the link, and how accurately the link applied its delay."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.metrics.events import EventLog

Floats = NDArray[np.float64]
MINIMUM_PROBES = 20  # one second of probing; fewer are not significant


RTT_SOURCES = {
    "tcp_info": "smoothed by TCP",
    "echo": "by echo",
    "probe": "by the system's probe",
}
"""How a mobile node knows its RTT, by `source` of the event, in words. The first is that of the
link alone; in the others the edge's program takes part."""
UNKNOWN_SOURCE = "as the mobile node knows it"


@dataclass(frozen=True)
class Traffic:
    """Messages of one type in one direction."""

    channel: str
    direction: str
    message: str
    count: int
    bytes_total: int
    bytes_mean: float
    dropped: int


def traffic(log: EventLog) -> list[Traffic]:
    """Returns bytes per message type, as counted by the receiver."""
    groups: dict[tuple[str, str, str], list[int]] = {}
    dropped: dict[tuple[str, str, str], int] = {}
    for e in log.of("message"):
        key = (str(e.get("channel")), str(e.get("direction")), str(e.get("message")))
        sizes = groups.setdefault(key, [])
        if e.get("dropped"):
            dropped[key] = dropped.get(key, 0) + 1
        elif isinstance(e.get("bytes"), int):
            sizes.append(e["bytes"])
    return [
        Traffic(*key, len(s), sum(s), sum(s) / len(s) if s else 0.0, dropped.get(key, 0))
        for key, s in sorted(groups.items())
    ]


def bytes_moved(log: EventLog) -> dict[str, int | None]:
    """Returns bytes `up` and `down`; None if the log has no messages."""
    table = traffic(log)
    if not table:
        return {"up": None, "down": None}
    return {way: sum(t.bytes_total for t in table if t.direction == way) for way in ("up", "down")}


@dataclass(frozen=True)
class RttFigures:
    """Measured and commanded RTT over playback, in milliseconds; None: not measured."""

    asked_mean: float | None
    measured_mean: float | None
    error_median: float | None
    error_p99: float | None
    probes: int


NO_RTT_FIGURES = RttFigures(None, None, None, None, 0)


def series(link: pd.DataFrame, name: str) -> pd.DataFrame:
    """Returns one series of the link log (t_s, value), sorted by time."""
    chosen = link.loc[link["series"] == name, ["t_s", "value"]].dropna()
    return chosen.sort_values("t_s", kind="stable")


def curve(link: pd.DataFrame, name: str) -> tuple[Floats, Floats]:
    """Returns the same series as two arrays: times and values."""
    rows = np.flatnonzero((link["series"] == name).to_numpy(bool))
    t_s = link["t_s"].to_numpy(np.float64)[rows]
    values = link["value"].to_numpy(np.float64)[rows]
    there = ~(np.isnan(t_s) | np.isnan(values))
    t_s, values = t_s[there], values[there]
    order = np.argsort(t_s, kind="stable")
    return t_s[order], values[order]


def known_rtt(samples: pd.DataFrame) -> tuple[str, pd.DataFrame]:
    """Returns the `rtt_sample` events of one source, the first of RTT_SOURCES that is there, and
    how it knows the RTT, in words."""
    if "source" not in samples:
        return UNKNOWN_SOURCE, samples
    for source, words in RTT_SOURCES.items():
        own = samples[samples["source"] == source]
        if len(own):
            return words, own
    return UNKNOWN_SOURCE, samples


def measured_only(link: pd.DataFrame, end_s: float | None) -> RttFigures:
    """Returns the figures of a real network, which has no commanded RTT."""
    sent_s, measured = curve(link, "probe_rtt_ms")
    during = sent_s >= 0.0
    if end_s is not None:
        during &= sent_s <= end_s
    if (count := int(during.sum())) < MINIMUM_PROBES:
        return NO_RTT_FIGURES
    return RttFigures(None, float(measured[during].mean()), None, None, count)


def rtt_figures(link: pd.DataFrame, base_rtt_ms: float, end_s: float | None) -> RttFigures | None:
    """Compares each probe with the RTT commanded during its flight plus the base RTT.

    Half of the RTT is set when the probe leaves and half when it turns around, half an RTT later.
    For a changing latency this is the commanded RTT a quarter of the RTT after sending. Returns
    None if there is nothing to compare (no profile, or too few probes).
    """
    asked_s, asked = curve(link, "asked_rtt_ms")
    sent_s, measured = curve(link, "probe_rtt_ms")
    during = sent_s >= 0.0
    if end_s is not None:
        during &= sent_s <= end_s
    sent_s, measured = sent_s[during], measured[during]
    if not len(asked) or len(measured) < MINIMUM_PROBES:
        return None
    expected = np.interp(sent_s + measured / 4e3, asked_s, asked) + base_rtt_ms
    error = np.abs(measured - expected)
    return RttFigures(
        float((expected - base_rtt_ms).mean()),
        float(measured.mean()),
        float(np.median(error)),
        float(np.quantile(error, 0.99)),
        len(error),
    )
