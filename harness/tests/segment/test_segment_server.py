# SPDX-License-Identifier: Apache-2.0
"""The segmenter of live runs on its socket: the masks of the cache, and callers that misbehave."""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from slambed.segment.mask_cache import decode_frame, encode_frame
from slambed.segment.masks import encode_jpeg
from slambed.segment.network import load_network
from slambed.segment.segmenter import Segmenter

OURS = "slambed_people"


@pytest.fixture(scope="module")
def place() -> Iterator[Path]:
    """The socket of a running segmenter; its path is short because Unix socket addresses are
    limited."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "s"
        command = [sys.executable, "-m", "slambed.segment.server", str(path), OURS]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as process:
            assert process.stdout is not None and process.stdout.readline() == b"ready\n"
            yield path
            process.kill()


def call(place: Path) -> socket.socket:
    caller = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    caller.connect(str(place))
    return caller


def ask(caller: socket.socket, n_m: float, jpeg: bytes) -> bytes:
    question = struct.pack("<f", n_m) + jpeg
    caller.sendall(struct.pack("<I", len(question)) + question)
    with caller.makefile("rb") as answers:
        (size,) = struct.unpack("<I", answers.read(4))
        return answers.read(size)


def picture() -> bytes:
    y, x = np.mgrid[:240, :320]
    return encode_jpeg(((x * 3 + y * 5) % 251).astype(np.uint8), 90)


def test_answers_are_the_blocks_of_the_mask_cache(place: Path) -> None:
    segmenter = Segmenter(load_network(OURS))
    with call(place) as caller:
        for n_m in (0.8, 0.6):
            answer = ask(caller, n_m, picture())
            assert answer == encode_frame(segmenter.segment(picture(), n_m))
            assert (decode_frame(answer).width, decode_frame(answer).height) == (320, 240)


def test_a_torn_picture_has_an_empty_answer_and_the_next_one_a_right_one(place: Path) -> None:
    with call(place) as caller:
        assert ask(caller, 0.8, b"no jpeg") == b""
        assert ask(caller, float("nan"), picture()) == b""
        assert decode_frame(ask(caller, 0.8, picture())).width == 320


def test_nonsense_ends_a_call_but_not_the_segmenter(place: Path) -> None:
    with call(place) as caller:
        caller.sendall(struct.pack("<I", 0xFFFFFFFF))
        assert caller.recv(1) == b""
    with call(place) as caller:
        caller.sendall(struct.pack("<I", 1000) + b"cut off")
    with call(place) as caller:
        assert len(ask(caller, 0.8, picture())) >= 16


def test_a_place_that_is_none_is_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "slambed.segment.server", str(tmp_path / "no" / "s"), OURS]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 3
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1


def test_it_answers_however_deep_and_ends_with_its_input_when_asked_to(tmp_path: Path) -> None:
    deep = tmp_path / ("d" * 120)
    deep.mkdir()
    command = [sys.executable, "-m", "slambed.segment.server", str(deep / "s"), OURS]
    with subprocess.Popen(
        [*command, "--with-input"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        assert (deep / "s").is_socket()
        process.stdin.close()
        assert process.stdout.readline().startswith(b"cpu_s ")
        assert process.wait(10) == 0


def test_what_is_asked_wrongly_is_one_line() -> None:
    command = [sys.executable, "-m", "slambed.segment.server"]
    for arguments in ([], ["a"], ["a", "b", "c"], ["a", "--with-input"]):
        done = subprocess.run([*command, *arguments], capture_output=True, text=True)
        assert done.returncode == 2 and done.stderr.startswith("error: "), arguments
