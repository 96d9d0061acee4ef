# SPDX-License-Identifier: Apache-2.0
"""Line protocol between processes: complete messages of known kinds, or one clear error."""

import io
import os
import sys
from pathlib import Path
from typing import Literal

import pytest

from slambed.engines.sidecar_messages import REQUESTS, Follow, Stop
from slambed.errors import ExitCode, PassingError, SlambedError
from slambed.process.line_protocol import (
    Failure,
    LineProcess,
    LineReader,
    Message,
    Start,
    adapter,
    last_answer,
    line_of,
    message_in,
    send,
)

PEER = """
import sys
from slambed.errors import PassingError, SlambedError
from slambed.process.line_protocol import Failure, LineReader, send
requests = LineReader(0)
while (line := requests.next(None)) is not None:
    if b"twice" in line:
        sys.stdout.write(line.decode().replace("request", "reply") + "\\n")
        sys.stdout.flush()
    elif b"passing" in line:
        send(sys.stdout, Failure.of(PassingError("the daemon restarts")))
    elif b"wrong" in line:
        send(sys.stdout, Failure.of(SlambedError("no such file, x")))
    elif b"garbage" in line:
        print("half a li", flush=True)
    elif b"last words" in line:
        send(sys.stdout, Failure.of(SlambedError("cannot cap a thread, run as root")))
        sys.exit(0)
    elif b"leave" in line:
        sys.exit("error: no more memory, peer")
"""


class Asked(Message):
    request: str


class Reply(Message):
    reply: Literal["twice"]


@pytest.fixture
def peer(tmp_path: Path) -> LineProcess:
    return LineProcess([sys.executable, "-c", PEER], "peer", tmp_path / "errors.txt")


@pytest.mark.parametrize("message", [Start(t0_ns=5), Follow(node="edge", pid=7), Stop()])
def test_a_message_is_one_line_and_comes_back_as_what_it_was(message: Message) -> None:
    line = line_of(message)
    assert line.count(b"\n") == 1 and line.endswith(b"\n")
    assert message_in(line, REQUESTS, "harness") == message


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b'{"request": "sta',
        b"[1]",
        b'{"request": "dance"}',
        b'{"request": "start"}',
        b'{"request": "start", "t0_ns": "soon"}',
        b'{"request": "stop", "now": true}',
        b"\xff\xfe",
    ],
)
def test_what_is_no_message_is_one_line_of_error(line: bytes) -> None:
    with pytest.raises(SlambedError, match="the harness said") as raised:
        message_in(line, REQUESTS, "harness")
    assert raised.value.code == ExitCode.INTERNAL and "\n" not in str(raised.value)


def test_lines_are_whole_however_they_are_cut() -> None:
    inside, outside = os.pipe()
    reader = LineReader(inside)
    os.write(outside, b'{"a": 1}\n{"b"')
    assert reader.next(5.0) == b'{"a": 1}'
    assert reader.next(0.01) is None
    os.write(outside, b": 2}\n\n")
    assert (reader.next(None), reader.next(0.0)) == (b'{"b": 2}', b"")
    os.write(outside, b"torn")
    os.close(outside)
    with pytest.raises(EOFError):
        reader.next(5.0)
    os.close(inside)


def test_an_answer_is_of_the_kind_that_was_asked_for(peer: LineProcess) -> None:
    assert peer.ask(Asked(request="twice"), Reply, 20.0) == Reply(reply="twice")
    with pytest.raises(SlambedError, match="the peer said 'half a li'") as raised:
        peer.ask(Asked(request="garbage"), Reply, 20.0)
    assert raised.value.code == ExitCode.INTERNAL
    peer.close()
    assert not peer.alive()


def test_a_failure_between_two_requests_is_not_lost(peer: LineProcess) -> None:
    assert peer._process.stdin is not None
    peer._process.stdin.write(line_of(Asked(request="last words")))
    peer._process.stdin.flush()
    peer._process.wait(20.0)
    with pytest.raises(SlambedError, match="cannot cap a thread, run as root") as raised:
        peer.ask(Asked(request="twice"), Reply, 20.0)
    assert not isinstance(raised.value, PassingError)


def test_a_failure_stays_what_it_was_on_the_other_side(peer: LineProcess) -> None:
    with pytest.raises(PassingError, match=r"^the daemon restarts$") as passing:
        peer.ask(Asked(request="passing"), Reply, 20.0)
    assert passing.value.code == ExitCode.ENVIRONMENT
    with pytest.raises(SlambedError, match=r"^no such file, x$") as wrong:
        peer.ask(Asked(request="wrong"), Reply, 20.0)
    assert wrong.value.code == ExitCode.BAD_INPUT and type(wrong.value) is SlambedError
    peer.close()


def test_a_peer_that_is_silent_or_gone_is_worth_another_try(peer: LineProcess) -> None:
    with pytest.raises(PassingError, match="the peer did not answer within 0 s"):
        peer.ask(Asked(request="nothing"), Reply, 0.01)
    with pytest.raises(PassingError, match="the peer ended: no more memory, peer"):
        peer.ask(Asked(request="leave"), Reply, 20.0)
    peer.close()


def test_a_program_that_is_not_installed_is_no_bug(tmp_path: Path) -> None:
    line = r"^no-such is not on this host, and the peer needs it; install it$"
    with pytest.raises(SlambedError, match=line) as raised:
        LineProcess(["no-such", "lab1"], "peer", tmp_path / "errors.txt")
    assert raised.value.code == ExitCode.ENVIRONMENT


def test_saying_it_writes_at_once() -> None:
    class Stream(io.StringIO):
        flushed = 0

        def flush(self) -> None:
            self.flushed += 1

    stream = Stream()
    send(stream, Failure(error="x", code=3))
    assert stream.flushed == 1
    assert message_in(stream.getvalue().encode(), adapter(Failure), "x").code == 3


@pytest.mark.parametrize(
    ("error", "line", "code"),
    [
        (SlambedError("no such file, x"), "no such file, x", ExitCode.BAD_INPUT),
        (ValueError("seven"), "a bug of slambed: ValueError: seven", ExitCode.INTERNAL),
    ],
)
def test_an_error_becomes_the_last_answer(error: Exception, line: str, code: ExitCode) -> None:
    answers: list[Message] = []
    with last_answer(answers.append):
        raise error
    assert answers == [Failure(error=line, code=int(code))]


def test_the_end_of_the_input_ends_the_work_without_an_answer() -> None:
    answers: list[Message] = []
    with last_answer(answers.append):
        raise EOFError
    assert answers == []
