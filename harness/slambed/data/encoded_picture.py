# SPDX-License-Identifier: Apache-2.0
"""PNG and JPEG before anything decodes them: whether they are whole, and whether their sizes can be
true. Decoders take a header's word for it, and print what they find past us."""

from __future__ import annotations

import re
import struct
import zlib

from slambed.errors import SlambedError

_PNG_START = b"\x89PNG\r\n\x1a\n"
_PNG_HEADER = struct.Struct(">IIBBBBB")
#: Kind of pixels -> samples of each, and bits that a sample may have.
_PNG_KINDS = {
    0: (1, (1, 2, 4, 8, 16)),
    2: (3, (8, 16)),
    3: (1, (1, 2, 4, 8)),
    4: (2, (8, 16)),
    6: (4, (8, 16)),
}
_PALETTE = 3
#: Deflate makes no more than this of a byte.
_DEFLATE_RATIO = 1032
_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
#: In the coded pixels of a JPEG: what is neither a stuffed byte, a restart nor a filling.
_JPEG_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
#: Markers of a frame's header, where its size is.
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
#: A block of 64 pixels takes a bit at least, with a Huffman code; other codes take less.
_JPEG_RATIO = 8 * 64 * 8


def check_picture(data: bytes, name: str) -> None:
    """Raises for a PNG or a JPEG that is cut off, damaged or cannot be of the size that it says;
    bytes behind its end are nobody's."""
    if data.startswith(_PNG_START):
        _check_png(data, name)
    elif data.startswith(_JPEG_START):
        _check_jpeg(data, name)


def _check_png(data: bytes, name: str) -> None:
    at, before = len(_PNG_START), b""
    seen = set()
    while before != b"IEND":
        length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
        end = at + 12 + length
        if end > len(data):
            raise _truncated(data, "PNG", name)
        if not kind.isalpha():
            raise _damaged(name, f"its part at byte {at} has no kind")
        # What is not critical, by its lower case, decoders skip.
        sum_of_it = int.from_bytes(data[end - 4 : end], "big")
        if kind[:1].isupper() and zlib.crc32(data[at + 4 : end - 4]) != sum_of_it:
            raise _damaged(name, f"the checksum of its part at byte {at} is wrong")
        if not before:
            if kind != b"IHDR" or length != _PNG_HEADER.size:
                raise _damaged(name, "it begins with no header")
            needs_palette = _check_png_header(data, at + 8, name)
        if kind == b"IDAT" and needs_palette and b"PLTE" not in seen:
            raise _damaged(name, "it has no palette")
        seen.add(kind)
        at, before = end, kind
    if b"IDAT" not in seen:
        raise _damaged(name, "it has no pixels")


def _check_png_header(data: bytes, at: int, name: str) -> bool:
    """Whether it needs a palette."""
    width, height, bits, kind, packing, filtering, interlaced = _PNG_HEADER.unpack_from(data, at)
    samples, known = _PNG_KINDS.get(kind, (0, ()))
    if bits not in known or packing or filtering or interlaced > 1:
        raise _damaged(name, "its header names a kind of pixels that there is not")
    if width * height * samples * bits > 8 * _DEFLATE_RATIO * len(data) or not width * height:
        raise _impossible(data, (width, height), "PNG", name)
    return bool(kind == _PALETTE)


def _check_jpeg(data: bytes, name: str) -> None:
    """Walks from segment to segment: the end of a thumbnail in EXIF is not that of the picture."""
    at, is_whole = len(_JPEG_START), False
    while not is_whole and (marker := _JPEG_MARKER.search(data, at)) is not None:
        at = marker.end()
        is_whole = marker[0] == _JPEG_END
        if data[at - 1] in _JPEG_FRAMES and len(data) >= at + 7:
            height, width = struct.unpack_from(">HH", data, at + 3)
            if width * height > _JPEG_RATIO * len(data):
                raise _impossible(data, (width, height), "JPEG", name)
        at += int.from_bytes(data[at : at + 2], "big")
    if not is_whole and not data.endswith(_JPEG_END):
        raise _truncated(data, "JPEG", name)


def _truncated(data: bytes, kind: str, name: str) -> SlambedError:
    return SlambedError(f"{name}: {kind} is truncated ({len(data)} bytes); fetch the file again")


def _damaged(name: str, why: str) -> SlambedError:
    return SlambedError(f"{name}: PNG is damaged: {why}; fetch the file again")


def _impossible(data: bytes, size: tuple[int, int], kind: str, name: str) -> SlambedError:
    return SlambedError(
        f"{name}: {kind} of {size[0]}x{size[1]} pixels, as its header says, which {len(data)} "
        "bytes cannot hold; fetch the file again"
    )
