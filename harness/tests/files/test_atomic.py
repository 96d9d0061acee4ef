# SPDX-License-Identifier: Apache-2.0
"""Atomic files."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from slambed.files.atomic import lock_file, replacing


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def another_process(path: Path, lines: str, rivals: bool = False) -> int:
    """Returns the exit code of these Python lines, executed in the block that writes `path`."""
    script = "import os, signal, sys, pathlib\nfrom slambed.files.atomic import replacing\n"
    script += f"with replacing(pathlib.Path(sys.argv[1]), rivals={rivals}) as out:\n    {lines}\n"
    return subprocess.run([sys.executable, "-c", script, str(path)], check=False).returncode


@pytest.mark.parametrize("rivals", [False, True])
@pytest.mark.parametrize("durable", [False, True])
def test_the_new_file_takes_the_old_ones_place(tmp_path: Path, rivals: bool, durable: bool) -> None:
    path = tmp_path / "table.csv"
    path.write_text("old")
    with replacing(path, rivals=rivals, durable=durable) as out:
        out.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert names(tmp_path) == ["table.csv"]


def test_an_error_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("old")

    def torn() -> None:
        with replacing(path) as out:
            out.write_text("ne")
            raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        torn()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["table.csv"]


def test_a_kill_leaves_the_old_file_and_the_next_writer_tidies_up(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("old")
    killed = "out.write_text('ne'); os.kill(os.getpid(), signal.SIGKILL)"
    assert another_process(path, killed) == -signal.SIGKILL
    assert path.read_text() == "old"
    assert len(names(tmp_path)) == 2
    with replacing(path) as out:
        out.write_text("new")
    assert path.read_text() == "new"
    assert names(tmp_path) == ["table.csv"]


def test_rivals_do_not_write_into_each_others_file(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    with replacing(path, rivals=True) as out:
        out.write_text("of this one")
        assert another_process(path, "out.write_text('of the other one')", rivals=True) == 0
        assert path.read_text() == "of the other one"
    assert path.read_text() == "of this one"
    assert names(tmp_path) == ["table.csv"]


def test_who_waits_for_a_file_that_another_makes_says_so(tmp_path: Path) -> None:
    reported: list[str] = []
    path = tmp_path / "lock"
    with path.open("w") as first:
        lock_file(first, "makes it", reported.append)
        assert reported == []

        def notify(line: str) -> None:
            reported.append(line)
            if len(reported) == 1:
                first.close()  # the other process has ended

        with path.open("w") as second:
            lock_file(second, "makes it", notify)
    assert reported == ["waiting: another process makes it", "going on"]
