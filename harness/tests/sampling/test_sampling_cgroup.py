# SPDX-License-Identifier: Apache-2.0
"""cgroups, read on this host and on copied v1 and v2 trees."""

import json
import os
import socket
import subprocess
import threading
import time
from pathlib import Path
from unittest.mock import Mock

import pytest
from harness_parts import needs_root
from waiting import LIMIT_S

from slambed.engines.cgroups import CgroupMaker, entry_files, remove
from slambed.link.scratch import two_namespaces
from slambed.process.namespaces import inside
from slambed.sampling.cgroup import (
    CgroupPaths,
    CgroupReader,
    Mount,
    Usage,
    mounted,
    paths_of,
    version,
)
from slambed.sampling.sampler import NodeWatch, Sampler
from slambed.sampling.tasks import Pressure, RunQueueDelay
from slambed.sampling.tcp_info import TcpState, TcpWatch, newest
from slambed.spec.device import Limits

MOUNTINFO_HYBRID = """\
25 30 0:23 / /sys/fs/cgroup ro - tmpfs tmpfs ro,mode=755
26 25 0:24 / /sys/fs/cgroup/unified rw,nosuid shared:9 - cgroup2 cgroup2 rw
27 25 0:25 / /sys/fs/cgroup/cpu,cpuacct rw - cgroup cgroup rw,cpu,cpuacct
28 25 0:26 / /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory
"""


def test_mounts_of_both_versions_are_distinguished(tmp_path: Path) -> None:
    mountinfo = tmp_path / "mountinfo"
    mountinfo.write_text(MOUNTINFO_HYBRID)
    v1, v2 = mounted(mountinfo)
    both = Path("/sys/fs/cgroup/cpu,cpuacct")
    assert v1 == {"cpu": both, "cpuacct": both, "memory": Path("/sys/fs/cgroup/memory")}
    assert v2 == Path("/sys/fs/cgroup/unified")


def test_a_group_is_found_inside_a_container() -> None:
    seen = Mount(frozenset({"cpu"}), Path("/sys/fs/cgroup/cpu"), "/docker/abc")
    assert seen.folder("/docker/abc/slambed/x") == Path("/sys/fs/cgroup/cpu/slambed/x")
    assert seen.folder("/docker/abc") == Path("/sys/fs/cgroup/cpu")
    host = Mount(frozenset(), Path("/sys/fs/cgroup"), "/")
    assert host.folder("/user.slice") == Path("/sys/fs/cgroup/user.slice")


def test_usage_and_limits_of_v1(tmp_path: Path) -> None:
    files = {
        "cpuacct.usage": "2500000000\n",
        "cpu.stat": "nr_periods 100\nnr_throttled 7\nthrottled_time 300000000\n",
        "cpu.cfs_period_us": "10000\n",
        "cpu.cfs_quota_us": "5000\n",
        "cpuset.effective_cpus": "0-1\n",
        "memory.stat": "cache 999\nrss 5\ntotal_cache 999\ntotal_rss 1048576\n",
        "memory.limit_in_bytes": "9223372036854771712\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    folders = dict.fromkeys(("cpu", "cpuacct", "cpuset", "memory"), tmp_path)
    reader = CgroupReader(CgroupPaths(folders, None))
    usage, granted = reader.usage(), reader.granted()
    assert (usage.cpu_s, usage.memory_bytes) == (2.5, 1 << 20)
    assert (usage.throttled_s, usage.throttled_periods, usage.periods) == (0.3, 7, 100)
    assert (granted.cpus, granted.quota_cores, granted.period_ms) == ("0-1", 0.5, 10.0)
    assert granted.memory_mb is None


def test_usage_and_limits_of_v2(tmp_path: Path) -> None:
    files = {
        "cpu.stat": "usage_usec 2500000\nnr_periods 9\nnr_throttled 2\nthrottled_usec 4000\n",
        "cpu.max": "5000 10000\n",
        "cpuset.cpus.effective": "1\n",
        "memory.stat": "anon 2097152\nfile 999\n",
        "memory.max": "268435456\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    reader = CgroupReader(CgroupPaths({}, tmp_path))
    usage, granted = reader.usage(), reader.granted()
    assert (usage.cpu_s, usage.memory_bytes, usage.throttled_s) == (2.5, 2 << 20, 0.004)
    assert (granted.cpus, granted.quota_cores, granted.memory_mb) == ("1", 0.5, 256.0)


def test_limits_are_written_to_a_v2_tree(tmp_path: Path) -> None:
    (tmp_path / "slambed").mkdir()
    (tmp_path / "cgroup.controllers").write_text("cpuset cpu io memory\n")
    limits = Limits(cores=1, quota_cores=0.25, period_ms=20, memory_mb=128)
    paths = CgroupMaker(v2=tmp_path, found=False).make("run-mobile", limits, [1])
    group = tmp_path / "slambed" / "run-mobile"
    assert paths.unified == group
    assert (group / "cpu.max").read_text() == "5000 20000"
    assert (group / "cpuset.cpus").read_text() == "1"
    assert (group / "memory.max").read_text() == str(128 << 20)
    assert (tmp_path / "cgroup.subtree_control").exists()


def test_this_process_is_in_a_group_that_counts() -> None:
    assert version() in ("v1", "v2")
    reader = CgroupReader(paths_of(os.getpid()))
    assert reader.usage().cpu_s > 0


@needs_root
def test_a_group_limits_a_busy_process_and_is_removed(tmp_path: Path) -> None:
    limits = Limits(cores=1, quota_cores=0.2, period_ms=10, memory_mb=128)
    cpu = sorted(os.sched_getaffinity(0))[0]
    paths = CgroupMaker().make("test-busy", limits, [cpu])
    reader = CgroupReader(paths)
    granted = reader.granted()
    assert granted.quota_cores == pytest.approx(0.2)
    # A kernel for one CPU has no cpuset.
    has_cpuset = paths.v1("cpuset") or (paths.unified and (paths.unified / "cpuset.cpus").exists())
    assert granted.cpus == (str(cpu) if has_cpuset else "")
    assert granted.memory_mb == 128.0
    join = "".join(f"echo $$ > {file};" for file in entry_files(paths))
    busy = subprocess.Popen(["/bin/sh", "-c", f"{join} while :; do :; done"])
    watch = NodeWatch("mobile", reader, RunQueueDelay(busy.pid), Pressure(paths.unified))
    try:
        with (tmp_path / "samples.jsonl").open("w") as out:
            sampler = Sampler([watch], out)
            t0_ns = time.monotonic_ns()
            for _ in range(6):
                sampler.sample(t0_ns)
                time.sleep(0.1)
    finally:
        folders = {*paths.folders.values(), *([paths.unified] if paths.unified else [])}
        assert all(remove(folder) for folder in folders)
        busy.wait()
    rows = [json.loads(line) for line in (tmp_path / "samples.jsonl").read_text().splitlines()]
    assert len(rows) == 6
    assert rows[0]["cpu_percent"] is None
    assert rows[-1]["throttled_periods"] > 0
    # The quota is an upper limit, independent of other load.
    assert rows[-1]["cpu_s"] - rows[0]["cpu_s"] < 0.2 * (rows[-1]["t_s"] - rows[0]["t_s"]) + 0.05
    assert not any(folder.exists() for folder in folders)
    # The cgroup has gone: no row and no error.
    sampler.sample(t0_ns)
    assert sampler.last()["mobile"].throttled_periods == rows[-1]["throttled_periods"]


def test_time_on_the_run_queue_is_counted_over_threads_that_ended() -> None:
    delay = RunQueueDelay(os.getpid())
    thread = threading.Thread(target=time.sleep, args=(0.2,), daemon=True)
    thread.start()
    first = delay.seconds()
    thread.join(LIMIT_S)
    assert not thread.is_alive()
    second = delay.seconds()
    assert first is not None and second is not None and second >= first >= 0
    assert RunQueueDelay(1 << 22).seconds() is None


def test_files_of_ended_threads_are_closed() -> None:
    """Some programs start threads for every frame."""
    delay = RunQueueDelay(os.getpid())
    for _ in range(5):
        thread = threading.Thread(target=time.sleep, args=(0.05,), daemon=True)
        thread.start()
        delay.seconds()
        thread.join(LIMIT_S)
    delay.seconds()
    links = [Path(f"/proc/self/fd/{fd}").readlink() for fd in delay._files._fds.values()]
    assert links and all(link.exists() for link in links)
    delay.close()


def test_counters_of_a_cgroup_that_began_again_are_added() -> None:
    """Docker's restart makes a cgroup of the same path, which is read before anybody says so."""
    counted = iter([1.0, 3.0, 0.25, 0.5, 0.125, 2.0])
    reader = Mock()
    reader.usage = lambda: Usage(next(counted), 1, 0.5, 1, 1)
    watch = NodeWatch("edge", reader, Mock(), Mock())
    found = [watch.usage() for _ in range(6)]
    assert [usage.cpu_s for usage in found] == [1.0, 3.0, 3.25, 3.5, 3.625, 5.5]
    assert [usage.throttled_s for usage in found] == [0.5, 0.5, 1.0, 1.0, 1.5, 1.5]


def test_pressure_is_the_groups_own_where_it_has_it(tmp_path: Path) -> None:
    (tmp_path / "cpu.pressure").write_text(
        "some avg10=0.00 avg60=0.00 avg300=0.00 total=2500000\nfull avg10=0.00 total=7\n"
    )
    assert Pressure(tmp_path).seconds() == 2.5
    host = Pressure(None).seconds()
    assert (host is not None) == Path("/proc/pressure/cpu").exists()


def tcp_info(last_ack_ms: int, rtt_us: int, retransmits: int) -> bytes:
    words = bytearray(232)
    for offset, value in ((56, last_ack_ms), (68, rtt_us), (100, retransmits)):
        words[offset : offset + 4] = value.to_bytes(4, "little")
    return bytes(words)


def test_the_connection_that_was_acknowledged_last_reports_the_rtt() -> None:
    state = newest([tcp_info(900, 10_000, 1), tcp_info(20, 42_500, 2), b"short"])
    assert state == TcpState(rtt_ms=42.5, retransmits=3)
    assert newest([]) is None


@needs_root
def test_tcp_connections_are_found_without_help_of_their_processes() -> None:
    with two_namespaces() as (namespace, _):
        watch = TcpWatch(namespace)
        assert watch.read() is None
        inside(namespace, lambda: subprocess.run(["ip", "link", "set", "lo", "up"], check=True))
        server = inside(namespace, lambda: socket.create_server(("127.0.0.1", 0)))
        address = server.getsockname()
        with server, inside(namespace, lambda: socket.create_connection(address, 5)) as client:
            peer, _ = server.accept()
            with peer:
                client.sendall(b"x")
                peer.recv(1)
                state = watch.read()
        watch.close()
    assert state is not None and 0 < state.rtt_ms < 1000 and state.retransmits == 0
