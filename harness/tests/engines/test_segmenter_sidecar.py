# SPDX-License-Identifier: Apache-2.0
"""The segmenter of live runs in each engine: placement, permissions and end."""

import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness_parts import (
    IdleLink,
    device,
    needs_root,
    nodes_of_tests,
    run_spec,
    segmenters,
    stand_in,
)
from waiting import until

from slambed.engines.base import NODE_UID, Node, NodePlan, SegmenterSidecar
from slambed.engines.live_run import LiveRun
from slambed.engines.local import LocalEngine
from slambed.engines.result import RunResult
from slambed.engines.segmenter import FOLDER, LOG, SOCKET
from slambed.errors import ExitCode, SlambedError
from slambed.segment.mask_cache import encode_frame
from slambed.segment.masks import encode_jpeg
from slambed.segment.network import load_network
from slambed.segment.segmenter import Segmenter
from slambed.spec.device import Limits
from slambed.spec.masks import Masks

OURS = "slambed_people"
NETWORKS = Path(__file__).parents[3] / "catalog" / "networks"
pytestmark = needs_root


class EdgeBench:
    """An edge at the start barrier, with segmenters on request."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.engine = LocalEngine(stand_in(folder))
        self.plan = NodePlan("edge", "segtest", folder, folder, Limits(), [0])
        self.edge: Node = self.engine.start(self.plan)
        self.started: list[SegmenterSidecar] = []

    def start(self, network: str = OURS) -> SegmenterSidecar:
        process = self.engine.start_segmenter(self.plan, self.edge, network)
        self.started.append(process)
        process.await_ready(lambda: False)
        return process

    def close(self) -> None:
        for process in self.started:
            process.close()
        self.edge.remove()


@pytest.fixture
def edge_bench(tmp_path: Path) -> Iterator[EdgeBench]:
    with nodes_of_tests():
        made = EdgeBench(tmp_path)
        yield made
        made.close()


def test_it_lives_in_the_edges_group_without_rights_or_network(edge_bench: EdgeBench) -> None:
    edge_bench.start()
    (process,) = segmenters(edge_bench.folder)
    status = Path(f"/proc/{process.pid}/status").read_text()
    node = Path(f"/proc/{edge_bench.edge.pid}/status").read_text()
    for key in ("Uid:", "Gid:", "Groups:", "CapEff:", "CapBnd:", "NoNewPrivs:"):
        (own,) = (line for line in status.splitlines() if line.startswith(key))
        assert own in node.splitlines(), key
    assert process.uids().real == NODE_UID
    assert process.num_threads() == 1
    of = {
        pid: Path(f"/proc/{pid}/cgroup").read_text() for pid in (process.pid, edge_bench.edge.pid)
    }
    assert of[process.pid] == of[edge_bench.edge.pid] != Path("/proc/self/cgroup").read_text()
    networks = {
        Path(f"/proc/{p}/ns/net").readlink() for p in (process.pid, edge_bench.edge.pid, "self")
    }
    assert len(networks) == 3
    devices = Path(f"/proc/{process.pid}/net/dev").read_text().splitlines()[2:]
    assert [line.split(":")[0].strip() for line in devices] == ["lo"]
    folder = (edge_bench.folder / FOLDER).stat()
    assert (folder.st_uid, folder.st_mode & 0o777) == (NODE_UID, 0o711)


def test_its_masks_are_those_of_the_cache_and_its_end_reports_its_cpu_time(
    edge_bench: EdgeBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = edge_bench.start()
    y, x = np.mgrid[:240, :320]
    known = Segmenter(load_network(OURS))
    monkeypatch.chdir(edge_bench.folder / FOLDER)  # a socket path has at most 107 characters
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
        caller.connect(SOCKET)
        for n_m, slope in ((0.8, 3), (0.6, 4)):
            jpeg = encode_jpeg(((x * slope + y * 5) % 251).astype(np.uint8), 90)
            question = struct.pack("<f", n_m) + jpeg
            caller.sendall(struct.pack("<I", len(question)) + question)
            with caller.makefile("rb") as answers:
                (size,) = struct.unpack("<I", answers.read(4))
                assert answers.read(size) == encode_frame(known.segment(jpeg, n_m))
    cpu_s = process.close()
    assert cpu_s is not None and cpu_s > 0.05
    assert segmenters(edge_bench.folder) == []


def test_a_network_that_cannot_be_loaded_is_one_line(edge_bench: EdgeBench) -> None:
    with pytest.raises(SlambedError, match="network 'nobody' is not known") as error:
        edge_bench.start("nobody")
    assert error.value.code == ExitCode.BAD_INPUT and "\n" not in str(error.value)
    described = edge_bench.folder / "other.yaml"
    text = (NETWORKS / f"{OURS}.yaml").read_text().replace(f"id: {OURS}", "id: other")
    digest = load_network(OURS).sha256
    described.write_text(text.replace(digest, "f" * 64))
    with pytest.raises(SlambedError, match="sha256 is"):
        edge_bench.start(str(described))
    # The log keeps the line of the dead segmenter when another one starts.
    assert (edge_bench.folder / FOLDER / LOG).read_text().count("\n") == 2


def test_it_goes_with_a_harness_that_is_killed(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path;"
        "from test_segmenter_sidecar import EdgeBench;"
        "edge_bench = EdgeBench(Path(sys.argv[1])); edge_bench.start(); print('up', flush=True);"
        "time.sleep(60)"
    )
    with nodes_of_tests():
        command = [sys.executable, "-c", code, str(tmp_path)]
        ours = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=ours) as run:
            assert run.stdout is not None and run.stdout.readline() == b"up\n"
            assert len(segmenters(tmp_path)) == 1
            run.send_signal(signal.SIGKILL)
        until(lambda: segmenters(tmp_path) == [], "the end of the segmenter")
        EdgeBench(tmp_path).close()  # also removes the cgroup


def run_live(folder: Path, **changes: Any) -> RunResult:
    (folder / "raw").mkdir()
    (folder / "sequence").mkdir()
    spec = run_spec(edge=True, device_edge=device("big"), **changes)
    engine = LocalEngine(stand_in(folder))
    raw, sequence = folder / "raw", folder / "sequence"
    with nodes_of_tests():
        return LiveRun(
            spec, engine, sequence, 0.5, raw, lambda *_: IdleLink(), threading.Event()
        ).execute()


def test_a_run_that_segments_has_one_and_the_edge_alone_is_reported(tmp_path: Path) -> None:
    result = run_live(tmp_path, masks=Masks(network=OURS, n_m=0.8, sha256="0"))
    assert (result.outcome, result.invalid_reasons) == ("completed", [])
    assert result.sidecar is not None and (result.sidecar.segmenter_cpu_s or 0) > 0.05
    raw = tmp_path / "raw"
    reported = json.loads((raw / "run_edge.json").read_text())["segmenter"]
    assert reported == {"socket": f"{raw.resolve()}/{FOLDER}/{SOCKET}", "time_limit_s": 2.0}
    assert "segmenter" not in json.loads((raw / "run.json").read_text())
    assert segmenters(tmp_path) == []


def test_a_run_that_does_not_has_none(tmp_path: Path) -> None:
    result = run_live(tmp_path)
    assert result.sidecar is not None and result.sidecar.segmenter_cpu_s is None
    assert not (tmp_path / "raw" / FOLDER).exists()
