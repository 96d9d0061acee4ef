# SPDX-License-Identifier: Apache-2.0
"""Leftovers of a dead harness are removed; those of a running one are not."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from harness_parts import needs_root
from waiting import until

from slambed.engines.cgroups import CgroupMaker
from slambed.engines.host_lock import host_lock
from slambed.engines.reaper import OWNER_VARIABLE, Reaped, mark_children, reap, start_time
from slambed.spec.device import Limits

pytestmark = needs_root


@pytest.fixture(autouse=True)
def nobody_else() -> Iterator[None]:
    """Holds the host lock: the reaper may run only without a campaign on this host."""
    with host_lock("tests of the reaper", wait_s=120):
        yield


def sleeper(owner: str) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        ["sleep", "60"], env={**os.environ, OWNER_VARIABLE: owner}, start_new_session=True
    )
    # Before its exec it still shows our environment.
    name = Path(f"/proc/{process.pid}/comm")
    until(lambda: name.read_text() == "sleep\n", "sleep")
    return process


def test_orphans_die_and_children_of_the_living_do_not() -> None:
    dead = sleeper("999999999:1")
    # The same process id with another start time means that the harness is dead.
    recycled = sleeper(f"{os.getpid()}:1")
    alive = sleeper(f"{os.getpid()}:{start_time(os.getpid())}")
    try:
        reaped = reap()
        assert {dead.pid, recycled.pid} <= set(reaped.processes)
        assert alive.pid not in reaped.processes and alive.poll() is None
        assert dead.wait(5) == recycled.wait(5) == -9
    finally:
        for process in (dead, recycled, alive):
            process.kill()
            process.wait()


def test_groups_are_removed_with_what_is_in_them() -> None:
    cpu = sorted(os.sched_getaffinity(0))[0]
    paths = CgroupMaker().make("test-leftover", Limits(cores=1), [cpu])
    folders = {*paths.folders.values(), *([paths.unified] if paths.unified else [])}
    member = subprocess.Popen(["sleep", "60"])
    for folder in folders:
        (folder / "cgroup.procs").write_text(str(member.pid))
    reaped = reap()
    assert folders <= set(reaped.groups)
    assert not any(folder.exists() for folder in folders)
    assert member.wait(5) == -9


@pytest.mark.parametrize("before", [None, "1:2"])
def test_marking_names_this_very_process_and_ends(
    before: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A notebook goes on after its campaign, and what it starts then is not ours."""
    monkeypatch.setenv(OWNER_VARIABLE, before or "")
    if before is None:
        monkeypatch.delenv(OWNER_VARIABLE)
    with mark_children():
        assert os.environ[OWNER_VARIABLE] == f"{os.getpid()}:{start_time(os.getpid())}"
    assert os.environ.get(OWNER_VARIABLE) == before


def test_reaped_reads_as_words() -> None:
    assert str(Reaped()) == ""
    assert str(Reaped(containers=["a", "b"], processes=[1])) == "2 containers, 1 processes"
