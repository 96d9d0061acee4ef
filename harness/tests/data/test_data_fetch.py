# SPDX-License-Identifier: Apache-2.0
"""Downloads over real connections that break: they resume where they ended, from any address."""

from __future__ import annotations

import hashlib
import random
import socket
import struct
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar

import pytest

from slambed.data import fetch as module
from slambed.data.fetch import Wanted, fetch
from slambed.errors import ExitCode, SlambedError

CONTENT = random.Random(1).randbytes(700_000)
SHA256 = hashlib.sha256(CONTENT).hexdigest()


@dataclass
class Site:
    """A server with one file and configurable failures."""

    content: bytes = CONTENT
    cuts: list[int] = field(default_factory=list)
    """For successive answers: number of bytes after which the connection is cut."""
    ranges: bool = True
    tag: str = '"one"'
    asked: list[str] = field(default_factory=list)
    """The requested ranges."""


class Handler(BaseHTTPRequestHandler):
    sites: ClassVar[dict[str, Site]] = {}

    def do_GET(self) -> None:
        site = self.sites.get(self.path)
        if site is None:
            self.send_error(404)
            return
        wanted = self.headers.get("Range", "")
        site.asked.append(wanted)
        changed = self.headers.get("If-Range", site.tag) != site.tag
        begin = int(wanted.removeprefix("bytes=").removesuffix("-") or 0) if wanted else 0
        if begin and begin >= len(site.content):
            self.send_error(416)
            return
        if not site.ranges or changed:
            begin = 0
        self.send_response(206 if begin else 200)
        if begin:
            end = len(site.content)
            self.send_header("Content-Range", f"bytes {begin}-{end - 1}/{end}")
        if site.tag:
            self.send_header("ETag", site.tag)
        self.send_header("Content-Length", str(len(site.content) - begin))
        self.end_headers()
        rest = site.content[begin:]
        if site.cuts:
            rest = rest[: site.cuts.pop(0)]
        self.wfile.write(rest)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    found = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=found.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{found.server_address[1]}"
    found.shutdown()
    found.server_close()


@pytest.fixture(autouse=True)
def sites(monkeypatch: pytest.MonkeyPatch) -> dict[str, Site]:
    monkeypatch.setattr(module, "PAUSE_S", 0.01)
    Handler.sites.clear()
    return Handler.sites


def wanted(*addresses: str, sha256: str | None = SHA256, size: int | None = len(CONTENT)) -> Wanted:
    return Wanted(addresses, sha256, size)


def left(folder: Path) -> list[str]:
    return sorted(path.suffix for path in folder.iterdir())


def test_a_connection_that_is_cut_goes_on(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    site = sites["/a"] = Site(cuts=[300_000, 200_000])
    seen: list[tuple[int, int]] = []
    path, digest = fetch(wanted(f"{server}/a"), tmp_path, lambda d, t: seen.append((d, t)))
    assert digest == SHA256 and path.read_bytes() == CONTENT
    assert site.asked == ["", "bytes=300000-", "bytes=500000-"]
    assert seen == sorted(seen) and seen[-1] == (len(CONTENT), len(CONTENT))


def test_the_next_call_goes_on(
    server: str, sites: dict[str, Site], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ATTEMPTS", 1)
    site = sites["/a"] = Site(cuts=[300_000])
    with pytest.raises(SlambedError) as error:
        fetch(wanted(f"{server}/a"), tmp_path)
    assert error.value.code == ExitCode.ENVIRONMENT
    assert "300000 bytes are kept, the same command goes on" in str(error.value)
    assert fetch(wanted(f"{server}/a"), tmp_path)[1] == SHA256
    assert site.asked == ["", "bytes=300000-"]


def test_a_mirror_goes_on_with_what_the_first_has_sent(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    sites["/a"] = Site(cuts=[400_000, 0, 0, 0])
    mirror = sites["/b"] = Site()
    path, _ = fetch(wanted(f"{server}/none", f"{server}/a", f"{server}/b"), tmp_path)
    assert path.read_bytes() == CONTENT and mirror.asked == ["bytes=400000-"]


def test_a_mirror_with_another_file_is_passed_over(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    sites["/a"], sites["/b"] = Site(content=bytes(len(CONTENT))), Site()
    assert fetch(wanted(f"{server}/a", f"{server}/b"), tmp_path)[1] == SHA256


def test_a_wrong_checksum_keeps_nothing(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    sites["/a"] = Site(content=bytes(len(CONTENT)))
    with pytest.raises(SlambedError, match="nothing was kept") as error:
        fetch(wanted(f"{server}/a"), tmp_path)
    assert error.value.code == ExitCode.BAD_INPUT and not left(tmp_path)


def test_a_part_that_was_wrong_is_thrown_away_and_all_is_fetched(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    asked = wanted(f"{server}/a")
    asked.part(tmp_path).write_bytes(bytes(100_000))
    site = sites["/a"] = Site()
    assert fetch(asked, tmp_path)[1] == SHA256
    assert site.asked == ["bytes=100000-", ""]


def test_a_server_without_ranges_sends_all_again(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    site = sites["/a"] = Site(cuts=[300_000], ranges=False)
    path, _ = fetch(wanted(f"{server}/a"), tmp_path)
    assert path.read_bytes() == CONTENT and site.asked == ["", "bytes=300000-"]


def test_without_a_checksum_only_the_same_state_goes_on(
    server: str, sites: dict[str, Site], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ATTEMPTS", 1)
    unknown = wanted(f"{server}/a", sha256=None, size=None)
    site = sites["/a"] = Site(cuts=[300_000])
    with pytest.raises(SlambedError):
        fetch(unknown, tmp_path)
    other = bytes(len(CONTENT))
    site.content, site.tag = other, '"two"'
    path, _ = fetch(unknown, tmp_path)
    assert path.read_bytes() == other and site.asked == ["", "bytes=300000-"]
    # A server without a validator sends the whole file again.
    module.forget(path)
    site.tag, site.cuts = "", [300_000]
    with pytest.raises(SlambedError):
        fetch(unknown, tmp_path)
    assert fetch(unknown, tmp_path)[0].read_bytes() == other and site.asked[-2:] == ["", ""]


def test_a_whole_part_asks_nobody(server: str, sites: dict[str, Site], tmp_path: Path) -> None:
    asked = wanted(f"{server}/a")
    asked.part(tmp_path).write_bytes(CONTENT)
    assert fetch(asked, tmp_path)[1] == SHA256


def test_who_is_nowhere_is_named_with_every_address(tmp_path: Path, server: str) -> None:
    with pytest.raises(SlambedError) as error:
        fetch(wanted(f"{server}/x", "http://127.0.0.1:9/y"), tmp_path)
    line = str(error.value)
    assert "/x: HTTP Error 404" in line and "127.0.0.1:9/y" in line and "\n" not in line
    assert error.value.code == ExitCode.ENVIRONMENT and not left(tmp_path)


@pytest.mark.parametrize(
    "address",
    [
        *("", " ", "nope.tgz", "/abs/x", "htp://x", "http://", "https:///x", "http://[::1"),
        *("https://exa mple/x", " http://x/y", "http://x/a\nb", "http://x/ü", "http://x?q=ü"),
        *("http://x:99999/y", "http://x:y/z", "http://a..b/x", "ftp://", "data:,x"),
        *("file:", "file:x.tgz", "file://x.tgz"),
    ],
)
def test_what_is_no_address_is_refused_before_anything_is_fetched(
    server: str, sites: dict[str, Site], tmp_path: Path, address: str
) -> None:
    site = sites["/a"] = Site()
    with pytest.raises(SlambedError, match="is no address of a file; expected http") as error:
        fetch(wanted(f"{server}/a", address), tmp_path)
    assert error.value.code == ExitCode.BAD_INPUT
    assert not site.asked and not left(tmp_path)


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("http://127.0.0.1:9/x", "Connection refused"),
        ("ftp://127.0.0.1:9/x", "Connection refused"),
        ("ftp://me:pw@127.0.0.1:9/x", "Connection refused"),
    ],
)
def test_the_reason_is_told_alone(tmp_path: Path, address: str, reason: str) -> None:
    with pytest.raises(SlambedError) as error:
        fetch(wanted(address), tmp_path)
    shown = address.replace(":pw@", ":***@")
    assert str(error.value) == f"{shown}: {reason}; check the network"
    assert error.value.code == ExitCode.ENVIRONMENT


@pytest.mark.parametrize("login", ["me:pw", "me:p@w", ":pw", "me"])
def test_a_login_that_http_cannot_use_is_refused_and_hidden(
    server: str, sites: dict[str, Site], tmp_path: Path, login: str
) -> None:
    site = sites["/a"] = Site()
    with pytest.raises(SlambedError, match="a user and password are for ftp:// only") as error:
        fetch(wanted(server.replace("//", f"//{login}@") + "/a"), tmp_path)
    assert error.value.code == ExitCode.BAD_INPUT and not site.asked
    hidden = f"{login.partition(':')[0]}:***@" if ":" in login else "me@"
    assert str(error.value).startswith(f"http://{hidden}127.0.0.1:")


@pytest.mark.parametrize("size", [5, 10_000_000])
def test_a_wrong_size_of_a_local_file_is_bad_input(tmp_path: Path, size: int) -> None:
    (tmp_path / "x").write_bytes(CONTENT)
    address = (tmp_path / "x").as_uri()
    with pytest.raises(SlambedError) as error:
        fetch(wanted(address, size=size), tmp_path)
    assert str(error.value) == f"{address}: has 700000 bytes, not {size}; correct size_bytes"
    assert error.value.code == ExitCode.BAD_INPUT and left(tmp_path) == [""]


@pytest.mark.parametrize(
    ("name", "reason"), [("none", "No such file or directory"), ("", "Is a directory")]
)
def test_a_local_file_that_cannot_be_read_is_bad_input(
    tmp_path: Path, name: str, reason: str
) -> None:
    address = (tmp_path / name).as_uri()
    with pytest.raises(SlambedError) as error:
        fetch(wanted(address), tmp_path)
    assert str(error.value) == f"{address}: {reason}; name a file that can be read"
    assert error.value.code == ExitCode.BAD_INPUT


def test_a_name_with_a_blank_is_an_address_of_a_local_file(tmp_path: Path) -> None:
    (tmp_path / "ä b").write_bytes(CONTENT)
    for address in ((tmp_path / "ä b").as_uri(), f"file://{tmp_path}/ä b", f"file:{tmp_path}/ä b"):
        assert fetch(wanted(address), tmp_path)[1] == SHA256


def test_a_network_that_fails_after_a_missing_file_is_the_environments(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="check the network") as error:
        fetch(wanted((tmp_path / "none").as_uri(), "http://127.0.0.1:9/x"), tmp_path)
    assert error.value.code == ExitCode.ENVIRONMENT


def test_a_server_that_hangs_up_is_asked_again_and_then_the_mirror(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    sites["/a"] = Site()
    with socket.create_server(("127.0.0.1", 0)) as rude:
        calls: list[int] = []

        def hang_up() -> None:
            for _ in range(module.ATTEMPTS):
                line = rude.accept()[0]
                # Closing at once sends a reset instead of an end.
                line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                line.recv(1 << 16)
                calls.append(1)
                line.close()

        thread = threading.Thread(target=hang_up, daemon=True)
        thread.start()
        rude_address = f"http://127.0.0.1:{rude.getsockname()[1]}/a"
        assert fetch(wanted(rude_address, f"{server}/a"), tmp_path)[1] == SHA256
        thread.join(10)
    assert len(calls) == module.ATTEMPTS


def test_two_calls_do_not_write_one_file(
    server: str, sites: dict[str, Site], tmp_path: Path
) -> None:
    sites["/a"] = Site()
    asked = wanted(f"{server}/a")
    with module._alone(asked.part(tmp_path)), pytest.raises(SlambedError, match="another slambed"):
        fetch(asked, tmp_path)
    assert fetch(asked, tmp_path)[1] == SHA256
    assert left(tmp_path) == [".from", ".part"]
