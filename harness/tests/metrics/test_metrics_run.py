# SPDX-License-Identifier: Apache-2.0
"""From a raw run folder to its summary and Parquet files, including truncated and missing files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from path_files import write_path
from results_factory import RawRun, room_walk, spec_of, write_raw

from slambed import document
from slambed.data.trajectory import read_tum, write_tum
from slambed.metrics.accuracy import absolute_error
from slambed.metrics.catalog import SUMMARY_KEYS, metrics_of
from slambed.metrics.collect import keep_groundtruth
from slambed.metrics.events import EventLog, read_events
from slambed.metrics.network import rtt_figures, traffic
from slambed.metrics.parquet import to_parquet
from slambed.metrics.resources import resources_of
from slambed.metrics.run_data import RunData
from slambed.metrics.run_summary import summarize_run, summarize_with_problems
from slambed.metrics.stages import delays, longest_stall, stage_times, total_ms
from slambed.metrics.tracking import tracking_of
from slambed.records.kept_spec import KeptSpec
from slambed.spec.library import Library

DOCS = Path(__file__).resolve().parents[3] / "docs"
EDGE_SPEC = spec_of("edgeslam", "static", "ramp_85", 0)


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    return write_raw(tmp_path / "raw", RawRun(lost_at_s=((5.0, 6.5), (9.0, 9.5))))


def test_a_summary_has_the_keys_of_the_list_and_the_systems_own(raw: Path) -> None:
    assert tuple(summarize_run(raw, EDGE_SPEC)) == SUMMARY_KEYS
    own = Library().system("dynnetslam").metrics
    spec = spec_of("dynnetslam", "wh_wsz", "ramp_85", 0)
    assert tuple(summarize_run(raw, spec)) == (*SUMMARY_KEYS, *own)


def test_every_metric_is_of_its_type_and_described(raw: Path) -> None:
    found = summarize_run(raw, spec_of("dynnetslam", "wh_wsz", "ramp_85", 0))
    for item in metrics_of("dynnetslam"):
        assert item.doc, item.key
        assert item.accepts(found[item.key]), item.key


@pytest.mark.parametrize(("page", "names"), document.TABLES.items())
def test_the_tables_of_the_docs_are_those_of_the_list(page: str, names: tuple[str, ...]) -> None:
    text = (DOCS / page).read_text()
    assert document.renewed(text, names) == text, f"run: {document.COMMAND}"
    with pytest.raises(ValueError, match="no place"):
        document.renewed("", names)


def test_the_pictures_of_the_docs_are_those_of_the_sources() -> None:
    for name, text in document.pictures().items():
        assert (DOCS / "pictures" / name).read_text() == text, f"run: {document.COMMAND}"


def test_summary_of_a_run(raw: Path) -> None:
    found = summarize_run(raw, EDGE_SPEC)
    assert found["outcome"] == "completed"
    assert (found["valid"], found["invalid_reason"]) == (True, None)
    assert found["frames_total"] == 120
    assert found["frames_tracked"] + found["frames_dropped"] == pytest.approx(100, abs=2)
    assert found["coverage"] == found["frames_tracked"] / 120
    assert (found["track_losses"], found["relocalizations"], found["lost"]) == (2, 2, True)
    assert found["first_loss_s"] == pytest.approx(5.0, abs=0.11)
    assert found["ate_rmse_m"] == pytest.approx(0.02, rel=0.15)
    assert found["ate_live_rmse_m"] == pytest.approx(0.03, rel=0.15)
    assert found["track_ms_mean"] == pytest.approx(40, rel=0.1)
    assert found["track_ms_median"] < found["track_ms_p95"]
    assert found["extract_ms_median"] == pytest.approx(0.4 * found["track_ms_median"])
    assert found["local_mapping_ms_mean"] == pytest.approx(120, rel=0.25)
    cpu_share = found["local_mapping_cpu_ms_mean"] / found["local_mapping_ms_mean"]
    assert cpu_share == pytest.approx(0.9)
    assert found["mobile_cpu_percent_mean"] == pytest.approx(60, rel=0.05)
    assert found["mobile_mem_mb_peak"] == pytest.approx(120 + 4 * 11.9, abs=1)
    assert found["bytes_up"] % 41_000 == 0 < found["bytes_up"]
    assert found["rtt_asked_ms_mean"] == pytest.approx(42.5, abs=1)
    assert found["rtt_error_ms_median"] < 0.3 < found["rtt_error_ms_p99"] < 1.0
    assert found["updates_applied"] > 5
    # ramp: one way 0..43 ms, mapping 120 ms, update 15 + 30 ms, tracking 40 ms
    assert 150 < found["update_delay_ms_median"] < 400
    assert found["update_wait_ms_median"] == 0.0
    assert found["update_computed_ms_median"] == found["update_delay_ms_median"]
    assert found["wall_s"] == pytest.approx(11.95, abs=0.1)


def test_without_an_edge_there_are_no_network_figures(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(edge=False))
    found = summarize_run(raw, spec_of("orbslam2", "default", None, 0))
    network = [k for k in SUMMARY_KEYS if k.startswith(("rtt_", "bytes_", "edge_", "update"))]
    assert {found[key] for key in network} == {None}
    assert found["valid"] is True
    assert found["keyframes"] > 0 < found["local_mapping_ms_mean"]


@pytest.mark.parametrize(("sensor", "alignment"), [("mono", "sim3"), ("stereo", "se3")])
def test_one_camera_is_judged_up_to_its_scale_and_marked(
    tmp_path: Path, sensor: str, alignment: str
) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(edge=False))
    spec = spec_of("orbslam2", "default", None, 0)
    metric = summarize_run(raw, spec)
    assert (metric["ate_alignment"], metric["ate_scale"]) == ("se3", 1.0)
    for name in ("trajectory.txt", "trajectory_live.txt"):
        path = raw / "mobile" / name
        write_path(path, read_tum(path).scaled(0.25))
    sequence = tmp_path / "sequence"
    sequence.mkdir()
    (sequence / "sequence.json").write_text(json.dumps({"sensor": sensor}))
    (raw / "run.json").write_text(json.dumps({"sequence": str(sequence)}))
    found = summarize_run(raw, spec)
    assert found["ate_alignment"] == alignment
    if sensor == "mono":
        assert found["ate_scale"] == pytest.approx(4, rel=0.01)
        for key in ("ate_rmse_m", "ate_live_rmse_m", "rpe_trans_m", "rpe_rot_deg"):
            assert found[key] == pytest.approx(metric[key], rel=0.02), key
    else:
        assert found["ate_scale"] == 1
        assert found["ate_rmse_m"] > 10 * metric["ate_rmse_m"]


def test_positions_alone_have_an_ate_and_no_relative_error(tmp_path: Path) -> None:
    """A bag's points have no orientation, so an error of the motion between two poses is none."""
    raw = write_raw(tmp_path / "raw", RawRun(edge=False))
    spec = spec_of("orbslam2", "default", None, 0)
    whole = summarize_run(raw, spec)
    truth = read_tum(raw / "groundtruth.txt")
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(truth), 1))
    points = replace(truth, quaternions_xyzw=still, has_orientation=False)
    write_tum(raw / "groundtruth.txt", points)
    found = summarize_run(raw, spec)
    assert found["ate_rmse_m"] == pytest.approx(whole["ate_rmse_m"], abs=1e-5)
    relative = [key for key in SUMMARY_KEYS if key.startswith(("rpe_", "rte_", "rre_"))]
    assert any(whole[key] is not None for key in relative) and len(relative) >= 10
    assert {found[key] for key in relative} == {None}


def test_a_known_place_needs_to_know_where_the_camera_looked(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(edge=False, lost_at_s=((3.0, 4.0),)))
    run = RunData(raw, KeptSpec.of(spec_of("orbslam2", "default", None, 0)))
    truth = read_tum(raw / "groundtruth.txt")
    write_tum(raw / "groundtruth.txt", replace(truth, has_orientation=False))
    assert run.tracking.track_losses == 1 and run.known_place_s is None


def test_one_camera_is_known_where_the_run_names_a_containers_folder(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(edge=False))
    (raw / "run.json").write_text(json.dumps({"sequence": "/sequence"}))
    sequence = tmp_path / "sequence"
    sequence.mkdir()
    (sequence / "sequence.json").write_text(json.dumps({"sensor": "mono"}))
    spec = KeptSpec.of(spec_of("orbslam2", "default", None, 0))
    assert RunData(raw, spec).sensor is None
    assert RunData(raw, spec, sequence / "groundtruth.txt").sensor == "mono"


def test_ate_leaves_out_what_was_not_tracked(raw: Path) -> None:
    """Coverage and ATE belong together: the trajectory has no poses during a loss."""
    found = summarize_run(raw, EDGE_SPEC)
    assert found["ate_pairs"] == found["frames_tracked"]


@pytest.mark.parametrize("outcome", ["died", "timed_out", "refused"])
def test_a_system_that_breaks_off_is_a_result_with_coverage_0(tmp_path: Path, outcome: str) -> None:
    change = {"outcome": outcome, "outcome_reason": "edge node: signal 9"}
    found = summarize_run(write_raw(tmp_path / "raw", RawRun(manifest=change)), EDGE_SPEC)
    assert (found["outcome"], found["outcome_reason"]) == (outcome, "edge node: signal 9")
    assert (found["valid"], found["not_completed"]) == (True, True)
    assert found["coverage"] == 0.0 and found["failed"] is True
    assert found["frames_tracked"] > 0


def test_a_system_that_dies_before_the_first_echo_is_a_result(raw: Path) -> None:
    for file in (raw / "link").iterdir():
        file.unlink()
    facts = json.loads((raw / "manifest.json").read_text()) | {"outcome": "died"}
    (raw / "manifest.json").write_text(json.dumps(facts))
    found = summarize_run(raw, EDGE_SPEC)
    assert (found["valid"], found["coverage"]) == (True, 0.0)


def test_frames_are_those_that_playback_offers(tmp_path: Path) -> None:
    """A node that reports only half of the frames has half the coverage."""
    raw = write_raw(tmp_path / "raw", RawRun(manifest={"frames_offered": 240}))
    found = summarize_run(raw, EDGE_SPEC)
    assert found["frames_total"] == 240
    assert found["coverage"] == pytest.approx(found["frames_tracked"] / 240)


def test_a_system_without_frame_events_is_judged_by_its_trajectory(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun(manifest={"frames_offered": 240}))
    poses = len((raw / "mobile" / "trajectory_live.txt").read_text().splitlines())
    log = raw / "mobile" / "events.jsonl"
    kept = [line for line in log.read_text().splitlines() if '"frame_' not in line]
    log.write_text("\n".join(kept) + "\n")
    found = summarize_run(raw, EDGE_SPEC)
    assert found["frames_tracked"] == poses > 0
    assert found["coverage"] == pytest.approx(poses / 240)


def test_an_empty_folder_measures_nothing(tmp_path: Path) -> None:
    found, problems = summarize_with_problems(tmp_path, EDGE_SPEC)
    measured = {k: v for k, v in found.items() if v is not None and k.startswith(("frames", "ate"))}
    assert measured == {}
    assert any("samples.jsonl" in line for line in problems)


def test_a_torn_last_line_costs_only_itself(raw: Path, tmp_path: Path) -> None:
    path = raw / "mobile" / "events.jsonl"
    whole = read_events(raw)
    text = path.read_text()
    path.write_text(text[:-20])
    torn = read_events(raw)
    assert len(torn.events) == len(whole.events) - 1
    assert torn.problems == ["mobile/events.jsonl: last line is torn, dropped"]
    path.write_text("garbage\n[1]\n" + text)
    assert read_events(raw).problems == ["mobile/events.jsonl: 2 unreadable lines, dropped"]
    result = to_parquet(RunData(raw, KeptSpec.of(EDGE_SPEC)), tmp_path / "out")
    assert result.problems == read_events(raw).problems


def test_a_line_that_is_no_text_costs_only_itself(raw: Path) -> None:
    path = raw / "mobile" / "events.jsonl"
    whole = read_events(raw)
    path.write_bytes(b"\xff\xfe\n \n" + path.read_bytes())
    broken = read_events(raw)
    assert broken.events == whole.events
    assert broken.problems == ["mobile/events.jsonl: 1 unreadable lines, dropped"]


def test_parquet_files_hold_every_event(raw: Path, tmp_path: Path) -> None:
    (raw / "edge" / "events.jsonl").open("a").write(
        json.dumps({"t_ns": 1, "type": "thing", "frame": "seven", "odd_key": 3}) + "\n"
    )
    result = to_parquet(RunData(raw, KeptSpec.of(EDGE_SPEC)), tmp_path / "out")
    assert {p.name for p in result.written} == {
        "events.parquet",
        "samples.parquet",
        "link.parquet",
    }
    events = pd.read_parquet(tmp_path / "out" / "events.parquet")
    log = read_events(raw)
    assert len(events) == len(log.events)
    assert set(events["node"]) == {"mobile", "edge"}
    assert list(events["t_ns"]) == sorted(events["t_ns"])
    odd = events[events["type"] == "thing"].iloc[0]
    assert odd["extra"] == '{"odd_key": 3}'
    assert result.problems == ["column frame: 1 values of the wrong type, dropped"]
    mine = [e for e in log.of("frame_tracked") if e["frame"] == 20]
    row = events[(events["type"] == "frame_tracked") & (events["frame"] == 20)].iloc[0]
    assert row["track_ms"] == mine[0]["track_ms"]


def test_results_can_be_summarized_from_their_parquet_files(raw: Path, tmp_path: Path) -> None:
    to_parquet(RunData(raw, KeptSpec.of(EDGE_SPEC)), tmp_path / "out")
    samples = pd.read_parquet(tmp_path / "out" / "samples.parquet")
    link = pd.read_parquet(tmp_path / "out" / "link.parquet")
    found = summarize_run(raw, EDGE_SPEC)
    end_s = found["wall_s"]
    assert resources_of(samples, "mobile", end_s).cpu_percent_mean == pytest.approx(
        found["mobile_cpu_percent_mean"]
    )
    figures = rtt_figures(link, 0.2, end_s)
    assert figures is not None
    assert figures.error_p99 == pytest.approx(found["rtt_error_ms_p99"])


def test_delays_and_stages(raw: Path) -> None:
    log = read_events(raw)
    parts = delays(log)
    assert set(parts) == {
        "T_Track", "T_M->E", "T_RKF", "T_LM", "T_Wait", "T_PLMU", "T_E->M", "T_MU",
        "T_Total", "T_Computed",
    }  # fmt: skip
    assert parts["T_MU"].mean_ms == pytest.approx(30)
    assert parts["T_LM"].mean_ms == pytest.approx(120, rel=0.25)
    assert parts["T_M->E"].mean_ms == pytest.approx(22, abs=4)  # mean of the ramp, one way, + 1
    whole = sum(parts[name].mean_ms for name in parts if name not in ("T_Total", "T_Computed"))
    assert parts["T_Total"].mean_ms == pytest.approx(whole)
    names = {(s.node, s.name) for s in stage_times(log)}
    assert {("mobile", "extract"), ("edge", "bundle"), ("edge", "prepare_update")} <= names


def test_delays_of_updates_that_do_not_report_their_parts_come_near(raw: Path) -> None:
    events = read_events(raw).events
    reported = [e | ({"t_lm_ms": None} if e["type"] == "update_applied" else {}) for e in events]
    parts = delays(EventLog(reported))
    assert "T_Wait" not in parts
    assert parts["T_LM"].mean_ms == pytest.approx(120, rel=0.25)
    whole = sum(parts[name].mean_ms for name in ("T_Track", "T_M->E", "T_LM", "T_E->M", "T_MU"))
    assert parts["T_Total"].mean_ms == pytest.approx(whole, rel=0.15)


def test_traffic_per_message_type(raw: Path) -> None:
    rows = {row.message: row for row in traffic(read_events(raw))}
    assert rows["KEYFRAME"].bytes_mean == 41_000
    assert rows["MAP_UPDATE"].direction == "down"


def test_losses_come_from_the_states(raw: Path) -> None:
    found = tracking_of(read_events(raw))
    assert len(found.loss_times_s) == 2
    assert found.lost_s == pytest.approx(2.0, abs=0.35)


def test_stages_called_in_pieces_count_per_keyframe() -> None:
    piece = {"type": "stage", "node": "edge", "name": "bundle", "wall_ms": 10.0}
    mapped = {"type": "keyframe_mapped", "node": "edge"}
    order = [piece, piece, piece, mapped, piece, mapped]
    log = EventLog([event | {"t_ns": i} for i, event in enumerate(order)])
    (bundle,) = stage_times(log)
    assert (bundle.wall_ms_mean, bundle.wall_ms_per_unit) == (10.0, 20.0)


def test_events_of_a_users_program_may_have_our_names_and_other_fields(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun())
    before = summarize_run(raw, EDGE_SPEC)
    own = [
        {"type": "link", "state": "up"},
        {"type": "stage", "name": "extract", "wall_ms": "fast", "cpu_ms": "1 ms"},
        {"type": "keyframe_created", "keyframe": 10_000, "frame": None, "seq_s": "soon"},
    ]
    with (raw / "mobile" / "events.jsonl").open("a") as lines:
        lines.writelines(json.dumps({"t_ns": 10**9, **event}) + "\n" for event in own)
    after = summarize_run(raw, EDGE_SPEC)
    for key in ("link_stalls", "host_stall_ms_max", "update_delay_ms_median"):
        assert after[key] == before[key]
    log = EventLog([{"t_ns": 10**9, "node": "mobile", **event} for event in own])
    assert len(total_ms(log)) == 0 and longest_stall(log) is None


def test_true_path_is_kept_once(tmp_path: Path) -> None:
    raw = write_raw(tmp_path / "raw", RawRun())
    kept = keep_groundtruth(tmp_path / "exp", "tum/desk", raw / "groundtruth.txt")
    assert kept == tmp_path / "exp" / "groundtruth" / "tum_desk.txt"
    assert keep_groundtruth(tmp_path / "exp", "tum/desk", tmp_path / "gone.txt") == kept
    again = read_tum(kept)
    assert absolute_error(again, room_walk(12.0)).rmse == pytest.approx(0.0, abs=1e-6)
    assert np.all(np.diff(again.stamps_s) > 0)


def test_a_virtual_run_has_no_value_of_what_only_live_runs_measure(raw: Path) -> None:
    """Its files may hold a probe's RTT and a throttled cgroup all the same."""
    live = summarize_run(raw, EDGE_SPEC)
    virtual = summarize_run(raw, EDGE_SPEC | {"engine": "virtual"})
    only = [item.key for item in metrics_of("edgeslam") if item.live_only]
    assert [key for key in only if virtual[key] is not None] == []
    assert {key for key in only if live[key] is not None} >= {"rtt_error_ms_median", "throttled_ms"}
    assert "`throttled_ms` | float | ms | live runs only: " in document.renewed(
        (DOCS / "reference/summary.md").read_text(), ("summary",)
    )
