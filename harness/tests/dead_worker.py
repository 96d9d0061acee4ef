# SPDX-License-Identifier: Apache-2.0
"""A worker of pytest-xdist that dies costs the test that it ran, and not the session.

What a test is not done with long after its limit ends its process (time_limit.py), and so may a
fault of a library or want of memory. pytest-xdist fails that test then, but with `--dist loadfile`
it also gives it to the next worker, which dies of it too; and a next worker that is given a file
whose tests are all done waits for ever.
"""

import os
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController


class DeadWorker:
    """A plugin; `place` is a folder that all processes of this session have in common."""

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
    """Gives what a dead worker had not done to the others, and nothing else."""

    def remove_node(self, node: WorkerController) -> str | None:
        files = self.assigned_work[node]
        for file in [file for file, tests in files.items() if all(tests.values())]:
            del files[file]
        return super().remove_node(node)


def _lives(pid: int) -> bool:
    """Nobody waits for a worker that died before the session ends: it is a zombie until then."""
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    return False
