# SPDX-License-Identifier: Apache-2.0
"""What each number of a summary is called, in which unit it is read, and what would be worse."""

from dataclasses import dataclass
from typing import Literal

Better = Literal["lower", "higher", "neither"]
Kind = Literal["median", "share"]


@dataclass(frozen=True)
class Metric:
    """One key of summary.json as tables and figures show it."""

    key: str
    label: str
    unit: str
    scale: float = 1.0
    """Shown value = scale * stored value."""
    digits: int = 1
    better: Better = "lower"
    kind: Kind = "median"
    relevant_share: float = 0.10
    """A gate ignores a change of the median that is smaller than this share of the baseline ..."""
    relevant_step: float = 0.0
    """... or smaller than this (in the stored unit)."""

    @property
    def heading(self) -> str:
        """Label and unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def show(self, value: float | None) -> str:
        """The value in the shown unit; a dash when not measured."""
        if value is None or value != value:
            return "-"
        if value == float("inf"):
            return "failed"
        return f"{value * self.scale:.{self.digits}f}"


METRICS: tuple[Metric, ...] = (
    Metric("lost", "runs with a track loss", "%", 100, 0, kind="share", relevant_step=0.10),
    Metric("coverage", "coverage", "%", 100, 1, "higher", relevant_share=0.0, relevant_step=0.02),
    Metric("failed", "runs that tracked less than 90 %", "%", 100, 0, kind="share",
           relevant_step=0.10),
    Metric("ate_rmse_m", "ATE RMSE", "cm", 100, 2, relevant_step=0.001),
    Metric("ate_scale", "scale that fits best", "", 1, 3, "neither"),
    Metric("ate_live_rmse_m", "ATE RMSE, live poses", "cm", 100, 2, relevant_step=0.001),
    Metric("rpe_trans_m", "RPE over 1 s", "cm", 100, 2, relevant_step=0.001),
    Metric("rpe_rot_deg", "RPE over 1 s", "deg", 1, 2, relevant_step=0.02),
    Metric("track_ms_median", "tracking, median", "ms", 1, 1, relevant_step=0.5),
    Metric("track_ms_mean", "tracking, mean", "ms", 1, 1, relevant_step=0.5),
    Metric("track_ms_p95", "tracking, 95th percentile", "ms", 1, 1, 
           relevant_share=0.15, relevant_step=1.0),
    Metric("extract_ms_median", "feature extraction, median", "ms", 1, 1, relevant_step=0.5),
    Metric("local_mapping_ms_mean", "mapping per keyframe, wall", "ms", 1, 0, 
           relevant_share=0.15, relevant_step=2.0),
    Metric("local_mapping_cpu_ms_mean", "mapping per keyframe, CPU", "ms", 1, 0,
           relevant_share=0.15, relevant_step=2.0),
    Metric("state_switches", "offloading switches", "", 1, 0, "neither"),
    Metric("state_os_s", "mapping on the edge", "s", 1, 1, "neither"),
    Metric("state_sz_s", "mapping on both", "s", 1, 1, "neither"),
    Metric("state_mes_s", "mapping on the mobile", "s", 1, 1, "neither"),
    Metric("mobile_cpu_percent_mean", "mobile CPU", "% of a core", 1, 1, relevant_step=1.0),
    Metric("edge_cpu_percent_mean", "edge CPU", "% of a core", 1, 1, relevant_step=1.0),
    Metric("mobile_mem_mb_peak", "mobile memory, peak", "MB", 1, 0, relevant_step=2.0),
    Metric("edge_mem_mb_peak", "edge memory, peak", "MB", 1, 0, relevant_step=2.0),
    Metric("bytes_up", "sent to the edge", "MB", 1e-6, 2, relevant_step=1e4),
    Metric("bytes_down", "sent to the mobile", "MB", 1e-6, 2, relevant_step=1e4),
    Metric("updates_applied", "map updates applied", "", 1, 0, "neither"),
    Metric("update_delay_ms_median", "map update delay, median", "ms", 1, 0, relevant_step=5.0),
    Metric("update_gap_keyframes_mean", "local map gap per update", "keyframes", 1, 2,
           relevant_step=0.2),
    Metric("update_parts_error_ms_max", "T_Total against its parts, largest error", "ms", 1, 3,
           "neither"),
    Metric("keyframe_bytes_median", "keyframe message, median", "KB", 1e-3, 1, relevant_step=1e3),
    Metric("update_bytes_median", "map update message, median", "KB", 1e-3, 1, relevant_step=1e3),
    Metric("serialise_ms_median", "writing a keyframe, median", "ms", 1, 2, relevant_step=0.1),
    Metric("parse_ms_median", "reading a keyframe, median", "ms", 1, 2, relevant_step=0.1),
    Metric("frames_dropped", "frames dropped", "", 1, 0, relevant_step=5.0),
    Metric("track_losses", "track losses", "", 1, 0, relevant_step=1.0),
    Metric("reloc_s_max", "longest relocalisation", "s", 1, 2, relevant_step=0.1),
    Metric("relocalisations", "relocalisations", "", 1, 0, "neither"),
    Metric("loops_closed", "loops closed", "", 1, 0, "neither"),
    Metric("first_loss_s", "first loss", "s", 1, 1, "neither"),
    Metric("keyframes", "keyframes", "", 1, 0, "neither"),
    Metric("map_points", "map points", "", 1, 0, "neither"),
    Metric("frames_tracked", "frames tracked", "", 1, 0, "higher"),
    Metric("rtt_asked_ms_mean", "RTT asked, mean", "ms", 1, 1, "neither"),
    Metric("rtt_measured_ms_mean", "RTT measured, mean", "ms", 1, 1, "neither"),
    Metric("rtt_error_ms_median", "RTT error, median", "ms", 1, 2, "lower", relevant_step=0.2),
    Metric("rtt_error_ms_p99", "RTT error, 99th percentile", "ms", 1, 2, "neither"),
    Metric("throttled_ms", "throttled", "ms", 1, 0, "neither"),
    Metric("throttled_share", "throttled share", "%", 100, 1, "neither"),
    Metric("host_stall_ms_max", "longest stall by the host", "ms", 1, 0, "neither"),
    Metric("wall_s", "playback", "s", 1, 1, "neither"),
)  # fmt: skip

_BY_KEY = {metric.key: metric for metric in METRICS}

MAIN = (
    "lost", "coverage", "ate_rmse_m", "rpe_trans_m", "track_ms_median", "track_ms_p95",
    "local_mapping_ms_mean", "mobile_cpu_percent_mean", "mobile_mem_mb_peak",
    "bytes_up", "bytes_down", "update_delay_ms_median", "rtt_error_ms_median", "throttled_ms",
)  # fmt: skip
"""Shown for every experiment, after what the experiment asks for."""

BOXED = (
    "lost", "ate_rmse_m", "rpe_trans_m", "coverage", "track_ms_median", "mobile_cpu_percent_mean",
    "mobile_mem_mb_peak", "update_delay_ms_median", "local_mapping_ms_mean",
)  # fmt: skip
"""Metrics that have a figure of their own, after those that the experiment asks for."""

FIGURES = (
    "losses", "trajectory", "rtt", "cpu", "memory", "stages", "losses_by_profile", "tradeoff",
)  # fmt: skip
"""Kinds of figures beside those of a metric."""

COMPARED = (
    "lost", "coverage", "ate_rmse_m", "rpe_trans_m", "track_ms_median",
    "mobile_cpu_percent_mean", "mobile_mem_mb_peak", "update_delay_ms_median",
)  # fmt: skip
"""Tested between conditions. Few on purpose: every test more costs power."""


def metric(key: str) -> Metric:
    """The metric of a key; a key nobody described is shown as it is."""
    return _BY_KEY.get(key, Metric(key, key.replace("_", " "), "", better="neither", digits=3))
