# SPDX-License-Identifier: Apache-2.0
"""The table and the picture of ORB-SLAM3 on generated sequences come from the kept runs."""

import runpy
from pathlib import Path

import pandas as pd
import pytest

from slambed.native import repository_root

ROOT = repository_root()
TOOL = runpy.run_path(str(ROOT / "tools" / "peer_sequences.py"))
KEPT = ROOT / "examples" / "orb_slam3_on_generated_sequences.csv"
PAGE = ROOT / "docs" / "logbook" / "2026-11-29-orb-slam3-generated-sequences.md"


def test_the_page_has_the_table_of_the_kept_runs() -> None:
    lines = TOOL["table"](TOOL["medians_of"](KEPT))
    assert len(lines) == 2 + 21
    assert "\n".join(lines) in PAGE.read_text(encoding="utf-8")


def test_the_page_has_the_table_of_the_runs_under_limits() -> None:
    tool = runpy.run_path(str(ROOT / "tools" / "peer_picture.py"))
    lines = tool["table"](tool["runs_of"](ROOT / "examples" / "orb_slam3_sensors_at_10_fps.csv"))
    assert len(lines) == 2 + 18
    assert "\n".join(lines) in PAGE.read_text(encoding="utf-8")


def test_one_system_alone_is_drawn_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, picture = tmp_path / "runs.csv", tmp_path / "peer.png"
    file.write_text(
        "cell,valid,coverage,track_losses,ate_rmse_m,track_ms_median\n"
        "ours/synthetic_room,True,1.0,0,0.01,2.0\n"
        "ours/synthetic_room,True,0.5,2,0.03,4.0\n"
        "ORB-SLAM3/synthetic_room,True,1.0,1,0.06,12.0\n"
        "ORB-SLAM3/synthetic_room,False,0.0,9,9.0,99.0\n"
        "ours/synthetic_hall,True,1.0,0,0.04,5.0\n"
    )
    monkeypatch.setattr("sys.argv", ["peer_sequences.py", str(file), str(picture)])
    assert TOOL["main"]() == 0
    assert capsys.readouterr().out.splitlines()[2:] == [
        "| `room` | 75, 100 | 1, 1 | 2, 6 | 4.0 |",
        "| `hall` | 100, none | 0, none | 4, none | none |",
    ]
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_several_sequences_are_rows_each_beside_its_own_whole_core(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tool = runpy.run_path(str(ROOT / "tools" / "peer_picture.py"))
    file, picture = tmp_path / "runs.csv", tmp_path / "peer.png"
    found = (
        ("ours alone", "room", 0, 2.0), ("ORB-SLAM3", "room", 0, 12.0),
        ("ours alone", "block", 0, 4.0), ("ORB-SLAM3", "block", 1, 12.0),
    )  # fmt: skip
    runs = pd.DataFrame(
        {
            "cell": [f"{name}, 1 core/synthetic_{place}/rtt_20" for name, place, _, _ in found],
            "track_losses": [lost for *_, lost, _ in found],
            **{key: [ms for *_, ms in found] for key in tool["RATIOS"].values()},
        }
    ).assign(
        profile="rtt_20", valid=True, failed=False, coverage=1.0, frames_dropped=0, ate_rmse_m=0.01
    )
    runs.to_csv(file)
    monkeypatch.setattr("sys.argv", ["peer_picture.py", str(file), str(picture)])
    assert tool["main"]() == 0
    head, _, *rows = capsys.readouterr().out.splitlines()
    assert head.startswith("| sequence | core | system |")
    cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows]
    assert [(c[0], c[2], c[-3].split()[0]) for c in cells] == [
        ("`room`", "ORB-SLAM3", "6.00"), ("`room`", "ours alone", "1.00"),
        ("`block`", "ORB-SLAM3", "3.00"), ("`block`", "ours alone", "1.00"),
    ]  # fmt: skip
    assert picture.read_bytes().startswith(b"\x89PNG")
