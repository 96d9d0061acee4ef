# SPDX-License-Identifier: Apache-2.0
"""Every frame of a sequence is verified before playback, but not by every campaign."""

import os
import time
from pathlib import Path

import pytest
from data_samples import flip, write_prepared

from slambed.data.prepared import PreparedSequence
from slambed.data.verified import AGAIN_S, FOLDER, verify_once
from slambed.errors import SlambedError


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[bool]:
    """Records whether each verification was full."""
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    asked: list[bool] = []
    verify = PreparedSequence.verify

    def note(sequence: PreparedSequence, full: bool = True) -> None:
        asked.append(full)
        verify(sequence, full)

    monkeypatch.setattr(PreparedSequence, "verify", note)
    return asked


def test_the_second_campaign_does_not_read_the_frames(tmp_path: Path, read: list[bool]) -> None:
    write_prepared(tmp_path / "s")
    for _ in range(3):
        verify_once(PreparedSequence.open(tmp_path / "s"))
    assert read == [True, False, False]


def test_frames_that_were_written_to_are_read_and_found_damaged(
    tmp_path: Path, read: list[bool]
) -> None:
    sequence = write_prepared(tmp_path / "s")
    verify_once(sequence)
    frames = tmp_path / "s" / "frames.bin"
    times = frames.stat()
    flip(frames, 12288 + 5)
    # Even a restored modification time does not hide it.
    os.utime(frames, ns=(times.st_atime_ns, times.st_mtime_ns))
    for _ in range(2):
        with pytest.raises(SlambedError, match="frame 1 does not fit its CRC"):
            verify_once(PreparedSequence.open(tmp_path / "s"))
    assert read == [True, True, True]


def test_after_a_day_all_is_read_again(tmp_path: Path, read: list[bool]) -> None:
    sequence = write_prepared(tmp_path / "s")
    verify_once(sequence)
    (mark,) = (tmp_path / "cache" / FOLDER).iterdir()
    long_ago = time.time() - AGAIN_S - 1
    os.utime(mark, (long_ago, long_ago))
    verify_once(sequence)
    verify_once(sequence)
    assert read == [True, True, False]


def test_without_a_cache_it_is_read_every_time(tmp_path: Path, read: list[bool]) -> None:
    sequence = write_prepared(tmp_path / "s")
    (tmp_path / "cache").write_text("a file, no folder")
    verify_once(sequence)
    verify_once(sequence)
    assert read == [True, True]
