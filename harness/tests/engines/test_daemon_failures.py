# SPDX-License-Identifier: Apache-2.0
"""A Docker daemon that is unreachable, silent or failing costs a run an attempt; a refusal is
final."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from types import SimpleNamespace

import docker
import pytest
from harness_parts import IdleLink, needs_root, nodes_of_tests, run_spec
from virtual_parts import Quiet
from waiting import in_background

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.live_executor import LiveExecutor
from slambed.campaign.runner import Runner
from slambed.engines.docker import DockerEngine
from slambed.engines.docker_image import find_image
from slambed.engines.reaper import reap
from slambed.errors import ExitCode, PassingError, SlambedError

pytestmark = needs_root


def client(port: int, limit_s: float = 5.0) -> docker.DockerClient:
    """Returns a client of the daemon at this port; a busy host may answer slowly."""
    return docker.DockerClient(f"tcp://127.0.0.1:{port}", version="1.41", timeout=limit_s)


@contextmanager
def silent() -> Iterator[docker.DockerClient]:
    """Accepts connections but never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield client(server.getsockname()[1], limit_s=0.3)


@contextmanager
def away() -> Iterator[docker.DockerClient]:
    """A reserved port without a listener."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield client(taken.getsockname()[1])


@contextmanager
def served(handler: type[BaseHTTPRequestHandler]) -> Iterator[int]:
    """Yields the port; the thread ends even if the test fails."""
    with HTTPServer(("127.0.0.1", 0), handler) as server, in_background(server.serve_forever):
        try:
            yield server.server_port
        finally:
            server.shutdown()


@contextmanager
def answers(code: int) -> Iterator[docker.DockerClient]:
    """Answers every request with this code."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length") or 0))
            # A container does not exist before it is created.
            self.send_response(404 if self.command == "GET" else code)
            self.end_headers()
            self.wfile.write(json.dumps({"message": f"said {code}"}).encode())

        do_POST = do_DELETE = do_GET  # noqa: N815 - the names of the base class

        def log_message(self, format: str, *args: object) -> None: ...

    with served(Handler) as port:
        yield client(port)


@contextmanager
def with_a_leftover(expected: int | None) -> Iterator[int]:
    """A daemon with one container; answers its removal with this code. None: disconnects instead
    of listing it."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            answer: object = {"ApiVersion": "1.41", "Id": "1", "Name": "/slambed-left"}
            if "/containers/json" in self.path:
                if expected is None:
                    return
                answer = [{"Id": "1"}]
            self._answer_with(200, answer)

        def do_DELETE(self) -> None:
            assert expected is not None
            self._answer_with(expected, {"message": f"said {expected}"})

        def _answer_with(self, code: int, answer: object) -> None:
            self.send_response(code)
            self.send_header("Content-Type", "application/json")
            self.end_headers()
            self.wfile.write(json.dumps(answer).encode())

        def log_message(self, format: str, *args: object) -> None: ...

    with served(Handler) as port:
        yield port


@pytest.mark.parametrize("expected", [None, 404, 409], ids=["goes-away", "gone", "being-removed"])
def test_what_goes_by_itself_is_no_obstacle_to_a_campaign(
    expected: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The helper container of a killed harness may be about to end when the next one starts."""
    with with_a_leftover(expected) as port, nodes_of_tests():
        monkeypatch.setenv("DOCKER_HOST", f"tcp://127.0.0.1:{port}")
        assert reap().containers == []


def test_a_container_that_cannot_be_removed_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with with_a_leftover(500) as port, nodes_of_tests():
        monkeypatch.setenv("DOCKER_HOST", f"tcp://127.0.0.1:{port}")
        with pytest.raises(PassingError, match="remove container slambed-left: said 500"):
            reap()


@pytest.mark.parametrize("daemon", [away(), silent()], ids=["away", "silent"])
def test_a_daemon_that_goes_before_its_image_is_found_is_one_line(daemon: ExitStack) -> None:
    with daemon as asked, pytest.raises(SlambedError) as raised:
        find_image(asked)
    assert "look for the node image" in str(raised.value)
    assert raised.value.code == ExitCode.ENVIRONMENT


def executor(folder: Path, asked: docker.DockerClient) -> LiveExecutor:
    """The real engine and the real client with a faulty daemon."""
    image = SimpleNamespace(id="sha256:1", tags=["slambed-node:1"])
    (folder / "sequence").mkdir()
    engine = DockerEngine(asked, image)
    return LiveExecutor(engine, lambda *_: IdleLink(), {"room": (folder / "sequence", 0.5)})


@pytest.mark.parametrize(
    ("daemon", "passes", "line"),
    [
        (away(), True, "Connection refused"),
        (silent(), True, "Read timed out"),
        (answers(500), True, "start the mobile node: said 500"),
        (answers(409), True, "start the mobile node: said 409"),
        (answers(400), False, "start the mobile node: said 400"),
    ],
    ids=["away", "silent", "ill", "name-taken", "refuses"],
)
def test_what_a_daemon_does_is_reported_and_judged(
    tmp_path: Path, daemon: ExitStack, passes: bool, line: str
) -> None:
    (tmp_path / "raw").mkdir()
    with daemon as asked, pytest.raises(SlambedError, match=line) as raised:
        executor(tmp_path, asked).execute(run_spec(), tmp_path / "raw", threading.Event())
    assert isinstance(raised.value, PassingError) == passes
    assert raised.value.code == ExitCode.ENVIRONMENT


def test_a_campaign_tries_again_before_it_gives_up(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "results" / "tiny")
    folder.create()
    ledger = Ledger(folder.path / "ledger.jsonl")
    with away() as asked, pytest.raises(PassingError, match="Connection refused"):
        # In the first run of a campaign: without a daemon all others would fail too.
        campaign = Runner(folder, ledger, executor(tmp_path, asked), pauses_s=(0.01, 0.02))
        campaign.run([run_spec()], Quiet())
    folder.close()
    events = [entry["event"] for entry in ledger.read()]
    assert events == ["run_started", "run_failed"] * 3
