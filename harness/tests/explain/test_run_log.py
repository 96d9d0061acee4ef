# SPDX-License-Identifier: Apache-2.0
"""Runs whose events lack something, and folders without events."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pandas as pd
import pyarrow.parquet as pq
import pytest
from command_line import refused
from results_factory import RawRun, spec_of, write_experiment, write_jsonl

from slambed.errors import ExitCode, SlambedError
from slambed.explain.picture import Window, figure_of
from slambed.explain.run_log import read_run
from slambed.explain.slowest import slowest
from slambed.explain.story import story
from slambed.metrics.event_columns import EVENT_COLUMNS, table_of

S = 10**9


def raw_run(folder: Path, *events: dict[str, Any]) -> Path:
    """Writes the raw folder of a program that reports these events."""
    (folder / "mobile").mkdir(parents=True)
    write_jsonl(folder / "mobile" / "events.jsonl", list(events))
    return folder


def stored_run(root: Path) -> Path:
    experiment = write_experiment(
        root, [(spec_of("orbslam2", "default", None, 0), RawRun(4.0, edge=False))]
    )
    (folder,) = (experiment / "runs").iterdir()
    return folder


def test_events_without_optional_fields_have_a_story_and_a_picture(tmp_path: Path) -> None:
    folder = raw_run(
        tmp_path / "raw",
        {"t_ns": S, "type": "frame_tracked", "state": "ok", "track_ms": 20.0},
        {"t_ns": S + 1, "type": "frame_dropped"},
        {"t_ns": S, "type": "stage", "name": "track", "wall_ms": 20.0},
        {"t_ns": 2 * S, "type": "track_lost"},
        {"t_ns": 3 * S, "type": "update_applied", "update": 1},
        {"t_ns": 4 * S, "type": "update_declined", "update": 2},
        {"t_ns": 5 * S, "type": "reloc_request"},
        {"t_ns": 6 * S, "type": "message", "channel": "map"},
    )
    run = read_run(folder)
    lines = story(run)
    assert (
        lines[0] == "2 frames in 6.0 s: 1 with a pose, 1 dropped, 1 track loss; 0 keyframes created"
    )
    assert {"1 map update applied", "track lost at 2.00 s: 1 frame dropped"} <= set(lines)
    plt.close(figure_of(run, Window(0.0, run.end_s)))
    assert [frame.frame for frame in slowest(run, 1)] == [0]


def test_a_stored_run_gets_the_columns_that_were_added_later(tmp_path: Path) -> None:
    folder = stored_run(tmp_path)
    events = pd.read_parquet(folder / "events.parquet")
    events.drop(columns=["reason", "gap_keyframes"]).to_parquet(folder / "events.parquet")
    run = read_run(folder)
    assert set(EVENT_COLUMNS) <= set(run.events)
    assert story(run)


def test_damaged_events_are_one_line(tmp_path: Path) -> None:
    folder = stored_run(tmp_path)
    path = folder / "events.parquet"
    path.write_bytes(path.read_bytes()[:-100])
    line = refused(ExitCode.BAD_INPUT, "explain", str(folder))
    assert f"{path}: unreadable (" in line
    pd.DataFrame({"t_ns": [1], "what": ["foreign"]}).to_parquet(path)
    with pytest.raises(SlambedError, match="not the events of a run, without node, type"):
        read_run(folder)


def test_a_result_without_events_says_how_to_get_them(tmp_path: Path) -> None:
    folder = stored_run(tmp_path)
    (folder / "events.parquet").unlink()
    with pytest.raises(SlambedError) as found:
        read_run(folder)
    assert f"{folder}: its events were not kept: packed runs have all of them only" in str(
        found.value
    )
    assert "\"slambed run NAME --force '*'\"" in str(found.value)
    manifest = folder / "manifest.json"
    manifest.write_text(manifest.read_text().replace("{", '{"cell": "orbslam2/room_walk", ', 1))
    with pytest.raises(SlambedError, match="--force 'orbslam2/room_walk'"):
        read_run(folder)
    (folder / "summary.json").unlink()
    with pytest.raises(SlambedError, match=r"no events in .*; give the folder of one run"):
        read_run(folder)


def test_a_result_of_a_system_that_reports_none_says_so(tmp_path: Path) -> None:
    pq.write_table(table_of([], EVENT_COLUMNS, []), tmp_path / "events.parquet")
    with pytest.raises(SlambedError, match="the system reported no events"):
        read_run(tmp_path)
