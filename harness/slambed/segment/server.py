# SPDX-License-Identifier: Apache-2.0
"""The segmenter of live runs: a process beside the edge node that answers on a Unix socket.

    python -m slambed.segment.server SOCKET NETWORK [--with-input]

A question is u32 bytes that follow, f32 n_m, JPEG; an answer u32 bytes that follow and a frame of a
mask cache. A picture that cannot be segmented is answered with 0 bytes, and reported on stderr. One
question at a time: a network fills a core.

It ends with SIGTERM and, when asked to, with its standard input; it then reports the CPU seconds
that
it took."""

from __future__ import annotations

import os
import resource
import signal
import socket
import struct
import sys
import threading
from pathlib import Path

from slambed.errors import ExitCode, SlambedError, environment_error
from slambed.segment import WITH_INPUT
from slambed.segment.mask_cache import encode_frame
from slambed.segment.network import load_network
from slambed.segment.segmenter import Segmenter

_SIZE = struct.Struct("<I")
_N_M = struct.Struct("<f")
MOST_BYTES = 16 << 20
"""Of a question; a picture of that size is none that a camera sent."""


def serve(place: Path, segmenter: Segmenter) -> None:
    """Answers one caller after the other until it is ended from outside."""
    place.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as door:
        try:
            _bind(door, place)
        except OSError as refused:
            raise environment_error(f"{place}: {refused.strerror or refused}") from refused
        place.chmod(0o660)
        door.listen(1)
        print("ready", flush=True)
        while True:
            caller, _ = door.accept()
            with caller:
                try:
                    while (question := _read(caller)) is not None:
                        answer = _answer(question, segmenter)
                        caller.sendall(_SIZE.pack(len(answer)) + answer)
                except OSError as broken:
                    print(f"warning: caller lost: {broken}", file=sys.stderr)


def _bind(door: socket.socket, place: Path) -> None:
    """Through the folder's descriptor: a socket's address has room for 107 characters, and run
    folders lie deep."""
    folder = os.open(place.parent, os.O_PATH | os.O_DIRECTORY)
    try:
        door.bind(f"/proc/self/fd/{folder}/{place.name}")
    finally:
        os.close(folder)


def _read(caller: socket.socket) -> bytes | None:
    """The next question, None at the end or for one that no camera would ask."""
    head = _exactly(caller, _SIZE.size)
    if head is None:
        return None
    (size,) = _SIZE.unpack(head)
    if not _N_M.size < size <= MOST_BYTES:
        print(f"warning: a question of {size} bytes; the caller is left", file=sys.stderr)
        return None
    return _exactly(caller, size)


def _answer(question: bytes, segmenter: Segmenter) -> bytes:
    (n_m,) = _N_M.unpack_from(question)
    try:
        return encode_frame(segmenter.segment(question[_N_M.size :], round(n_m, 6)))
    except SlambedError as wrong:
        print(f"warning: {wrong}", file=sys.stderr, flush=True)
        return b""


def _exactly(caller: socket.socket, size: int) -> bytes | None:
    read = bytearray()
    while len(read) < size:
        piece = caller.recv(size - len(read))
        if not piece:
            return None
        read += piece
    return bytes(read)


def _end(*_: object) -> None:
    """Of a signal: wherever it is, there is nothing to finish."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    sys.stdout.write(f"cpu_s {used.ru_utime + used.ru_stime:.3f}\n")
    sys.stdout.flush()
    os._exit(ExitCode.OK)


def _end_with_input() -> None:
    """Whoever started it holds the other end, and may have been killed."""
    while os.read(0, 4096):
        pass
    os._exit(ExitCode.OK)


def main() -> int:
    """Entry point: every failure is one line."""
    *wanted, last = sys.argv[1:] or [""]
    if last != WITH_INPUT:
        wanted.append(last)
    if len(wanted) != 2:
        line = f"error: python -m slambed.segment.server SOCKET NETWORK [{WITH_INPUT}]"
        print(line, file=sys.stderr)
        return ExitCode.BAD_INPUT
    signal.signal(signal.SIGTERM, _end)
    if last == WITH_INPUT:
        threading.Thread(target=_end_with_input, daemon=True).start()
    try:
        serve(Path(wanted[0]), Segmenter(load_network(wanted[1])))
    except SlambedError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        pass
    return ExitCode.OK


if __name__ == "__main__":
    sys.exit(main())
