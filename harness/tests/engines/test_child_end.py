# SPDX-License-Identifier: Apache-2.0
"""Waiting for a child: returns its exit code at its end, None before, with and without a pidfd."""

import os
import signal
import subprocess
import threading
from collections.abc import Iterator

import pytest

from slambed.engines.child_end import end_of


@pytest.fixture(params=["pidfd", "without"])
def child(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[subprocess.Popen[bytes]]:
    """A child that runs until it is killed."""

    def refuse(pid: int, flags: int = 0) -> int:
        raise OSError(38, "not implemented")

    if request.param == "without":
        monkeypatch.setattr(os, "pidfd_open", refuse)
    process = subprocess.Popen(["sleep", "600"])
    yield process
    process.kill()
    process.wait()


def test_a_living_child_has_no_exit_code(child: subprocess.Popen[bytes]) -> None:
    with end_of(child) as wait:
        assert wait(0.0) is None
        assert wait(0.05) is None


def test_the_end_is_seen_while_waiting(child: subprocess.Popen[bytes]) -> None:
    with end_of(child) as wait:
        threading.Timer(0.05, child.send_signal, [signal.SIGTERM]).start()
        code = None
        while code is None:
            code = wait(600.0)  # shorter than the timeout only because the end wakes it up
        assert code == -signal.SIGTERM
        assert wait(0.0) == -signal.SIGTERM
