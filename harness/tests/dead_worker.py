# SPDX-License-Identifier: Apache-2.0
"""A dead pytest-xdist worker fails the test that it ran, but not the session.

A test that hangs long after its limit ends its process (time_limit.py), as may a crash of a library
or a lack of memory. pytest-xdist then fails that test, but with `--dist loadfile` it also assigns
it to the next worker, which dies too. A worker that gets a file without remaining tests waits
forever.
"""

import os
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController


class DeadWorker:
    """The plugin; `place` is a folder shared by all processes of this session."""

    def __init__(self, place: Path) -> None:
        self._place = place

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        for file in self._place.glob("runs-*"):
            if file.read_text() == item.nodeid and not _lives(int(file.name.removeprefix("runs-"))):
                message = f"{item.nodeid} ended the process that ran it, and is not run again"
                pytest.fail(message, pytrace=False)
        (self._place / f"runs-{os.getpid()}").write_text(item.nodeid)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_make_scheduler(
        self, config: pytest.Config, log: object
    ) -> LoadFileScheduling | None:
        return ByFile(config, log) if config.getoption("dist") == "loadfile" else None


class ByFile(LoadFileScheduling):
    """Reassigns only the unfinished tests of a dead worker."""

    def remove_node(self, node: WorkerController) -> str | None:
        files = self.assigned_work[node]
        for file in [file for file, tests in files.items() if all(tests.values())]:
            del files[file]
        return super().remove_node(node)


def _lives(pid: int) -> bool:
    """A dead worker is a zombie until the end of the session."""
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    return False
