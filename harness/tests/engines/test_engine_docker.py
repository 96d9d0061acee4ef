# SPDX-License-Identifier: Apache-2.0
"""The docker engine with a stand-in image: a shell script on the bare base image."""

import contextlib
import io
import json
import os
import re
import socket
import tarfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import docker
import pandas as pd
import pytest
from docker.errors import APIError, DockerException
from harness_parts import IdleLink, device, needs_root, nodes_of_tests, run_spec
from link_parts import needs_relay
from virtual_parts import Quiet
from waiting import in_background, until

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.live_executor import LiveExecutor
from slambed.campaign.runner import Runner
from slambed.engines.base import LABEL, NodePlan
from slambed.engines.docker import DockerEngine
from slambed.engines.docker_gpu import gpu_options
from slambed.engines.live_run import LiveRun
from slambed.engines.reaper import reap
from slambed.engines.result import InterruptedRunError, RunResult
from slambed.errors import ExitCode, PassingError, SlambedError
from slambed.link.helper_link import HelperLinkOpener
from slambed.link.named_profile import read_profile
from slambed.sampling.cgroup import paths_of
from slambed.spec.device import Limits
from slambed.spec.experiment import Playback
from slambed.spec.run_spec import LinkSpec, RunSpec
from slambed.spec.runtime import RoleRuntime, Runtime

BASE = "debian:bookworm-slim"
TAG = "slambed-test:stand-in"

# Implements the file contract of a node; the system's name in run.json selects its behavior.
STAND_IN = r"""#!/bin/sh
role=$2; out=/out/$role
trap 'echo "{\"role\": \"$role\", \"stopped\": true}" > $out/node.json; exit 0' TERM
id > $out/id.txt; cat /proc/self/status > $out/status.txt; ls /sys/class/net > $out/net.txt
touch /root-is-writable 2> /dev/null && echo yes > $out/writable.txt
case $(cat /out/run.json) in *refuse*) echo "error: no, run.json; try again" >&2; exit 2;; esac
echo '{}' > $out/ready.json
until [ -e /out/start.json ]; do sleep 0.02; done
case "$role $(cat /out/run.json)" in
  "edge "*die*) sleep 0.6; exit 139;;
  "mobile "*long*|"edge "*stay*) sleep 60 & wait;;
  "mobile "*flood*) yes "a long line of a program that reports every step";;
  "mobile "*hungry*) x=$(head -c 900m /dev/zero | tr '\0' x);;
esac
[ $role = mobile ] && sleep 1
echo "{\"role\": \"$role\", \"stopped\": false}" > $out/node.json
"""


def client_or_none() -> docker.DockerClient | None:
    try:
        client = docker.from_env(timeout=60)
        client.images.get(BASE)
    except DockerException:
        return None
    return client


CLIENT = client_or_none()
pytestmark = [
    needs_root,
    pytest.mark.skipif(CLIENT is None, reason=f"needs Docker with {BASE}"),
]


@contextlib.contextmanager
def image_with(program: str, text: str, tag: str) -> Iterator[Any]:
    """The bare base image with one program."""
    assert CLIENT is not None
    context = io.BytesIO()
    with tarfile.open(fileobj=context, mode="w") as archive:
        for name, content, mode in (
            ("Dockerfile", f"FROM {BASE}\nCOPY {program} /usr/local/bin/\n", 0o644),
            (program, text, 0o755),
        ):
            info = tarfile.TarInfo(name)
            info.size, info.mode = len(content.encode()), mode
            archive.addfile(info, io.BytesIO(content.encode()))
    context.seek(0)
    built, _ = CLIENT.images.build(fileobj=context, custom_context=True, tag=tag, rm=True)
    yield built
    CLIENT.images.remove(tag, force=True)


@pytest.fixture(scope="module")
def image() -> Iterator[Any]:
    with image_with("slambed-node", STAND_IN, TAG) as built:
        yield built


class Bench:
    """Runs one spec in containers."""

    def __init__(self, folder: Path, image: Any) -> None:
        self.raw = folder / "raw"
        self.raw.mkdir()
        self.sequence = folder / "sequence"
        self.sequence.mkdir()
        self.engine = DockerEngine(CLIENT, image)
        self.stop = threading.Event()

    def run(self, spec: RunSpec) -> RunResult:
        live = LiveRun(
            spec, self.engine, self.sequence, 0.5, self.raw, lambda *_: IdleLink(), self.stop
        )
        return live.execute()


@pytest.fixture
def bench(tmp_path: Path, image: Any) -> Iterator[Bench]:
    with nodes_of_tests():
        yield Bench(tmp_path, image)
        assert CLIENT is not None
        assert CLIENT.containers.list(all=True, filters={"label": "slambed"}) == []


def docker_spec(**changes: Any) -> RunSpec:
    limits = {"cores": 1, "quota_cores": 0.5, "period_ms": 10.0, "memory_mb": 256}
    return run_spec(edge=True, engine="docker", device_mobile=device(**limits), **changes)


def test_an_image_of_another_python_than_its_packages_is_refused(bench: Bench) -> None:
    def ask(image: str, version: str) -> None:
        runtime = Runtime.model_validate(
            {
                "image": image,
                "python": {"requires": ["numpy"], "version": version},
                "mobile": {"command": ["python3", "run.py"]},
            }
        )
        assert set(bench.engine.image_ids(runtime, "mine")) == {"mobile"}

    with pytest.raises(SlambedError, match="python3 does not start in image debian:bookworm"):
        ask(BASE, "3.11")
    tag = "slambed-test:old-python"
    with image_with("python3", "#!/bin/sh\necho 3.9\n", tag):
        with pytest.raises(SlambedError, match=f"Python 3.11, and image {tag} has 3.9"):
            ask(tag, "3.11")
        ask(tag, "3.9")
    assert CLIENT is not None
    assert CLIENT.containers.list(all=True, filters={"label": f"{LABEL}=python"}) == []


def test_two_containers_complete_a_run_within_their_limits(bench: Bench) -> None:
    result = bench.run(docker_spec())
    assert (result.outcome, result.reason) == ("completed", None)
    granted = result.limits["mobile"].granted
    assert (granted.quota_cores, granted.period_ms) == (0.5, 10.0)
    assert granted.memory_mb == 256
    mobile = bench.raw / "mobile"
    assert "uid=10001 gid=10001" in (mobile / "id.txt").read_text()
    assert "CapEff:\t0000000000000000" in (mobile / "status.txt").read_text()
    assert "NoNewPrivs:\t1" in (mobile / "status.txt").read_text()
    assert (mobile / "net.txt").read_text().split() == ["lo"]
    assert not (mobile / "writable.txt").exists()
    rows = [json.loads(x) for x in (bench.raw / "samples.jsonl").read_text().splitlines()]
    assert {row["node"] for row in rows} == {"mobile", "edge"}


def test_a_program_that_prints_without_end_is_ended_and_said_so(bench: Bench) -> None:
    """The daemon keeps what it prints where nobody else sees how large that is."""
    began_s = time.monotonic()
    result = bench.run(docker_spec(params={"x": "flood"}, max_run_mb=8))
    assert result.outcome == "died" and time.monotonic() - began_s < 25
    assert "more than 8 MiB (max_run_mb of the experiment)" in (result.reason or "")
    assert "the largest is mobile/log.txt with 8 MiB" in (result.reason or "")
    assert result.invalid_reasons == []


def test_the_daemon_keeps_no_more_of_the_output_than_the_limit(bench: Bench) -> None:
    plan = NodePlan(
        role="mobile",
        run_key="cafe",
        run_dir=bench.raw,
        sequence=bench.sequence,
        limits=Limits(),
        cpus=[0],
        limit_bytes=5 << 20,
    )
    node = bench.engine.start(plan)
    try:
        assert CLIENT is not None
        host = CLIENT.containers.get("slambed-cafe-mobile").attrs["HostConfig"]
        assert host["LogConfig"]["Config"] == {"max-size": "5242880", "max-file": "2"}
        limit = Path(f"/proc/{node.pid}/limits").read_text()
        assert re.search(r"Max file size +5242880 +5242880", limit), limit
    finally:
        node.remove()


def test_containers_go_before_others_as_the_nodes_of_engine_local_do(bench: Bench) -> None:
    assert CLIENT is not None
    ours = CLIENT.info()["CgroupDriver"] == "cgroupfs"
    plan = NodePlan(
        role="mobile",
        run_key="cafe",
        run_dir=bench.raw,
        sequence=bench.sequence,
        limits=Limits(quota_cores=0.5, period_ms=10.0),
        cpus=[0],
    )
    node = bench.engine.start(plan)
    try:
        paths = paths_of(node.pid)
        group = paths.v1("cpu") or paths.unified
        assert group is not None
        assert (group.parent.name == "slambed") == ours, "systemd puts containers in its slices"
        file, largest = ("cpu.shares", 262144) if paths.v1("cpu") else ("cpu.weight", 10000)
        assert not ours or (group.parent / file).read_text() == f"{largest}\n"
    finally:
        node.remove()


def test_a_gpu_is_asked_for_and_a_daemon_without_one_is_reported_before_anything_plays(
    bench: Bench, image: Any
) -> None:
    """Checks the request that the daemon stores; this needs no GPU."""
    assert CLIENT is not None
    kept = CLIENT.containers.create(image.id, entrypoint=["/bin/true"], **gpu_options("all"))
    reported = None
    try:
        (request,) = kept.attrs["HostConfig"]["DeviceRequests"]
        assert (request["Count"], request["Capabilities"]) == (-1, [["gpu"]])
        try:
            kept.start()
        except APIError as refused:
            reported = str(refused.explanation)
    finally:
        kept.remove(force=True)
    runtime = Runtime(image=TAG, mobile=RoleRuntime(command=["x"], gpu=1))
    if reported is None:
        assert bench.engine.image_ids(runtime, "mine")
    else:
        with pytest.raises(SlambedError, match="system mine asks for a GPU") as error:
            bench.engine.image_ids(runtime, "mine")
        assert error.value.code == ExitCode.ENVIRONMENT
        assert not isinstance(error.value, PassingError) and reported in str(error.value)
    left = CLIENT.containers.list(all=True, filters={"label": f"{LABEL}=gpu"})
    assert left == []


def test_an_edge_container_that_dies_is_an_outcome(bench: Bench) -> None:
    assert bench.run(docker_spec(variant="die")).outcome == "died"


@pytest.mark.parametrize(("role", "variant"), [("mobile", "long"), ("edge", "stay")])
@pytest.mark.parametrize(
    ("number", "expected"),
    [("SIGKILL", "was killed from outside"), ("SIGTERM", "was asked to stop")],
)
def test_a_container_ended_from_outside_is_no_result(
    bench: Bench, role: str, variant: str, number: str, expected: str
) -> None:
    """Docker reports exit code 137, as for a node at its memory limit."""

    def end() -> None:
        until((bench.raw / "start.json").exists, "start.json")
        assert CLIENT is not None
        (container,) = CLIENT.containers.list(filters={"label": f"slambed.role={role}"})
        container.kill(number)

    with in_background(end):
        result = bench.run(docker_spec(variant=variant, playback=Playback(end_s=1.0)))
    assert result.outcome == "died" and expected in str(result.reason)
    assert [f"the {role} node {expected}" in line for line in result.invalid_reasons] == [True]


def test_a_container_that_refuses_is_an_outcome_with_its_own_words(bench: Bench) -> None:
    result = bench.run(docker_spec(variant="refuse"))
    assert result.outcome == "refused"
    assert (result.reason or "").endswith("(exit code 2): no, run.json; try again")


def test_memory_beyond_the_limit_kills_the_node_and_says_so(bench: Bench) -> None:
    spec = docker_spec(variant="hungry", playback=Playback(end_s=20.0))
    result = bench.run(spec)
    assert result.outcome == "died"
    assert "killed at its memory limit" in (result.reason or "")


def test_a_stop_request_ends_containers_quickly(bench: Bench) -> None:
    threading.Timer(1.5, bench.stop.set).start()
    began = time.monotonic()
    with pytest.raises(InterruptedRunError):
        bench.run(docker_spec(variant="long"))
    # Containers are slow on a busy host, but waiting for the node would have taken longer.
    assert time.monotonic() - began < 60


def test_containers_of_a_dead_harness_are_removed(bench: Bench) -> None:
    (bench.raw / "run.json").write_text("{}")
    plan = NodePlan(
        "mobile",
        "leftover",
        bench.raw,
        bench.sequence,
        docker_spec().device_mobile.limits,
        sorted(os.sched_getaffinity(0))[:1],
    )
    bench.engine.start(plan)
    assert "slambed-leftover-mobile" in reap().containers


def unprivileged_run(bench: Bench, during: Callable[[], None] = lambda: None) -> RunResult:
    """Runs like a member of the group docker: the engine is told that it is not root. The link
    plays a trace in a folder that no node sees."""
    bench.engine.unprivileged = True
    (bench.raw.parent / "flat.csv").write_text("time_s,rtt_ms\n0,30\n0.5,30\n")
    curve = {"trace": {"file": "flat.csv"}}
    (bench.raw.parent / "flat.yaml").write_text(json.dumps({"name": "flat", "rtt_ms": curve}))
    profile = read_profile(str(bench.raw.parent / "flat.yaml"), "here")
    link = LinkSpec(backend="relay", profile="flat", content=profile.content)
    limits = {"cores": 1, "quota_cores": 0.8, "thread_cores": 0.3, "memory_mb": 256}
    spec = run_spec(
        edge=True, engine="docker", device_mobile=device(**limits), link=link, profile="flat"
    )
    live = LiveRun(
        spec,
        bench.engine,
        bench.sequence,
        0.5,
        bench.raw,
        HelperLinkOpener(bench.engine),
        bench.stop,
    )

    def wait_and_act() -> None:
        until((bench.raw / "start.json").exists, "start.json")
        during()

    with in_background(wait_and_act):
        return live.execute()


@needs_relay
def test_without_root_helpers_make_the_link_and_the_limits(bench: Bench) -> None:
    hosts: list[dict[str, Any]] = []

    def look() -> None:
        assert CLIENT is not None
        for name in ("sidecar", "link_helper"):
            (found,) = CLIENT.containers.list(filters={"label": f"slambed.role={name}"})
            hosts.append(found.attrs["HostConfig"])

    result = unprivileged_run(bench, look)
    assert (result.outcome, result.limits["mobile"].shortfall) == ("completed", None)
    assert {thread.cores for thread in result.limits["mobile"].threads or []} == {0.3}
    assert result.link is not None and result.link.backend == "relay"
    assert result.link.died is None and (result.link.base_rtt_ms or 0) > 0
    log = pd.read_parquet(bench.raw / "link" / "link.parquet")
    # The kernel of the node sees the latency; its accuracy is tested elsewhere.
    assert log[log["series"] == "probe_rtt_ms"]["value"].median() > 28
    rows = [json.loads(x) for x in (bench.raw / "samples.jsonl").read_text().splitlines()]
    assert {row["node"] for row in rows} == {"mobile", "edge"}
    for host in hosts:
        assert not host["Privileged"] and host["ReadonlyRootfs"] and host["CapDrop"] == ["ALL"]
    assert [len(host["CapAdd"]) for host in hosts] == [2, 5]


@needs_relay
def test_a_helper_that_is_killed_is_a_link_that_died(bench: Bench) -> None:
    def kill() -> None:
        assert CLIENT is not None
        (found,) = CLIENT.containers.list(filters={"label": "slambed.role=link_helper"})
        found.kill("SIGKILL")

    result = unprivileged_run(bench, kill)
    # The nodes' reaction to a lost link is their result; the run is invalid.
    assert result.outcome == "completed"
    assert "the link ended in the middle of the run" in result.invalid_reasons
    assert result.link is not None and "the link ended" in str(result.link.died)


class Between:
    """A proxy between the library and the daemon; while `cut` is set the daemon is unreachable."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.cut = threading.Event()
        self._server = socket.socket(socket.AF_UNIX)
        self._server.bind(str(path))
        self._server.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._server.accept()
                if self.cut.is_set():
                    client.close()
                    continue
                daemon = socket.socket(socket.AF_UNIX)
                daemon.connect("/var/run/docker.sock")
                for way in ((client, daemon), (daemon, client)):
                    threading.Thread(target=self._pass_on, args=way, daemon=True).start()

    def _pass_on(self, source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while (data := source.recv(65536)) and not self.cut.is_set():
                sink.sendall(data)
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._server.close()


def test_a_daemon_that_is_away_for_a_while_costs_a_run_an_attempt(
    tmp_path: Path, image: Any
) -> None:
    """The daemon disappears during the first run: its containers remain without blocking later
    runs."""
    between = Between(tmp_path / "docker.sock")
    client = docker.DockerClient(f"unix://{between.path}", timeout=10)
    folder = ResultFolder(tmp_path / "results" / "tiny")
    folder.create()
    ledger = Ledger(folder.path / "ledger.jsonl")
    (tmp_path / "sequence").mkdir()
    played = {"room": (tmp_path / "sequence", 0.5)}
    executor = LiveExecutor(DockerEngine(client, image), lambda *_: IdleLink(), played)
    todo = [docker_spec(seed=n, repetition=n) for n in range(2)]

    def cut_once() -> None:
        until(lambda: list((tmp_path / "results").rglob("start.json")), "the start of a run")
        between.cut.set()
        try:
            until(lambda: "run_failed" in {entry["event"] for entry in ledger.read()}, "run_failed")
        finally:
            between.cut.clear()

    with nodes_of_tests(), in_background(cut_once):
        verdict = Runner(folder, ledger, executor, retries=0, pauses_s=(0.5, 1)).run(todo, Quiet())
        assert CLIENT is not None
        assert CLIENT.containers.list(all=True, filters={"label": "slambed"}) == []
    between.close()
    folder.close()
    assert (verdict.done, verdict.given_up) == (2, {})
    failed = [entry for entry in ledger.read() if entry["event"] == "run_failed"]
    # The second run may still be affected.
    assert failed[0]["run_key"] == todo[0].run_key and len(failed) <= 2
    assert all("Docker did not answer" in entry["error"] for entry in failed)
