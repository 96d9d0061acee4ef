# SPDX-License-Identifier: Apache-2.0
"""The example ORB-SLAM3: its vocabulary. test_check_system.py plays frames to the package."""

import subprocess
import sys
from pathlib import Path

import pytest

from slambed.errors import SlambedError
from slambed.native import find_program, repository_root

EXAMPLE = repository_root() / "examples" / "orb_slam3"
WORDS = repository_root() / "systems/core/features/data/orb_10k.slv"


def has_vocabulary_tool() -> bool:
    try:
        find_program("slambed-vocab")
    except SlambedError:
        return False
    return True


def converted(vocabulary: Path, text: Path) -> str:
    subprocess.run([sys.executable, EXAMPLE / "vocabulary.py", vocabulary, text], check=True)
    return text.read_text()


def test_our_vocabulary_is_written_as_dbow2_has_it(tmp_path: Path) -> None:
    lines = converted(WORDS, tmp_path / "orb.txt").split("\n")
    assert lines[0] == "10 4 0 0"
    # A line end after the last line would be one more node to ORB-SLAM.
    assert lines[-1] != ""
    leaves = 0
    for number, line in enumerate(lines[1:], start=1):
        parent, leaf, *rest = line.split()
        assert int(parent) < number and len(rest) == 33
        leaves += int(leaf)
    assert leaves == 10_000


@pytest.mark.programs
def test_a_damaged_vocabulary_is_one_line(tmp_path: Path) -> None:
    whole = WORDS.read_bytes()
    for damaged in (whole[:200_000], whole[:5000] + b"x" + whole[5001:], whole[:10]):
        (tmp_path / "bad.slv").write_bytes(damaged)
        done = subprocess.run(
            [sys.executable, EXAMPLE / "vocabulary.py", tmp_path / "bad.slv", tmp_path / "t.txt"],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 1 and not (tmp_path / "t.txt").exists()
        assert done.stderr.startswith("error: the vocabulary is damaged")
        assert done.stderr.count("\n") == 1


@pytest.mark.skipif(not has_vocabulary_tool(), reason="needs slambed-vocab ('make build')")
def test_our_reader_of_that_format_gets_the_same_vocabulary(tmp_path: Path) -> None:
    converted(WORDS, tmp_path / "orb.txt")
    again = tmp_path / "again.slv"
    subprocess.run(
        [find_program("slambed-vocab"), "import", tmp_path / "orb.txt", "-o", again],
        check=True, capture_output=True,
    )  # fmt: skip
    assert again.read_bytes() == WORDS.read_bytes()
