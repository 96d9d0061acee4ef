# SPDX-License-Identifier: Apache-2.0
"""Text of any common encoding and with any line ending."""

from __future__ import annotations

import codecs

from slambed.errors import SlambedError

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before UTF-16, whose mark is its prefix
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def decode_text(data: bytes, name: str) -> str:
    """Decodes UTF-8, UTF-16 as written by PowerShell, or else Latin-1, which accepts every byte;
    converts to Unix line endings."""
    encoding = next((kind for mark, kind in _MARKS if data.startswith(mark)), _without_mark(data))
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as broken:
        if encoding != "utf-8":
            raise SlambedError(f"{name}: begins as {encoding} text but is none; {broken}") from None
        text = data.decode("latin-1")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if (zero := text.find("\0")) >= 0:
        line = text.count("\n", 0, zero) + 1
        raise SlambedError(f"{name}:{line}: a zero byte, which no text has; fetch the file again")
    return text


def _without_mark(data: bytes) -> str:
    """Detects UTF-16 without a mark: every second byte of Western text is zero, which does not
    occur in other text."""
    if data[1:2] == b"\0":
        return "utf-16-le"
    return "utf-16-be" if data[:1] == b"\0" else "utf-8"
