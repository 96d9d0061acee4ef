# SPDX-License-Identifier: Apache-2.0
"""Virtual against live runs: cells are matched, errors are those of the medians."""

from pathlib import Path
from typing import Any

import pytest
from command_line import refused, slambed
from results_factory import RawRun, spec_of, write_experiment

from slambed.errors import SlambedError
from slambed.report.load import load
from slambed.report.truth import truth_table


def experiment(root: Path, engine: str, cpu_percent: float, lost: int = 0) -> Path:
    """Four offloaded runs and one alone."""
    link = {"link": {"backend": engine, "profile": "ramp_85"}}
    runs: list[tuple[dict[str, Any], RawRun]] = [
        (
            spec_of("edgeslam", "static", "ramp_85", r, engine=engine, **link),
            RawRun(seed=r, cpu_percent=cpu_percent, lost_at_s=((6.0, 7.0),) if r < lost else ()),
        )
        for r in range(4)
    ]
    alone = spec_of("orbslam2", "default", None, 0, engine=engine)
    runs.append((alone, RawRun(edge=False, cpu_percent=cpu_percent)))
    return write_experiment(root / engine, runs)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    root = tmp_path_factory.mktemp("truth")
    return experiment(root, "local", 50.0), experiment(root, "virtual", 75.0, lost=4)


def test_errors_are_those_of_the_medians(folders: tuple[Path, Path]) -> None:
    live, virtual = map(load, folders)
    table = truth_table(live, virtual)
    assert table.caption.startswith(f"Virtual ({folders[1]}) against live ({folders[0]}), medians")
    assert {row[0] for row in table.rows} == {
        "edgeslam:static/room_walk/ramp_85",
        "orbslam2/room_walk",
    }
    offloaded = {row[1]: row for row in table.rows if row[0].startswith("edgeslam")}
    cpu = offloaded["mobile CPU [% of a core]"]
    rows = live.valid_runs[live.valid_runs["system"] == "edgeslam"]["mobile_cpu_percent_mean"]
    assert cpu[2].startswith(f"{rows.median():.3g} (")
    assert float(cpu[5]) == pytest.approx(50, abs=4) and cpu[6] == "no"
    drawn = offloaded["tracking [ms]"]
    assert abs(float(drawn[5])) < 15 and drawn[6] == "yes"
    assert {"T_Total [ms]", "T_MU [ms]"} <= offloaded.keys()
    # Without an edge there is no update delay.
    alone = {row[1] for row in table.rows if row[0].startswith("orbslam2")}
    assert "T_Total [ms]" not in alone and "keyframes in the map" in alone


def test_losses_are_tested_exactly(folders: tuple[Path, Path]) -> None:
    live, virtual = map(load, folders)
    rows = {row[0]: row for row in truth_table(live, virtual).rows if row[1].startswith("runs")}
    lost = rows["edgeslam:static/room_walk/ramp_85"]
    assert lost[2:5] == ["0 of 4", "4 of 4", "p 0.03"] and lost[6] == "no"
    assert rows["orbslam2/room_walk"][6] == "yes"


def test_a_loss_that_was_not_measured_is_none_of_either_kind(folders: tuple[Path, Path]) -> None:
    live, virtual = map(load, folders)
    offloaded = live.runs.index[live.runs["system"].eq("edgeslam")]
    live.runs["lost"] = live.runs["lost"].astype(object)
    live.runs.loc[offloaded[:1], "lost"] = None
    live.runs.loc[live.runs["system"].eq("orbslam2"), "lost"] = None
    (row,) = [row for row in truth_table(live, virtual).rows if row[1].startswith("runs")]
    assert row[0] == "edgeslam:static/room_walk/ramp_85" and row[2:4] == ["0 of 3", "4 of 4"]


def test_the_caption_says_which_runs_have_no_events(folders: tuple[Path, Path]) -> None:
    live, virtual = map(load, folders)
    assert "no events" not in truth_table(live, virtual).caption
    first = live.runs[live.runs["system"] == "edgeslam"].iloc[0]
    events = folders[0] / "runs" / str(first["run_key"]) / "events.parquet"
    content = events.read_bytes()
    events.unlink()
    caption = truth_table(live, virtual).caption
    events.write_bytes(content)
    assert caption.endswith(f". T_MU of {folders[0]}: from 3 of 4 runs, the others have no events")


def test_two_live_results_are_no_truth(folders: tuple[Path, Path]) -> None:
    live, virtual = map(load, folders)
    with pytest.raises(SlambedError, match="holds no virtual run"):
        truth_table(live, live)
    with pytest.raises(SlambedError, match="holds no live run"):
        truth_table(virtual, virtual)


def test_diff_makes_the_same_table(folders: tuple[Path, Path], tmp_path: Path) -> None:
    live, virtual = map(str, folders)
    file = tmp_path / "table.csv"
    code, out, err = slambed("diff", live, virtual, "--truth", "-o", str(file))
    assert code == 0 and str(file) in out, err
    assert file.read_text() == truth_table(load(folders[0]), load(folders[1])).csv()
    line = refused(2, "diff", live, virtual, "--truth", "--metric", "lost")
    assert "one table of its own" in line
