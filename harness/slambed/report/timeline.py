# SPDX-License-Identifier: Apache-2.0
"""Draws the timeline of one run as inline SVG: state, losses, map updates, RTT, CPU and faults."""

import numpy as np
import pandas as pd

from slambed.metrics.network import known_rtt, series
from slambed.report.load import Results
from slambed.report.time_lanes import BLACK, PINK, TimeLanes

STATE_HEIGHT, MARKS_HEIGHT, CURVE_HEIGHT, GAP = 14, 7, 44, 4
FAULTS = ("fault_began", "fault_ended")


def timeline_svg(results: Results, run_key: str, link: str = "") -> str | None:
    """Returns the SVG, or None if the run has no readable events. `link`: where its marks lead."""
    events = results.table(run_key, "events")
    if events is None or events.empty:
        return None
    lanes = TimeLanes(float(events["t_ns"].max()) / 1e9)
    top = lanes.y
    lanes.name("state")
    state_lane(lanes, events, STATE_HEIGHT, link)
    table = results.table(run_key, "link")
    if table is not None:
        source, rtt = rtt_of(table, events)
        if len(rtt):
            _curve(lanes, rtt, f"RTT, {source}", "ms")
    samples = results.table(run_key, "samples")
    if samples is not None:
        own = samples[samples["node"] == "mobile"].rename(columns={"cpu_percent": "value"})
        if len(smooth := _smoothed(own)):
            _curve(lanes, smooth, "mobile CPU", "% of a core")
    log = results.events(run_key, FAULTS)
    lanes.faults(log.events if log is not None else [], top, link)
    return lanes.svg(f"time line of run {run_key}")


def state_lane(lanes: TimeLanes, events: pd.DataFrame, height: int, link: str = "") -> None:
    """Draws the tracking state with crosses at track losses; under it ticks for map updates."""
    frames = events[events["type"] == "frame_tracked"]
    if len(frames):
        lanes.states(frames, height, link)
    else:
        lanes.gap(height)
    lanes.losses(times_of(events, "track_lost"), height, link)
    for kind, color, says in (
        ("update_applied", BLACK, "map update applied"),
        ("update_declined", PINK, "map update declined"),
    ):
        lanes.ticks(times_of(events, kind), MARKS_HEIGHT, color, says, link)
    lanes.gap(MARKS_HEIGHT)


def rtt_of(link: pd.DataFrame, events: pd.DataFrame) -> tuple[str, pd.DataFrame]:
    """Returns the RTT with its source: measured by the probe, else as the mobile node knows it.
    Virtual runs have no probe."""
    probe = series(link, "probe_rtt_ms")
    own = events[(events["type"] == "rtt_sample") & (events["node"] == "mobile")]
    if len(probe) or "rtt_ms" not in own:
        return "measured", probe
    source, own = known_rtt(own)
    known = pd.DataFrame({"t_s": own["t_ns"] / 1e9, "value": own["rtt_ms"].astype(float)})
    return source, known.dropna()


def times_of(events: pd.DataFrame, kind: str) -> list[float]:
    """Returns the run times of all events of a type, in seconds."""
    found = events.loc[events["type"] == kind, "t_ns"].to_numpy(np.float64) / 1e9
    return [float(t) for t in found]


def largest(values: pd.Series) -> float:
    """Returns the end of a scale that single peaks do not stretch."""
    return max(float(values.quantile(0.995)), 1e-9)


def _smoothed(samples: pd.DataFrame) -> pd.DataFrame:
    """Returns one mean value per second."""
    own = samples.dropna(subset=["value"])
    means = own.groupby(own["t_s"] // 1)["value"].mean()
    return pd.DataFrame({"t_s": means.index + 0.5, "value": means.to_numpy()})


def _curve(lanes: TimeLanes, data: pd.DataFrame, name: str, unit: str) -> None:
    lanes.gap(GAP)
    most = largest(data["value"])
    lanes.name(f"{name} [{unit}]", right=f"0 to {most:.0f}" if most >= 10 else f"0 to {most:.1f}")
    lanes.curve(data, CURVE_HEIGHT, most, name, unit)
    lanes.base(CURVE_HEIGHT)
