# SPDX-License-Identifier: Apache-2.0
"""Thread caps in cgroups: on a copied v2 tree, and on this host's tree, v1 or v2. (`make
test-netem` runs these tests on a kernel with cgroup v2.)"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from harness_parts import needs_root

from slambed.engines.base import thread_invalid_reasons
from slambed.engines.cgroups import CgroupMaker, below, entry_files, remove
from slambed.engines.thread_caps import ThreadCaps
from slambed.sampling.cgroup import CgroupPaths, version
from slambed.sampling.record import ThreadCap
from slambed.spec.device import Limits

LIMITS = Limits(quota_cores=0.8, thread_cores=0.25, period_ms=10)
THREE_THREADS = """
import threading, time
for _ in range(2): threading.Thread(target=time.sleep, args=(600,), daemon=True).start()
print("ready", flush=True)
time.sleep(600)
"""
BURNING_THREAD = """
import sys, threading
stopped = threading.Event()
def burn():
    while not stopped.is_set(): pass
print("ready", flush=True)
thread = threading.Thread(target=burn)
thread.start()
sys.stdin.readline()
stopped.set()
thread.join()
sys.stdin.read()
"""


def scan_until(caps: ThreadCaps, done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not done() and time.monotonic() < deadline:
        caps.scan()
        time.sleep(0.01)
    assert done()


def entering(paths: CgroupPaths) -> str:
    """Returns shell code that moves the shell to the cgroup."""
    return "".join(f"echo $$ > {file};" for file in entry_files(paths))


def test_a_v2_group_becomes_threaded_and_gets_its_cap(tmp_path: Path) -> None:
    caps = ThreadCaps(os.getpid(), CgroupPaths({}, tmp_path), 0.25, 10.0)
    caps.scan()
    folder = tmp_path / f"thread-{os.getpid()}"
    assert (folder / "cgroup.type").read_text() == "threaded"
    assert (tmp_path / "cgroup.subtree_control").read_text() == "+cpu"
    assert (folder / "cpu.max").read_text() == "2500 10000"
    assert (folder / "cgroup.threads").read_text() == str(os.getpid())
    assert caps.threads[os.getpid()].cores == 0.25


@pytest.fixture(name="group")
def group_of_three_threads() -> Iterator[tuple[subprocess.Popen[str], CgroupPaths]]:
    paths = CgroupMaker().make("test-threads", LIMITS, sorted(os.sched_getaffinity(0)))
    process = subprocess.Popen(
        ["/bin/sh", "-c", f'{entering(paths)} exec "$0" -c "$1"', sys.executable, THREE_THREADS],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "ready\n"
        yield process, paths
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        folders = {*paths.folders.values(), *([paths.unified] if paths.unified else [])}
        assert all(remove(folder) for folder in folders)
        assert not any(folder.exists() for folder in folders)


@needs_root
def test_the_kernel_has_each_thread_in_its_own_group(
    group: tuple[subprocess.Popen[str], CgroupPaths],
) -> None:
    process, paths = group
    caps = ThreadCaps(process.pid, paths, 0.25, 10.0)
    caps.scan()
    assert len(caps.threads) == 3
    assert caps.members() == {tid: [tid] for tid in caps.threads}
    assert {thread.cores for thread in caps.threads.values()} == {0.25}
    # The kernel's view of the thread instead of the cgroup.
    for tid in caps.threads:
        assert f"thread-{tid}" in Path(f"/proc/{process.pid}/task/{tid}/cgroup").read_text()
    caps.release()
    top = paths.v1("cpu") or paths.unified
    assert top is not None and below(top) == []
    assert process.poll() is None


@needs_root
def test_the_number_of_an_ended_process_is_nobodys(
    group: tuple[subprocess.Popen[str], CgroupPaths], monkeypatch: pytest.MonkeyPatch
) -> None:
    process, paths = group
    caps = ThreadCaps(process.pid, paths, 0.25, 10.0)
    caps.scan()
    process.kill()
    process.wait()
    caps.scan()
    # The kernel reuses the process id.
    monkeypatch.setattr("slambed.sampling.tasks.thread_ids", lambda _: [os.getpid()])
    caps.scan()
    caps.release()
    assert os.getpid() not in caps.threads
    assert "thread-" not in Path("/proc/self/cgroup").read_text()


@needs_root
def test_groups_of_ended_threads_go_and_their_throttling_stays(
    group: tuple[subprocess.Popen[str], CgroupPaths],
) -> None:
    _, paths = group
    with subprocess.Popen(
        ["/bin/sh", "-c", f'{entering(paths)} exec "$0" -c "$1"', sys.executable, BURNING_THREAD],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as burner:
        assert burner.stdin is not None and burner.stdout is not None
        assert burner.stdout.readline() == "ready\n"
        caps = ThreadCaps(burner.pid, paths, 0.1, 10.0)

        def throttled_s() -> float:
            return caps.read_throttling()[0] if len(caps.threads) >= 2 else 0.0

        scan_until(caps, lambda: throttled_s() > 0)
        seen_s = throttled_s()
        burner.stdin.write("\n")
        burner.stdin.flush()
        scan_until(caps, lambda: not all(thread.alive for thread in caps.threads.values()))
        assert burner.poll() is None
    # It ended because its standard input was closed.
    caps.scan()
    assert not any(thread.alive for thread in caps.threads.values())
    assert 0 < seen_s <= caps.read_throttling()[0]
    top = paths.v1("cpu") or paths.unified
    assert top is not None and below(top) == []


def cap(name: str, cores: float | None) -> ThreadCap:
    return ThreadCap(name=name, cores=cores, period_ms=10, throttled_s=0, throttled_periods=0)


def test_a_cap_that_was_not_granted_is_a_problem() -> None:
    good = cap("tracking", 0.25)
    assert thread_invalid_reasons("mobile", [good, good], LIMITS) == []
    assert thread_invalid_reasons("mobile", [], LIMITS) == ["mobile: no thread was capped"]
    for cores in (None, 0.5):
        (line,) = thread_invalid_reasons("mobile", [good, cap("mapping", cores)], LIMITS)
        assert line == "mobile: cap of thread mapping is not as asked"


def test_this_host_has_a_hierarchy_for_them() -> None:
    assert version() in ("v1", "v2")
