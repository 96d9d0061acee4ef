# SPDX-License-Identifier: Apache-2.0
"""Multithread-RL from the experiment to its metrics, compared with Edge-SLAM in virtual time."""

import json
from pathlib import Path

import pandas as pd
import pytest
from command_line import slambed
from virtual_parts import make_sequence, needs_programs, write_experiment

from slambed.errors import ExitCode
from slambed.explain.run_log import read_run
from slambed.explain.story import story
from slambed.metrics.update_round import CLOSURE_LIMIT_MS

pytestmark = needs_programs

OFF = "map_update: serial, relocalization: map"
OFTEN = "sync_period_s: 1.0, fast_motion_ms: 0.0, n_kf: 2, min_local_keyframes: 1"
EXPERIMENT = f"""\
id: walk
title: A short walk with the lens covered, updates on and beside tracking
systems:
  - {{{{system: edgeslam, variant: conventional, label: edgeslam, params: {{{{{OFTEN}}}}}}}}}
  - {{{{system: multithread_rl, variant: multithread, label: old, params: {{{{{OFTEN}, {OFF}}}}}}}}}
  - {{{{system: multithread_rl, variant: multithread_rl, label: both, params: {{{{{OFTEN}}}}}}}}}
datasets: [{{sequence}}]
playback: {{{{mode: realtime, fps: 10}}}}
link: {{{{profiles: [ijnc_wifi]}}}}
devices: {{{{mobile: raspberry_pi_4, edge: edge_m1_pro}}}}
engine: virtual
runs: {{{{default: {{runs}}}}}}
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("multithread_rl")
    dark = ("--trajectory", "office", "--blackout-start-s", "4", "--blackout-end-s", "4.6")
    sequence = make_sequence(folder / "walk", 7, *dark)
    path = write_experiment(folder, sequence, runs=1, text=EXPERIMENT)
    code, out, err = slambed("run", str(path), "--results", str(folder / "results"))
    assert code == ExitCode.OK, out + err
    return folder / "results" / "walk"


def row(results: Path, label: str) -> pd.Series:
    table = pd.read_csv(results / "summary.csv")
    return table[table["cell"].str.startswith(label)].iloc[0]


def test_with_both_switches_off_it_is_edge_slam(results: Path) -> None:
    theirs = results / "runs" / row(results, "edgeslam")["run_key"]
    ours = results / "runs" / row(results, "old")["run_key"]
    for name in ("trajectory.txt", "trajectory_live.txt"):
        assert (theirs / name).read_bytes() == (ours / name).read_bytes()
    events = [pd.read_parquet(run / "events.parquet") for run in (theirs, ours)]
    assert len(events[0]) > 100
    pd.testing.assert_frame_equal(*events)


def test_updates_beside_tracking_hold_it_up_less(results: Path) -> None:
    off, both = row(results, "old"), row(results, "both")
    assert off["updates_applied"] > 0
    assert both["updates_applied"] > 0
    assert both["update_pause_ms_mean"] < off["update_pause_ms_mean"] / 2


def test_the_story_reports_requests_and_rests(results: Path) -> None:
    lines = story(read_run(results / "runs" / row(results, "both")["run_key"]))
    assert any("sent to the edge" in line for line in lines)
    assert any(line.startswith("updates rested from") for line in lines)


def test_the_metrics_report_who_found_a_lost_camera(results: Path) -> None:
    both = row(results, "both")
    assert both["track_losses"] >= 1
    assert both["requests"] >= 1
    found = both["recoveries_local"] + both["recoveries_edge"] + both["recoveries_map"]
    assert found == both["relocalizations"]
    assert both["recoveries_map"] == 0
    parts = [both[f"request_{part}_ms_median"] for part in ("local", "up", "edge", "down")]
    assert all(part > 0 for part in parts)
    assert both["request_parts_error_ms_max"] < CLOSURE_LIMIT_MS


def test_a_requests_parts_are_what_its_messages_took(results: Path) -> None:
    events = pd.read_parquet(results / "runs" / row(results, "both")["run_key"] / "events.parquet")
    extra = events.loc[events["type"] == "reloc_reply", "extra"].map(json.loads)
    replies = [reply for reply in extra if "number" in reply]
    assert replies
    sizes = set(events.loc[events["type"] == "reloc_request", "bytes"])
    assert {reply["request_bytes"] for reply in replies} <= sizes
    of_messages = {
        part: took_ms(events[events["message"].isin(names)])
        for part, names in {"up": ["RELOC_REQUEST"], "down": ["RELOC_OK", "RELOC_FAIL"]}.items()
    }
    edge = events[(events["type"] == "stage") & (events["worker"] == "reloc")]
    edge = edge[edge["node"] == "edge"]
    for reply in replies:
        for part, took in of_messages.items():
            assert any(abs(ms - reply[f"{part}_ms"]) < CLOSURE_LIMIT_MS for ms in took)
        whole = sum(reply[f"{part}_ms"] for part in ("local", "up", "edge", "down"))
        assert whole == pytest.approx(reply["total_ms"], abs=CLOSURE_LIMIT_MS)
    # The edge's time for requests is almost entirely spent in its stages.
    at_edge_ms = sum(reply["edge_ms"] for reply in replies)
    assert edge["wall_ms"].sum() == pytest.approx(at_edge_ms, abs=CLOSURE_LIMIT_MS * len(replies))


def took_ms(messages: pd.DataFrame) -> list[float]:
    return list((messages["received_ns"] - messages["queued_ns"]) / 1e6)
