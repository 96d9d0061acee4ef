# SPDX-License-Identifier: Apache-2.0
"""A ROS 1 bag, a ROS 2 bag (sqlite3, MCAP) or a single MCAP file, opened without ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import Reader as RosBag2
from rosbags.typesys import Stores, get_typestore

from slambed.errors import SlambedError
from slambed.suggestion import did_you_mean

_LONGEST_REASON = 160
_PACKED = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"\xfd7zXZ": "xz",
    b"PK\x03\x04": "zip",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x04\x22\x4d\x18": "lz4",
}
"""First bytes of a packed file -> what packed it."""


class BagFile:
    """One recording in one or more parts. Every error of the library is a SlambedError."""

    def __init__(self, parts: Sequence[Path]) -> None:
        self.parts = list(parts)
        self.path = self.parts[0]

    @contextmanager
    def open(self) -> Iterator[AnyReader]:
        """Opens all parts as one bag."""
        for part in self.parts:
            _must_be_unpacked(part)
        with ExitStack() as stack:
            with self._library():
                bag = AnyReader(self.parts, default_typestore=_standard())
                if self.path.is_dir() and not bag.is2:
                    # The library takes every path that ends with .bag for a file of ROS 1.
                    bag.is2, bag.readers = True, [RosBag2(part) for part in self.parts]
                bag.open()
                stack.callback(_close, bag)
                names = [name for c in bag.connections for name in (c.topic, c.msgtype)]
                if not all(isinstance(name, str) for name in names):
                    raise ValueError("a topic, or the type of its messages, is no text")
            yield bag

    def messages(
        self, bag: AnyReader, topics: list[str], check: Callable[[str, str], None] | None = None
    ) -> Iterator[tuple[str, Any, int]]:
        """Yields topic, message, and the time in nanoseconds at which the bag recorded it. `check`
        is called first with each topic and its type."""
        present = sorted({connection.topic for connection in bag.connections})
        for topic in topics:
            if topic not in present:
                raise SlambedError(
                    f"{self.path}: no topic '{topic}'{did_you_mean(topic, present)}; "
                    f"in the bag: {', '.join(present)}"
                )
        chosen = [c for c in bag.connections if c.topic in topics]
        for connection in chosen:
            if check is not None:
                check(connection.topic, connection.msgtype)
            self._check_fields(connection.topic, connection.msgtype, bag)
        with self._library():
            messages = iter(bag.messages(connections=chosen))
        while True:
            with self._library():
                if (found := next(messages, None)) is None:
                    return
                connection, received_ns, raw = found
                received_ns = int(received_ns)
                message = bag.deserialize(raw, connection.msgtype)
            yield connection.topic, message, received_ns

    @contextmanager
    def _library(self) -> Iterator[None]:
        """Wraps calls into `rosbags`, whose parsers raise exceptions of any type for a damaged
        file."""
        try:
            yield
        except Exception as broken:
            raise SlambedError(f"{self.path}: {_reason(broken)}") from broken

    def _check_fields(self, topic: str, kind: str, bag: AnyReader) -> None:
        if (other := _other_fields(kind, bag.typestore.fielddefs)) is not None:
            raise SlambedError(
                f"{self.path}: topic '{topic}': the bag defines {other} otherwise than ROS does; "
                "record it again with the messages of ROS"
            )


def _must_be_unpacked(part: Path) -> None:
    start = b""
    # What cannot be read is reported when the library opens it.
    with suppress(OSError), part.open("rb") as file:
        start = file.read(max(map(len, _PACKED)))
    for magic, program in _PACKED.items():
        if start.startswith(magic):
            raise SlambedError(f"{part}: packed by {program}; unpack it, and name what is inside")


def _close(bag: AnyReader) -> None:
    """Closes a bag that was only read; errors of a damaged bag do not matter then."""
    with suppress(Exception):
        bag.close()


@cache
def _standard() -> Any:
    """Returns the standard ROS messages, for bags without definitions."""
    return get_typestore(Stores.ROS2_HUMBLE)


def _other_fields(kind: str, fields: Any) -> str | None:
    """Returns the name of the message, this one or a nested one, that lacks a field of the standard
    ROS definition, or None. ROS 1 messages may have more fields. Messages that ROS does not define
    are not checked."""
    known = _standard().fielddefs
    if kind not in known:
        return None
    _, found = fields.get(kind, ((), ()))
    for field in known[kind][1]:
        if field not in found:
            return kind
        node, what = field[1]
        if node != Nodetype.NAME and node != Nodetype.BASE:
            node, what = what[0]
        if node == Nodetype.NAME and (other := _other_fields(what, fields)) is not None:
            return other
    return None


def _reason(broken: Exception) -> str:
    """Shortens a library's error to one line, with a fix for bags left by crashes."""
    if isinstance(broken, UnicodeDecodeError):
        return "cannot be read as a bag: bytes where it has text; copy or record it again"
    reported: Sequence[object] = broken.args or (broken,)
    lines = " ".join(str(part) for part in reported).strip().splitlines()
    what = lines[0][:_LONGEST_REASON] if lines and lines[0] else type(broken).__name__
    if "end magic" in what:
        return "the file is cut off, as a crash leaves it; repair it with 'mcap recover'"
    if "metadata file" in what:
        return (
            "cannot be read as a bag: a folder without metadata.yaml; name one that 'ros2 bag "
            "record' wrote, or repair it with 'ros2 bag reindex'"
        )
    if "malformed" in what or "not a database" in what:
        return (
            f"cannot be read as a bag: {what} (cut off or damaged); copy it again, or save what is "
            "readable with '.recover' of sqlite3"
        )
    if ".active" in what:
        return "a recording that was not closed; repair it with 'rosbag reindex', then rename it"
    if "index" in what.lower():
        return f"cannot be read as a bag: {what}; repair it with 'rosbag reindex'"
    return f"cannot be read as a bag: {what}"
