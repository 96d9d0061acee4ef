# SPDX-License-Identifier: Apache-2.0
"""What the cache keeps is made by one process at a time."""

import threading
from pathlib import Path

import pytest

from slambed.data.places import making
from slambed.errors import ExitCode, SlambedError

PATIENCE_S = 20.0


def test_a_second_process_waits_and_finds_what_the_first_made(tmp_path: Path) -> None:
    folder = tmp_path / "cache" / "inputs"
    made = folder / "map"
    waits = threading.Event()
    reported: list[str] = []
    found: list[bool] = []

    def second() -> None:
        def notify(line: str) -> None:
            reported.append(line)
            waits.set()

        with making(folder, "map", "makes a map", notify):
            found.append(made.exists())

    other = threading.Thread(target=second)
    with making(folder, "map", "makes a map", reported.append):
        other.start()
        assert waits.wait(PATIENCE_S)
        with making(folder, "another", "makes another", reported.append):
            made.write_text("map")
    other.join(PATIENCE_S)
    assert found == [True]
    assert reported == ["waiting: another process makes a map", "going on"]


def test_a_cache_that_is_no_folder_is_one_line_and_errors_of_the_block_stay_theirs(
    tmp_path: Path,
) -> None:
    taken = tmp_path / "taken"
    taken.write_text("")
    with (
        pytest.raises(SlambedError, match="set SLAMBED_CACHE") as refused,
        making(taken, "map", "makes a map", print),
    ):
        pytest.fail("the block must not begin")
    assert refused.value.code == ExitCode.ENVIRONMENT
    with pytest.raises(PermissionError), making(tmp_path, "map", "makes a map", print):
        raise PermissionError
