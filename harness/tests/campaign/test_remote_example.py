# SPDX-License-Identifier: Apache-2.0
"""The mobile node of the remote odometry, beside an edge that answers half and stands still."""

import importlib
import json
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from types import ModuleType

import pytest
from waiting import in_background, until

from slambed.native import repository_root

ROOT = repository_root()
MODULES = ("remote_mobile", "wire", "slambed_client")


@pytest.fixture(name="mobile")
def mobile_module(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(ROOT / "systems" / "apps" / "play" / "client")
    monkeypatch.syspath_prepend(ROOT / "examples" / "visual_odometry")
    yield importlib.import_module("remote_mobile")
    for name in MODULES:
        sys.modules.pop(name, None)


def test_after_half_an_answer_it_connects_anew(
    mobile: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    wire = importlib.import_module("wire")
    answer = {"T_wc": None, "features": 7, "inliers": 0}
    with socket.create_server(("127.0.0.1", 0)) as server:
        monkeypatch.setenv("SLAMBED_EDGE_ADDRESS", "127.0.0.1")
        monkeypatch.setenv("SLAMBED_PORT_PICTURES", str(server.getsockname()[1]))
        edge = mobile.Edge(b"{}", 0.2)
        first, _ = server.accept()
        assert wire.receive(first) == (0, b"{}")
        first.sendall(wire.HEADER.pack(1, 1000) + b"half")
        assert edge.place(1, b"picture") is None

        server.settimeout(0.1)
        over = threading.Event()

        def answers() -> None:
            while not over.is_set():
                with suppress(EOFError, OSError):
                    connection, _ = server.accept()
                    connection.settimeout(None)
                    assert wire.receive(connection) == (0, b"{}")
                    while True:
                        number, _ = wire.receive(connection)
                        wire.send(connection, number, json.dumps(answer).encode())

        with in_background(answers, over):
            until(lambda: edge.place(2, b"picture") == answer, "an answer over a new connection")
            edge.close()
        first.close()
