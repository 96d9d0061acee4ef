# SPDX-License-Identifier: Apache-2.0
"""The segmenter of live runs: a process next to the edge node that answers on a Unix socket.

    python -m slambed.segment.server SOCKET NETWORK [--with-input]

A request is u32 length, f32 n_m, JPEG; a reply is u32 length and a frame of a mask cache. The
length counts the bytes after it. An image that cannot be segmented gets a reply of 0 bytes and a
warning on stderr. Requests are answered one at a time, because a network uses a whole core.

On SIGTERM it prints its CPU seconds and exits. With --with-input it does so too at the end of its
standard input.
"""

from __future__ import annotations

import contextlib
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
"""Largest request; no camera sends a larger image."""


def serve(place: Path, segmenter: Segmenter) -> None:
    """Answers one caller after another until the process is terminated."""
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
    """Binds through the folder's descriptor, because a socket address is limited to 107 characters
    and run folders are nested deeply."""
    folder = os.open(place.parent, os.O_PATH | os.O_DIRECTORY)
    try:
        door.bind(f"/proc/self/fd/{folder}/{place.name}")
    finally:
        os.close(folder)


def _read(caller: socket.socket) -> bytes | None:
    """Returns the next request; None at the end, or for an invalid length."""
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
    """Says how much CPU time it used and exits at once, because there is nothing to finish."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    # Nobody reads it any more if the parent was killed.
    with contextlib.suppress(OSError):
        os.write(1, f"cpu_s {used.ru_utime + used.ru_stime:.3f}\n".encode())
    os._exit(ExitCode.OK)


def _end_with_input() -> None:
    """Exits at the end of standard input: the parent holds the other end, and may have been
    killed."""
    while os.read(0, 4096):
        pass
    _end()


def main() -> int:
    """Runs the segmenter; every failure is one line on stderr."""
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
