# SPDX-License-Identifier: Apache-2.0
"""The table and the picture of ORB-SLAM3 on generated sequences come from the kept runs."""

import runpy
from pathlib import Path

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
