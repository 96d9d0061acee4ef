# SPDX-License-Identifier: Apache-2.0
"""The local engine and the life cycle of a live run, with a stand-in node."""

import contextlib
import json
import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import psutil
import pytest
from harness_parts import IdleLink, device, needs_root, nodes_of_tests, run_spec, stand_in
from waiting import in_background, until

from slambed.engines.base import NodePlan, allot_cpus, differences, netns, parse_cpus
from slambed.engines.cgroups import CgroupMaker, entry_files
from slambed.engines.live_run import LiveRun
from slambed.engines.local import LocalEngine, LocalNode
from slambed.engines.result import InterruptedRunError, RunResult
from slambed.engines.written_bytes import KEPT_BYTES
from slambed.errors import SlambedError
from slambed.sampling.cgroup import Granted, GroupProcesses, mounted
from slambed.spec.device import Board, Device, Limits
from slambed.spec.faults import Fault
from slambed.spec.host_speed import UNKNOWN, HostSpeed
from slambed.spec.run_spec import RunSpec

pytestmark = needs_root


class Bench:
    """Runs one spec in a temporary folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.engine = LocalEngine(stand_in(folder))
        self.link = IdleLink()
        self.stop = threading.Event()
        self.host = UNKNOWN
        self.live: LiveRun | None = None

    def run(self, spec: RunSpec) -> RunResult:
        raw = self.folder / "raw"
        raw.mkdir()
        sequence = self.folder / "sequence"
        sequence.mkdir()
        played_s = spec.playback.end_s or 0.0
        self.live = LiveRun(
            spec, self.engine, sequence, played_s, raw, self.open_link, self.stop, self.host
        )
        return self.live.execute()

    def open_link(self, *_: Any) -> IdleLink:
        return self.link

    def read(self, name: str) -> Any:
        return json.loads((self.folder / "raw" / name).read_text())


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """Removes the cgroups of nodes after every test."""
    with nodes_of_tests():
        yield Bench(tmp_path)
        left = [folder for folder in CgroupMaker().leftovers() if folder.name != "slambed"]
        assert left == []


def test_a_run_with_two_nodes_completes(bench: Bench) -> None:
    result = bench.run(run_spec(edge=True))
    assert (result.outcome, result.reason, result.invalid_reasons) == ("completed", None, [])
    assert (len(bench.link.started_s), bench.link.stopped) == (1, 1)
    raw = bench.folder / "raw"
    for role in ("mobile", "edge"):
        assert bench.read(f"{role}/node.json")["role"] == role
    config = bench.read("run.json")
    assert config["network"] == {
        "edge_address": "10.77.0.2",
        "ports": {"control": 47000, "keyframe": 47001},
    }
    samples = [json.loads(line) for line in (raw / "samples.jsonl").read_text().splitlines()]
    assert {row["node"] for row in samples} == {"mobile", "edge"}
    granted = result.limits["mobile"].granted
    assert granted.quota_cores == 0.5 and granted.memory_mb == 256


CAPPED = {"cores": 1, "quota_cores": 0.8, "thread_cores": 0.3, "period_ms": 10.0}


def test_every_thread_has_a_group_with_its_cap(bench: Bench) -> None:
    """The cap is read back from the kernel during the run, and reported in the manifest."""
    seen: list[tuple[list[int], list[int], str, str]] = []
    cpu = mounted()[0].get("cpu")
    if cpu is None:
        pytest.skip("the groups of this test are those of cgroup v1")

    def group_of(folder: Path) -> tuple[list[int], list[int], str, str]:
        return (
            [int(folder.name.removeprefix("thread-"))],
            [int(tid) for tid in (folder / "tasks").read_text().split()],
            (folder / "cpu.cfs_quota_us").read_text().strip(),
            (folder / "cpu.cfs_period_us").read_text().strip(),
        )

    def look() -> None:
        until((bench.folder / "raw" / "start.json").exists, "start.json")
        assert bench.live is not None
        group = bench.live._nodes["mobile"].reader.paths.v1("cpu")
        assert group is not None
        # On a busy host threads may still be moving; only the final state counts.
        while not over.wait(0.01) and not (len(seen) == 3 and all(g[0] == g[1] for g in seen)):
            with contextlib.suppress(OSError):  # the group may disappear while it is read
                seen[:] = [group_of(folder) for folder in group.glob("thread-*")]

    over = threading.Event()
    spec = run_spec(params={"mobile_act": "threads"}, device_mobile=device(**CAPPED))
    with in_background(look, over):
        result = bench.run(spec)
    assert result.outcome == "completed" and result.invalid_reasons == []
    assert len(seen) == 3
    for tid, members, quota, period in seen:
        assert members == tid
        assert (quota, period) == ("3000", "10000")
    threads = result.limits["mobile"].threads
    assert [thread.cores for thread in threads] == [0.3] * 3
    assert result.limits["mobile"].granted.quota_cores == 0.8
    assert result.sidecar is not None and result.sidecar.samples >= 4


def test_a_board_becomes_limits_on_this_host(bench: Bench) -> None:
    pi = Device(
        name="pi",
        title="pi",
        limits=Limits(cores=1, memory_mb=256),
        board=Board(cores=4, core_speed=0.2),
    )
    bench.host = HostSpeed(2.0, 0.01, "2026-01-01T00:00:00Z")
    result = bench.run(run_spec(device_mobile=pi))
    mobile = result.limits["mobile"]
    assert result.invalid_reasons == []
    assert (mobile.asked.quota_cores, mobile.asked.thread_cores) == (0.4, 0.1)
    assert mobile.granted.quota_cores == 0.4
    assert mobile.host_speed.speed == 2.0 and mobile.shortfall is None
    assert {thread.cores for thread in mobile.threads} == {0.1}


def test_a_system_without_an_edge_has_no_network(bench: Bench) -> None:
    assert bench.run(run_spec()).outcome == "completed"
    assert bench.read("run.json")["network"] is None
    assert not (bench.folder / "raw" / "edge").exists()
    assert bench.link.started_s == []


def test_the_quota_holds_and_throttling_is_reported(bench: Bench) -> None:
    spec = run_spec(params={"mobile_act": "burn"}, device_mobile=device(cores=1, quota_cores=0.2))
    result = bench.run(spec)
    assert result.throttling["mobile"].throttled_periods > 0


CAPABILITY_SETS = ("CapInh:", "CapPrm:", "CapEff:", "CapBnd:", "CapAmb:")


def test_a_node_is_nobody_in_particular_and_may_only_read(bench: Bench) -> None:
    """The input lies below private folders, like a home folder; the output belongs to the node."""
    bench.folder.chmod(0o700)
    assert bench.run(run_spec()).outcome == "completed"
    mobile = bench.folder / "raw" / "mobile"
    assert mobile.stat().st_uid == (mobile / "events.jsonl").stat().st_uid == 10001
    assert (bench.folder / "raw" / "run.json").stat().st_uid == 0


def test_a_node_at_the_start_barrier_has_its_own_network(bench: Bench) -> None:
    raw = bench.folder / "raw"
    (raw / "mobile").mkdir(parents=True)
    plan = NodePlan("mobile", "gate", raw, bench.folder, Limits(), sorted(os.sched_getaffinity(0)))
    node = bench.engine.start(plan)
    try:
        assert netns(node.pid) == node.namespace
        assert node.namespace.readlink() != Path("/proc/self/ns/net").readlink()
        assert node.exit_code() is None
        status = Path(f"/proc/{node.pid}/status").read_text()
        assert "NoNewPrivs:\t1" in status
        assert "Uid:\t10001\t10001\t10001\t10001" in status
        assert "Gid:\t10001\t10001\t10001\t10001" in status and "\nGroups:\t \n" in status
        sets = [line.split() for line in status.splitlines() if line.startswith("Cap")]
        # CAP_DAC_READ_SEARCH alone
        assert {name: int(held, 16) for name, held in sets} == dict.fromkeys(
            CAPABILITY_SETS, 1 << 2
        )
    finally:
        node.remove()
    assert not Path(f"/proc/{node.pid}").exists()
    node.remove()


def test_an_edge_that_dies_is_an_outcome_and_the_mobile_goes_on(bench: Bench) -> None:
    result = bench.run(run_spec(edge=True, params={"edge_act": "die"}))
    assert result.outcome == "died"
    assert "signal 11" in (result.reason or "")
    assert len((bench.folder / "raw/mobile/events.jsonl").read_text().splitlines()) == 5


def test_a_mobile_that_dies_is_an_outcome(bench: Bench) -> None:
    result = bench.run(run_spec(edge=True, params={"mobile_act": "die"}))
    assert result.outcome == "died"


@pytest.mark.parametrize(
    ("act", "largest"),
    [("flood", "mobile/log.txt"), ("many", "files, the largest is")],
    ids=["log", "files"],
)
def test_a_system_that_writes_without_end_is_ended_and_said_so(
    bench: Bench, act: str, largest: str
) -> None:
    result = bench.run(run_spec(edge=True, params={"mobile_act": act}, max_run_mb=20))
    assert result.outcome == "died" and result.invalid_reasons == []
    assert "more than 20 MiB (max_run_mb of the experiment)" in (result.reason or "")
    assert largest in (result.reason or "")
    # What is kept of it is short, and the limit is also the kernel's for each file.
    log = bench.folder / "raw" / "mobile" / "log.txt"
    assert log.stat().st_size <= KEPT_BYTES
    events = bench.folder / "raw" / "mobile" / "events.jsonl"
    assert len(events.read_text().splitlines()) == 5


def test_a_mobile_that_prints_too_much_before_it_is_ready_is_ended(bench: Bench) -> None:
    (bench.folder / "slambed-node").write_text("#!/bin/sh\nexec yes\n")
    began_s = time.monotonic()
    result = bench.run(run_spec(max_run_mb=5))
    assert result.outcome == "died" and "more than 5 MiB" in (result.reason or "")
    assert time.monotonic() - began_s < 15


def test_no_file_of_a_node_grows_beyond_the_limit(bench: Bench) -> None:
    """Not even one that nobody counts: outside of the run folder, or deleted while open."""
    raw = bench.folder / "raw"
    (raw / "mobile").mkdir(parents=True)
    cpus = sorted(os.sched_getaffinity(0))
    plan = NodePlan("mobile", "gate", raw, bench.folder, Limits(), cpus, limit_bytes=3 << 20)
    node = bench.engine.start(plan)
    try:
        limits = Path(f"/proc/{node.pid}/limits").read_text()
        assert re.search(r"Max file size +3145728 +3145728", limits), limits
    finally:
        node.remove()


def test_memory_beyond_the_limit_kills_the_node_and_says_so(bench: Bench) -> None:
    result = bench.run(run_spec(params={"mobile_act": "hungry"}))
    assert result.outcome == "died"
    assert "killed at its memory limit" in (result.reason or "")


def test_a_link_that_dies_is_an_outcome(bench: Bench) -> None:
    bench.link = IdleLink(dies_after_s=0.3)
    result = bench.run(run_spec(edge=True))
    assert result.outcome == "completed"
    assert result.invalid_reasons == ["the link ended in the middle of the run"]


def test_a_run_that_does_not_end_is_a_timeout(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slambed.engines.result.DRAIN_S", 0.5)
    monkeypatch.setattr("slambed.engines.live_run.STOP_GRACE_S", 0.2)
    result = bench.run(run_spec(params={"mobile_act": "hang"}))
    assert result.outcome == "timed_out"


def test_a_node_that_refuses_its_input_is_an_outcome_with_its_own_words(bench: Bench) -> None:
    result = bench.run(run_spec(edge=True, params={"mobile_act": "refuse"}))
    assert result.outcome == "refused"
    assert re.search("mobile node .*: bad parameter, run.json", result.reason or "")


def test_a_missing_program_is_an_error(bench: Bench) -> None:
    bench.engine = LocalEngine(bench.folder / "nothing")
    with pytest.raises(SlambedError, match="No such file"):
        bench.run(run_spec())


def test_a_stop_request_ends_a_run_quickly(bench: Bench) -> None:
    def stop_once_it_runs() -> None:
        until((bench.folder / "raw" / "mobile" / "events.jsonl").exists, "the first events")
        bench.stop.set()

    began = time.monotonic()
    with in_background(stop_once_it_runs), pytest.raises(InterruptedRunError):
        bench.run(
            run_spec(edge=True, playback=run_spec().playback.model_copy(update={"end_s": 60}))
        )
    assert time.monotonic() - began < 30
    assert bench.read("mobile/node.json")["stopped"] is True


def test_an_edge_asked_to_stop_from_outside_has_died(bench: Bench) -> None:
    spec = run_spec(edge=True, playback=run_spec().playback.model_copy(update={"end_s": 1.5}))

    def stop_edge() -> None:
        until((bench.folder / "raw" / "edge" / "events.jsonl").exists, "the edge's first events")
        assert bench.live is not None
        os.kill(bench.live._nodes["edge"].pid, signal.SIGTERM)

    with in_background(stop_edge):
        result = bench.run(spec)
    assert result.outcome == "died"
    # As when a daemon stops: this is not counted as the system's own end.
    assert result.invalid_reasons == ["the edge node was asked to stop from outside"]


PF_EXITING = 0x4
"""Flag of a process in /proc/<pid>/stat (proc(5))."""


@dataclass
class EdgeProbe(IdleLink):
    """An idle link that inspects the edge's process in each liveness check."""

    bench: Bench | None = None
    seen: list[tuple[int, str, str, str]] = field(default_factory=list)
    """Process id, state, network namespace and cgroups, recorded at each change."""

    def alive(self) -> bool:
        assert self.bench is not None and self.bench.live is not None
        pid = self.bench.live._nodes["edge"].pid
        # An ending process first gets PF_EXITING, then leaves its cgroups and namespaces, and is
        # finally a zombie. Reading the flag last ensures that the other values belong to a running
        # process.
        try:
            groups = Path(f"/proc/{pid}/cgroup").read_text()
            network = str(netns(pid).readlink())
            fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return True
        state, flags = fields[0], int(fields[6])
        if flags & PF_EXITING:
            return True
        # Running and sleeping are equivalent here.
        look = (pid, "T" if state == "T" else "", network, re.sub("/thread-[0-9]+", "", groups))
        if not self.seen or self.seen[-1] != look:
            self.seen.append(look)
        return True


def run_with(bench: Bench, *faults: Fault, **changes: Any) -> tuple[RunResult, EdgeProbe]:
    bench.link = probe = EdgeProbe(bench=bench)
    playback = run_spec().playback.model_copy(update={"end_s": 2.0})
    return bench.run(run_spec(edge=True, playback=playback, faults=[*faults], **changes)), probe


def faults_of(bench: Bench) -> list[tuple[str, str]]:
    lines = (bench.folder / "raw" / "faults.jsonl").read_text().splitlines()
    return [(event["type"], event["fault"]) for event in map(json.loads, lines)]


def test_an_edge_killed_on_purpose_does_not_spoil_the_run(bench: Bench) -> None:
    result, _ = run_with(bench, Fault(at_s=0.4, edge="kill"))
    assert (result.outcome, result.reason, result.invalid_reasons) == ("completed", None, [])
    assert faults_of(bench) == [("fault_began", "kill")]
    assert not (bench.folder / "raw/edge/node.json").exists()


def test_a_killed_edge_starts_again_where_it_was(bench: Bench) -> None:
    cap = device("big", **CAPPED)
    kill, again = Fault(at_s=0.4, edge="kill"), Fault(at_s=0.8, edge="restart")
    result, probe = run_with(bench, kill, again, device_edge=cap)
    assert (result.outcome, result.reason, result.invalid_reasons) == ("completed", None, [])
    assert faults_of(bench) == [("fault_began", "kill"), ("fault_ended", "kill")]
    first, second = probe.seen[0], probe.seen[-1]
    assert first[0] != second[0]
    assert first[1:] == second[1:]  # same namespace and cgroups
    assert bench.read("edge/node.json")["stopped"] is False
    threads = result.limits["edge"].threads
    assert len(threads) >= 2 and {thread.cores for thread in threads} == {0.3}
    samples = [json.loads(x) for x in (bench.folder / "raw/samples.jsonl").read_text().splitlines()]
    cpu_s = [row["cpu_s"] for row in samples if row["node"] == "edge"]
    assert cpu_s == sorted(cpu_s)


def test_a_frozen_edge_stands_still_and_goes_on(bench: Bench) -> None:
    result, probe = run_with(bench, Fault(at_s=0.4, edge="freeze", for_s=0.5))
    assert (result.outcome, result.reason, result.invalid_reasons) == ("completed", None, [])
    assert [state for _, state, _, _ in probe.seen] == ["", "T", ""], probe.seen
    assert len({pid for pid, _, _, _ in probe.seen}) == 1
    assert faults_of(bench) == [("fault_began", "freeze"), ("fault_ended", "freeze")]


def test_all_that_a_users_program_started_is_frozen_woken_and_killed() -> None:
    """Its own children have process groups of their own."""
    paths = CgroupMaker().make("test-several", Limits(), sorted(os.sched_getaffinity(0)))
    join = "".join(f"echo $$ > {file}; " for file in entry_files(paths))
    child = "setsid sh -c 'while :; do sleep 0.01; done' & wait"
    process = subprocess.Popen(["/bin/sh", "-c", join + child], stdin=subprocess.PIPE)
    node = LocalNode("edge", process, paths, several_processes=True)
    group = GroupProcesses(paths)
    try:
        until(lambda: len(group.pids()) >= 2, "its child")
        node.freeze(True)
        until(node.is_frozen, "the freeze")
        # A shell that has just started a program waits for it in the kernel, and stops then.
        asleep = {psutil.STATUS_STOPPED, psutil.STATUS_DISK_SLEEP, psutil.STATUS_ZOMBIE}
        frozen = group.pids()
        assert len(frozen) >= 2
        for _ in range(10):
            assert {psutil.Process(pid).status() for pid in frozen} <= asleep
            assert group.pids() == frozen
            time.sleep(0.01)
        node.freeze(False)
        until(lambda: not node.is_frozen(), "the end of the freeze")
        node.kill()
        until(lambda: not group.pids(), "the end of all")
    finally:
        node.remove()


def test_an_edge_frozen_at_the_end_may_still_end(bench: Bench) -> None:
    result, _ = run_with(bench, Fault(at_s=1.5, edge="freeze", for_s=60))
    assert (result.outcome, result.reason, result.invalid_reasons) == ("completed", None, [])
    assert bench.read("edge/node.json")["stopped"] is False


def test_a_frozen_edge_can_end_when_the_run_takes_too_long(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("slambed.engines.result.DRAIN_S", 0.5)
    result, _ = run_with(
        bench, Fault(at_s=0.4, edge="freeze", for_s=60), params={"mobile_act": "hang"}
    )
    assert result.outcome == "timed_out"
    assert faults_of(bench) == [("fault_began", "freeze"), ("fault_ended", "freeze")]
    assert (bench.folder / "raw/edge/node.json").exists()


def test_an_edge_that_dies_after_a_restart_is_an_accident(bench: Bench) -> None:
    kill, again = Fault(at_s=0.1, edge="kill"), Fault(at_s=0.15, edge="restart")
    result, _ = run_with(bench, kill, again, params={"edge_act": "die"})
    assert result.outcome == "died" and "signal 11" in (result.reason or "")


def test_cpus_are_kept_apart_where_there_are_enough() -> None:
    one, two = Limits(cores=1), Limits(cores=2)
    assert allot_cpus(one, one, [0, 1]) == {"mobile": [0], "edge": [1]}
    assert allot_cpus(two, two, [0, 1, 2]) == {"mobile": [0, 1], "edge": [1, 2]}
    assert allot_cpus(Limits(), None, [0, 1]) == {"mobile": [0, 1]}
    assert allot_cpus(one, one, [3]) == {"mobile": [3], "edge": [3]}


def test_a_limit_that_was_not_granted_is_found() -> None:
    asked = Limits(cores=1, quota_cores=0.5, memory_mb=128)
    good = Granted(cpus="1", quota_cores=0.5, period_ms=10.0, memory_mb=128.0)
    assert differences(asked, good, [1]) == []
    assert "CPU quota" in differences(asked, replace(good, quota_cores=None), [1])[0]
    assert "CPUs 0-1" in differences(asked, replace(good, cpus="0-1"), [1])[0]
    assert "memory" in differences(asked, replace(good, memory_mb=None), [1])[0]


def test_kernel_cpu_lists() -> None:
    assert parse_cpus("0-2,5") == [0, 1, 2, 5]
    assert parse_cpus("") == []
