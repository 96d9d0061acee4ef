# SPDX-License-Identifier: Apache-2.0
"""The list of all metrics. A new metric needs only one entry: summary.json, summary.csv and, after
`python -m slambed.document`, the tables of docs/reference/summary.md and docs/reference/metrics.md
follow. Reports and the regression gate use it according to `use`; the default is only on request of
an experiment."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial

from slambed.errors import SlambedError
from slambed.metrics import pace
from slambed.metrics.declared import described_by, own_digest, own_metrics
from slambed.metrics.device_share import share_of_device
from slambed.metrics.faults import faults_in_words
from slambed.metrics.loss_times import loss_times_text
from slambed.metrics.metric import Metric, Use
from slambed.metrics.recovery import frames_lost_to_updates, pause_ms_mean
from slambed.metrics.robust_accuracy import LEAST_COVERAGE
from slambed.metrics.run_data import RunData
from slambed.metrics.stages import host_stall_ms_max, mapping_ms_per_keyframe
from slambed.metrics.summary import Value
from slambed.metrics.tracking import Tracking, mean_of, quantile_of
from slambed.metrics.update_round import (
    closure_error_ms_max,
    codec_stages,
    gap_keyframes_mean,
    median_ms,
    received,
)
from slambed.metrics.values import (
    data_rate_mbit_s,
    extract_ms,
    first_loop_s,
    frames_dropped,
    link_stalls,
    stage_ms_mean,
    truth_digest,
    update_delay_ms,
)
from slambed.metrics.work_shares import UPDATE, WORK, share_of_update, share_of_work
from slambed.records.kept_spec import KeptSpec

METRICS_VERSION = 9
"""To be incremented with every new metric and every change of a computation. It identifies
outdated summaries, which `slambed report --again` computes again. A test compares a stored run
with stored values."""

SHOWN, DRAWN, TESTED, GATED = Use.SHOWN, Use.DRAWN, Use.TESTED, Use.GATED
HEADLINE = SHOWN | DRAWN | TESTED | GATED

NO_LOSS = ("track_losses", "no run lost track")

Text = partial(Metric, type="text")
Count = partial(Metric, type="count", digits=0)
Flag = partial(
    Metric, type="flag", shown="%", scale=100, digits=0, kind="share", relevant_step=0.10
)
LowerIsBetter = partial(Metric, better="lower")
Live = partial(Metric, live_only=True)


def _spec(of: Callable[[KeptSpec], Value]) -> Callable[[RunData], Value]:
    """Takes a value from the RunSpec."""
    return lambda run: of(run.spec)


def _tracking(of: Callable[[Tracking], Value]) -> Callable[[RunData], Value]:
    """Takes a value from the frame states; null without any event."""
    return lambda run: of(run.tracking) if run.measured else None


def _mapped(field: str) -> Callable[[RunData], Value]:
    """Takes a value from the last keyframe_mapped event; with an edge, the global map is on the
    edge."""

    def value(run: RunData) -> Value:
        mapped = run.log.of("keyframe_mapped", node="edge") or run.log.of("keyframe_mapped")
        return mapped[-1].get(field) if mapped else None

    return value


def _track_ms_quantile(share: float) -> Callable[[RunData], Value]:
    return lambda run: quantile_of(run.log.of("frame_tracked"), "track_ms", share)


def _message(name: str) -> Callable[[RunData], Value]:
    return lambda run: quantile_of(received(run.log, name), "bytes", 0.5) if run.has_edge else None


def _codec(node: str, name: str) -> Callable[[RunData], Value]:
    return lambda run: (
        quantile_of(codec_stages(run.log, node, name), "wall_ms", 0.5) if run.has_edge else None
    )


def _pause(relocalization: bool) -> Callable[[RunData], Value]:
    return lambda run: pause_ms_mean(run.log, relocalization) if run.has_edge else None


STAGES_ON_MOBILE = (
    ("extract", "extract", "feature extraction"),
    ("pose", "track", "pose estimation, matching with the map included"),
    ("keyframe", "create_keyframe", "making a keyframe"),
    ("point_creation", "triangulate", "creating map points by triangulation, per keyframe"),
)


def _stage(key: str, stage: str, doc: str) -> Metric:
    return LowerIsBetter(
        f"{key}_ms_mean",
        f"{doc}: stage `{stage}` on the mobile node, wall",
        lambda run: stage_ms_mean(run, stage),
        doc.partition(",")[0] + ", mean",
        "ms",
        relevant_step=0.5,
    )


def _work(part: str) -> Metric:
    return Metric(
        f"work_{part}_share",
        f"of the mobile node's timed work, part `{part}`",
        lambda run: share_of_work(run.log, part),
        shown="%",
        scale=100,
    )


def _update_work(part: str) -> Metric:
    return Metric(
        f"update_{part}_share",
        f"of the work of map updates, part `{part}`; null where they are not reported by parts",
        lambda run: share_of_update(run.log, part) if run.has_edge else None,
        shown="%",
        scale=100,
    )


def _version(run: RunData) -> Value:
    return version_for(described_by(run.spec.system, run.spec.system_folder))


def _run_key(run: RunData) -> Value:
    return run.manifest.run_key or run.spec.run_key


METRICS: tuple[Metric, ...] = (
    Text("run_key", "what names the run", _run_key),
    Text("metrics_version", "version of this list, with a digest of the system's own metrics where "
         "it has some", _version),
    Text("experiment", "its id", _spec(lambda spec: spec.experiment)),
    Text("cell", "system x dataset x link profile", _spec(lambda spec: spec.cell)),
    Count("repetition", "counted from 0", _spec(lambda spec: spec.repetition)),
    Text("system", "condition", _spec(lambda spec: spec.system)),
    Text("variant", "condition", _spec(lambda spec: spec.variant)),
    Text("dataset", "condition", _spec(lambda spec: spec.dataset)),
    Text("profile", "condition; null without a link", _spec(lambda spec: spec.profile)),
    Text("device_mobile", "condition", _spec(lambda spec: spec.device_name("mobile"))),
    Text("device_edge", "condition; null without an edge", 
         _spec(lambda spec: spec.device_name("edge"))),
    Text("engine", "condition", _spec(lambda spec: spec.engine)),
    Text("pace", "of a live run: `device` where each stage took what the cost model of its device "
         "charges, else `host`; null in virtual time",
         _spec(lambda spec: None if spec.is_virtual else spec.pace)),
    Text("link_backend", "condition; null without a link",
         _spec(lambda spec: None if spec.link is None else spec.link.backend)),
    Count("seed", "of everything drawn in the run", _spec(lambda spec: spec.seed)),
    Text("outcome", "how the system ended: `completed`, `died`, `timed_out`, `refused` (its input)",
         lambda run: run.outcome),
    Text("outcome_reason", "in which words it died, timed out or refused",
         lambda run: run.manifest.outcome_reason),
    Flag("not_completed", "whether the outcome is another than `completed`",
         lambda run: run.outcome != "completed", "runs that did not complete", better="lower",
         use=SHOWN),
    Metric("valid", "whether host, link and limits were as asked; only such runs count",
           type="flag"),
    Text("invalid_reason", "why not"),
    Count("attempts", "how often the run was executed to its end, this one included; the others "
          "were invalid, or were run again on request", lambda run: run.manifest.attempt),
    Text("faults", 'what went wrong on purpose, in s of run time: "kill 10.0-12.4, cut 20.0-25.0"; '
         "null when nothing",
         lambda run: faults_in_words(run.log.of("fault_began", "fault_ended"))),
    Count("frames_total", "frames that playback offers by its plan and clock",
          lambda run: run.frames_offered),
    Count("frames_tracked", "with a pose (state ok; of a system without frame events: in its "
          "trajectory)", lambda run: run.frames_tracked, better="higher"),
    Count("frames_dropped", "replaced by a newer one before tracking took them; null of a system "
          "that reads a folder", frames_dropped, better="lower", relevant_step=5.0),
    Flag("lost", "whether track was lost at least once", _tracking(lambda t: t.track_losses > 0),
         "runs with a track loss", better="lower", use=HEADLINE),
    Metric("coverage", "frames_tracked / frames_total, 0..1; 0 unless `completed`",
           lambda run: run.coverage,
           shown="%", scale=100, better="higher", relevant_share=0.0, relevant_step=0.02,
           use=HEADLINE),
    Metric("coverage_processed", "frames that tracking took / frames_total, with a pose or "
           "without; null of a system that reads a folder",
           lambda run: run.coverage_processed, "frames processed", shown="%", scale=100,
           better="higher", relevant_share=0.0, relevant_step=0.02),
    Flag("failed", f"whether coverage is below {LEAST_COVERAGE:g}",
         lambda run: None if run.coverage is None else run.coverage < LEAST_COVERAGE,
         "runs that tracked less than 90 %", better="lower", use=GATED),
    Count("track_losses", "transitions ok -> lost", _tracking(lambda t: t.track_losses),
          better="lower", relevant_step=1.0),
    Metric("first_loss_s", "sequence time of the first loss; null when none",
           _tracking(lambda t: t.first_loss_s), "first loss", "s", null_without=NO_LOSS),
    Text("loss_times_s", 'sequence times of all losses: "22.4 31.07"; empty when none',
         _tracking(lambda t: loss_times_text(t.loss_times_s))),
    LowerIsBetter(
        "lost_s", "sum over all losses: sequence time from the loss (or the start in a prior map) "
        "to the next pose, or the end; a map given up at once adds nothing",
        _tracking(lambda t: t.lost_s), "time without a pose", "s", relevant_step=0.5),
    Count("relocalizations", "times a lost camera was found again",
          _tracking(lambda t: t.relocalizations)),
    LowerIsBetter(
        "reloc_s_max", "longest time from the first frame that showed something, while lost, to "
        "the next pose", _tracking(lambda t: t.reloc_s_max), "longest relocalization", "s",
        digits=2, relevant_step=0.1, null_without=NO_LOSS),
    LowerIsBetter(
        "reloc_known_s", "mean over losses: from the lost camera's return to a place where it had "
        "been tracked (true poses) to the next pose, the reset of the map, or the end",
        lambda run: run.known_place_s, "recovery at known places", "s", digits=2,
        relevant_step=0.1, null_without=NO_LOSS),
    Count("resets", "maps given up", _tracking(lambda t: t.resets)),
    Count("loops_closed", "loops closed",
          lambda run: len(run.log.of("loop_closed")) if run.measured else None),
    Metric("first_loop_s", "run time at which the first loop was closed; null when none",
           first_loop_s, "first loop closed", "s",
           null_without=("loops_closed", "no run closed a loop")),
    Count("keyframes", "in the global map when its last keyframe was mapped (with an edge: mapped "
          "there), so without culled ones; those of a prior map count",
          _mapped("keyframes"), "keyframes in the map"),
    Count("map_points", "in the global map at the same time", _mapped("points")),
    Text("groundtruth", "first 16 digits of the SHA-256 of the true path; null without one",
         truth_digest),
    LowerIsBetter(
        "ate_rmse_m", "of `trajectory.txt` after one alignment",
        lambda run: run.accuracy.ate_rmse_m, "ATE RMSE", "m", "cm", 100, 2, relevant_step=0.001,
        use=HEADLINE),
    LowerIsBetter(
        "ate_mean_m", "mean instead of root mean square", lambda run: run.accuracy.ate_mean_m,
        "mean position error", "m", "cm", 100, 2, relevant_step=0.001),
    Count("ate_pairs", "poses it was computed from", lambda run: run.accuracy.ate_pairs),
    Text("ate_alignment", "`se3` (rigid, scale 1), or `sim3` for a monocular sequence",
         lambda run: run.accuracy.ate_alignment),
    Metric("ate_scale", "what the estimate was multiplied by", lambda run: run.accuracy.ate_scale,
           "scale that fits best", digits=3),
    LowerIsBetter(
        "ate_live_rmse_m", "of `trajectory_live.txt`", lambda run: run.accuracy.ate_live_rmse_m,
        "ATE RMSE, live poses", "m", "cm", 100, 2, relevant_step=0.001),
    LowerIsBetter(
        "error_in_force_m_mean", "mean over all frames: newest pose that the mobile had at the "
        "frame's time, against the truth of that time; alignment of the ATE",
        lambda run: run.accuracy.error_in_force_m_mean, "error in force", "m", "cm", 100, 2,
        relevant_step=0.001),
    LowerIsBetter(
        "reference_rmse_m", "live poses to the live path of the reference run that the dataset "
        "names, not aligned", lambda run: run.reference.rmse_m, "error to the reference", "m",
        digits=3, relevant_step=0.05),
    LowerIsBetter(
        "reference_rmse_aligned_m", "the same after one rigid alignment",
        lambda run: run.reference.aligned_m, "error to the reference, aligned", "m", digits=3,
        relevant_step=0.05),
    Count("reference_pairs", "frames that it was computed from", lambda run: run.reference.pairs),
    LowerIsBetter(
        "rpe_trans_m", "RMSE of the relative pose error over 1 s, of the estimate times "
        "`ate_scale`", lambda run: run.accuracy.rpe_trans_m, "RPE over 1 s", "m", "cm", 100, 2,
        relevant_step=0.001, use=HEADLINE),
    LowerIsBetter(
        "rpe_rot_deg", "RMSE of its angle", lambda run: run.accuracy.rpe_rot_deg,
        "RPE over 1 s", "deg", digits=2, relevant_step=0.02),
    LowerIsBetter(
        "rpe_all_trans_m", "RMSE of the relative pose error over pairs of any distance (TUM's "
        "script without `--fixed_delta`)", lambda run: run.accuracy.rpe_all_trans_m,
        "RPE over all pairs", "m", "cm", 100, 2, relevant_step=0.001),
    LowerIsBetter(
        "rpe_all_rot_deg", "RMSE of its angle", lambda run: run.accuracy.rpe_all_rot_deg,
        "RPE over all pairs", "deg", digits=2, relevant_step=0.02),
    LowerIsBetter(
        "rpe_frame_trans_m", "RMSE of the relative pose error from one pose to the next",
        lambda run: run.accuracy.rpe_frame_trans_m, "RPE over a frame", "m", "cm", 100, 2,
        relevant_step=0.001),
    LowerIsBetter(
        "rpe_frame_rot_deg", "RMSE of its angle", lambda run: run.accuracy.rpe_frame_rot_deg,
        "RPE over a frame", "deg", digits=2, relevant_step=0.02),
    LowerIsBetter(
        "rte_percent", "relative translation error as in KITTI's benchmark: mean over parts of "
        "100 to 800 m of the true path, of the estimate times `ate_scale`; null where it is "
        "shorter", lambda run: run.accuracy.rte_percent, "RTE", "%", digits=2,
        relevant_step=0.05),
    LowerIsBetter(
        "rre_deg_per_m", "relative rotation error of the same parts",
        lambda run: run.accuracy.rre_deg_per_m, "RRE", "deg/m", digits=4, relevant_step=0.001),
    LowerIsBetter(
        "rte_short_percent", "RTE over parts of 10 to 80 m, of a path that is shorter than 100 m",
        lambda run: run.accuracy.rte_short_percent, "RTE over 10 to 80 m", "%", digits=2,
        relevant_step=0.05),
    LowerIsBetter(
        "rre_short_deg_per_m", "RRE of these",
        lambda run: run.accuracy.rre_short_deg_per_m, "RRE over 10 to 80 m", "deg/m", digits=4,
        relevant_step=0.001),
    LowerIsBetter(
        "track_ms_median", "of the tracking steps, wall", _track_ms_quantile(0.5),
        "tracking, median", "ms", relevant_step=0.5, use=HEADLINE),
    LowerIsBetter(
        "track_ms_mean", "their mean",
        lambda run: mean_of(run.log.of("frame_tracked"), "track_ms"), "tracking, mean", "ms",
        relevant_step=0.5),
    LowerIsBetter(
        "track_ms_p95", "their 95th percentile", _track_ms_quantile(0.95),
        "tracking, 95th percentile", "ms", relevant_share=0.15, relevant_step=1.0,
        use=SHOWN | GATED),
    LowerIsBetter(
        "extract_ms_median", "feature extraction on the mobile node, wall", extract_ms,
        "feature extraction, median", "ms", relevant_step=0.5),
    Metric("cull_recall", "of the features on people, share that the run left out, with masks of "
           "all ages as they came; null without recorded features (`record_culling`) or where the "
           "sequence is not here with its labels", lambda run: run.culling.recall,
           "recall of culling", shown="%", scale=100, better="higher", relevant_step=0.01),
    Metric("cull_precision", "of the features that it left out, share on people or within "
           "`mask_border_px` of them", lambda run: run.culling.precision, "precision of culling",
           shown="%", scale=100, better="higher", relevant_step=0.01),
    *(_stage(*reported) for reported in STAGES_ON_MOBILE),
    LowerIsBetter(
        "local_mapping_ms_mean", "per keyframe, all mapping stages, wall",
        lambda run: mapping_ms_per_keyframe(run.log, "wall_ms"), "mapping per keyframe, wall",
        "ms", digits=0, relevant_share=0.15, relevant_step=2.0, use=SHOWN | DRAWN | GATED),
    LowerIsBetter(
        "local_mapping_cpu_ms_mean", "the same, thread CPU time",
        lambda run: mapping_ms_per_keyframe(run.log, "cpu_ms"), "mapping per keyframe, CPU",
        "ms", digits=0, relevant_share=0.15, relevant_step=2.0),
    Count("pace_missed", "at the device's pace: stages of both nodes whose work alone took "
          "longer than its device would; null at the host's pace",
          lambda run: pace.missed(run.log) if run.spec.is_paced else None,
          "stages slower than the device", better="lower", live_only=True),
    Live("pace_ratio", "at the device's pace: time of the mobile node's stages, divided by the "
         "time that its cost model charges; 1 is undisturbed; null at the host's pace",
         lambda run: pace.ratio(run.log) if run.spec.is_paced else None,
         "time of stages to the device's", digits=3),
    LowerIsBetter(
        "mobile_cpu_percent_mean", "over playback; virtual: of a core of the modeled device; live: "
        "of a core of the host, within the limit that the manifest has",
        lambda run: run.mobile.cpu_percent_mean, "mobile CPU", "% of a core", relevant_step=1.0,
        use=HEADLINE),
    LowerIsBetter(
        "mobile_cpu_device_percent", "the same as share of all `mobile_cores`",
        lambda run: share_of_device(run.mobile.cpu_percent_mean, run.mobile_cores),
        "mobile CPU", "% of the device", relevant_step=1.0),
    Metric("mobile_cores", "cores of the whole mobile device: of its cost model (live with `pace: "
           "device`: in cores of the host); live, the CPU quota granted; null without one",
           lambda run: run.mobile_cores, "mobile cores",
           digits=2),
    LowerIsBetter(
        "edge_cpu_percent_mean", "of the edge node", lambda run: run.edge.cpu_percent_mean,
        "edge CPU", "% of a core", relevant_step=1.0),
    LowerIsBetter(
        "mobile_mem_mb_peak", "largest sample of heap and stacks, without mapped files such as "
        "libraries", lambda run: run.mobile.memory_mb_peak,
        "mobile memory, peak", "MiB", digits=0, relevant_step=2.0, use=HEADLINE),
    LowerIsBetter(
        "mobile_mem_mb_mean", "mean of these samples", lambda run: run.mobile.memory_mb_mean,
        "mobile memory, mean", "MiB", digits=0, relevant_step=2.0),
    LowerIsBetter(
        "mobile_mem_mb_slope", "growth, of the straight line through the samples, in MiB a minute",
        lambda run: run.mobile.memory_mb_per_min, "growth of mobile memory", "MiB/min",
        digits=1, relevant_step=0.5),
    LowerIsBetter(
        "edge_mem_mb_peak", "the same of the edge", lambda run: run.edge.memory_mb_peak,
        "edge memory, peak", "MiB", digits=0, relevant_step=2.0, use=GATED),
    LowerIsBetter(
        "bytes_up", "payload and headers of our messages; of a system that reports none, what "
        "the relay carried, IP headers included", lambda run: run.bytes_moved["up"],
        "sent to the edge", "B", "MB", 1e-6, 2, relevant_step=1e4, type="count",
        use=SHOWN | GATED),
    LowerIsBetter(
        "bytes_down", "the same towards the mobile node", lambda run: run.bytes_moved["down"],
        "sent to the mobile", "B", "MB", 1e-6, 2, relevant_step=1e4, type="count",
        use=SHOWN | GATED),
    LowerIsBetter(
        "link_mbit_s", "`bytes_up` and `bytes_down` over playback", data_rate_mbit_s,
        "data rate, both directions", "Mbit/s", digits=2, relevant_step=0.1),
    Count("link_stalls", "how often a channel had bytes under way of which none was acknowledged "
          "for 1 s", link_stalls, "stalls of the link"),
    Count("updates_applied", "map updates that tracking took over, and maps for relocalization",
          lambda run: len(run.log.of("update_applied")) if run.has_edge else None,
          "map updates and relocalization maps applied"),
    Count("updates_declined", "map updates that it did not",
          lambda run: len(run.log.of("update_declined")) if run.has_edge else None,
          "map updates declined"),
    LowerIsBetter(
        "update_computed_ms_median", "T_Computed: capture of the newest covered keyframe until "
        "applied, without the pacing of updates",
        lambda run: median_ms(run.rounds, lambda r: r.computed_ms),
        "map update delay without pacing, median", "ms", digits=0, relevant_step=5.0,
        use=HEADLINE),
    Metric("update_wait_ms_median", "T_Wait: the pacing of updates (`sync_period_s`)",
           lambda run: median_ms(run.rounds, lambda r: r.parts_ms["T_Wait"]),
           "pacing of map updates, median", "ms", digits=0, use=SHOWN),
    LowerIsBetter(
        "update_delay_ms_median", "T_Total: both together", update_delay_ms,
        "map update delay with pacing, median", "ms", digits=0, relevant_step=5.0),
    LowerIsBetter(
        "update_gap_keyframes_mean", "keyframes that the local map loses by an update",
        lambda run: gap_keyframes_mean(run.rounds), "local map gap per update", "keyframes",
        digits=2, relevant_step=0.2),
    LowerIsBetter(
        "update_pause_ms_mean", "how long tracking stood still for a map update (`pause_ms`); "
        "null where the program does not report",
        lambda run: mean_of(run.log.of("update_applied"), "pause_ms") if run.has_edge else None,
        "tracking held up per map update", "ms", relevant_step=1.0),
    LowerIsBetter(
        "update_pause_regular_ms_mean", "the same of regular updates alone", _pause(False),
        "tracking held up per regular update", "ms", relevant_step=1.0),
    LowerIsBetter(
        "update_pause_reloc_ms_mean", "the same of maps sent for relocalization alone",
        _pause(True), "tracking held up per map for relocalization", "ms", relevant_step=1.0),
    Count("frames_lost_to_updates", "frames dropped while a map update held tracking up; null "
          "where the program does not report",
          lambda run: frames_lost_to_updates(run.log) if run.has_edge and run.measured else None,
          better="lower",
          relevant_step=2.0),
    *map(_work, WORK),
    *map(_update_work, UPDATE),
    Metric("update_parts_error_ms_max", "how far the parts of T_Total are from it at most",
           lambda run: closure_error_ms_max(run.rounds),
           "T_Total against its parts, largest error", "ms", digits=3),
    LowerIsBetter(
        "keyframe_bytes_median", "messages `KEYFRAME` that arrived", _message("KEYFRAME"),
        "keyframe message, median", "B", "KB", 1e-3, relevant_step=1e3),
    LowerIsBetter(
        "update_bytes_median", "messages `MAP_UPDATE` that arrived", _message("MAP_UPDATE"),
        "map update message, median", "B", "KB", 1e-3, relevant_step=1e3),
    LowerIsBetter(
        "serialize_ms_median", "writing keyframes, relocalization requests and maps handed over, "
        "on the mobile, wall",
        _codec("mobile", "serialize"), "writing a keyframe, median", "ms", digits=2,
        relevant_step=0.1),
    LowerIsBetter(
        "parse_ms_median", "reading them on the edge, wall", _codec("edge", "parse"),
        "reading a keyframe, median", "ms", digits=2, relevant_step=0.1),
    Metric("rtt_asked_ms_mean", "of the profile over playback; live over the relay with jitter and "
           "queueing of the probes", lambda run: run.asked_rtt_ms_mean, "RTT asked, mean", "ms"),
    Live("rtt_measured_ms_mean", "of the probes", lambda run: run.rtt.measured_mean,
         "RTT measured, mean", "ms"),
    LowerIsBetter(
        "rtt_error_ms_median", "absolute error of the probe against asked + base",
        lambda run: run.rtt.error_median, "RTT error, median", "ms", digits=2,
        relevant_step=0.2, use=SHOWN, live_only=True),
    Live("rtt_error_ms_p99", "its 99th percentile", lambda run: run.rtt.error_p99,
         "RTT error, 99th percentile", "ms", digits=2),
    Live("throttled_ms", "mobile node, cgroup counter", lambda run: run.mobile.throttled_ms,
         "throttled in playback", "ms", digits=0, use=SHOWN),
    Live("throttled_share", "of playback", lambda run: run.mobile.throttled_share,
         "throttled share", shown="%", scale=100),
    Live("host_stall_ms_max", "longest time for which something else on the host held the mobile "
         "node up", lambda run: host_stall_ms_max(run.log),
         "longest stall by the host", "ms", digits=0),
    Live("cpu_wait_share", "time in which runnable threads of the mobile node waited for a CPU, "
         "throttling excluded, as share of this wait and their CPU time",
         lambda run: run.mobile.cpu_wait_share,
         "waited for a processor", shown="%", scale=100),
    Live("host_steal_percent", "CPU time of the host that its hypervisor gave to other guests "
         "during playback", lambda run: run.host_steal_percent,
         "CPU time stolen from the host", "%"),
    Metric("wall_s", "duration of playback", lambda run: run.end_s, "playback", "s"),
)  # fmt: skip

SUMMARY_KEYS = tuple(metric.key for metric in METRICS)
"""The first columns of summary.csv in order; the systems' own metrics follow."""

_BY_KEY = {metric.key: metric for metric in METRICS}


def metrics_of(system: object) -> tuple[Metric, ...]:
    """Returns all metrics in the summary of a run of this system."""
    return METRICS + own_metrics(str(system), frozenset(SUMMARY_KEYS))


def numbers_of(own: Iterable[Metric]) -> list[str]:
    """Returns the keys of all metrics that are numbers; `own` are those of systems."""
    return [item.key for item in (*METRICS, *own) if item.is_number]


def own_of(systems: Iterable[object]) -> dict[str, Metric]:
    """Returns the own metrics of all these systems by key.

    Raises SlambedError if two systems define a key differently.
    """
    found: dict[str, Metric] = {}
    for system in dict.fromkeys(map(str, systems)):
        for item in own_metrics(system, frozenset(SUMMARY_KEYS)):
            if found.setdefault(item.key, item) != item:
                raise SlambedError(
                    f"metric '{item.key}' of system {system} is something else in another system, "
                    f"systems/{system}/system.yaml, rename one of them"
                )
    return found


def version_for(system: object) -> str:
    """Returns the current `metrics_version` for a run of this system."""
    digest = own_digest(str(system))
    return f"{METRICS_VERSION}+{digest}" if digest else str(METRICS_VERSION)


def metric(key: str, own: Mapping[str, Metric] | None = None) -> Metric:
    """Returns the metric of a key; an unknown key gets a metric without description."""
    return _BY_KEY.get(key) or (own or {}).get(key) or Metric(key, "", digits=3)


def keys_for(use: Use, own: Mapping[str, Metric] | None = None) -> list[str]:
    """Returns the keys of the metrics that a report uses by default."""
    return [item.key for item in (*METRICS, *(own or {}).values()) if use in item.use]
