# SPDX-License-Identifier: Apache-2.0
"""Files as nobody should have them, and somebody has: valid ones with seeded mistakes in them.

A mutant is decided by its name and its seed alone. Whoever reads mutants is in `mutated_readers`.
"""

from __future__ import annotations

import codecs
import re
import shutil
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

import yaml


@dataclass(frozen=True)
class Link:
    """A symbolic link, by its target."""

    target: str


@dataclass(frozen=True)
class Folder:
    """A folder where a file is expected."""


Content = bytes | Link | Folder
Files = dict[str, Content]
"""Path below the input folder -> what is there."""

TEXT = (".txt", ".csv", ".yaml", ".json", ".log", ".trace")
WORDS = (
    "nan", "-nan", "inf", "-inf", "1e308", "-1e308", "1e400", "1e-320", "1e300", "0", "-0", "-1",
    "1", "2", "0.5", "1e9", "1e18", "1e19", "1e30", "9223372036854775807", "9223372036854775808",
    "-9223372036854775809", "4294967296", "2147483648", "65536", "0x10", "0o7", "1_000", "1,5",
    "1;5", "--1", "1e", ".", "-", "+", "''", '""', "null", "~", "true", "no", "[]", "{}", "[1, 2]",
    "{a: 1}", "abc", "$x", "%s", "{}", "*", "**", "&", "&a", "*a", "!!int", "!!binary x", "? a",
    "<<", "=", "2011-09-26", "2011-13-45", "2011-09-26 13:02:25.5", "12:30:45", "99:99", "..",
    "../../outside", "/", "/dev/null", "/dev/full/x", "a/b/c", "\u0661\u0662", "\u00b2", "\u00e4",
    "\ufeff", "\u2028", "\x85", "\x1b[2J", "\x07", "\x00", "\ud7ff", "#", "# 1 2 3", "x" * 300,
    "9" * 400, "9" * 5000, "-" + "9" * 30, "1." + "0" * 400, "a b", "'", '"', "\\", ":", ": :", "|",
)  # fmt: skip
"""What takes the place of a field."""
VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 3, 0.5, -0.5, 1e-9, 1e9, 1e30, 1e300, 1e308, -1e308, 1e-320,
    float("nan"), float("inf"), float("-inf"), 2**31, 2**63, 2**64, -(2**63) - 1, 10**40, 10**400,
    "", " ", "a", "0", "1", "nan", "none", "dataset", "../x", "/", "x" * 400, "a\nb", "\x1b[1m",
    "\u00e4", "~", "$x", "{", "%", "*", "[", "[a]", "**/..", "a*", [], [[]], {}, {"": None},
    [None], [0], [1, 2], [1, 2, 3, 4], ["a"], ["a", "a"], [[0, 1]], [[1, 2], [0, 3]], {"a": 1},
    {1: 2}, {"a": {"a": {"a": []}}}, [0] * 40, [float("nan")], [{}], ["", ""],
)  # fmt: skip
"""What takes the place of a value of YAML or JSON."""
NUMBERS = (
    "0", "-0.0", "-1", "1", "2", "0.001", "1e-9", "1e-310", "1e3", "1e6", "1e9", "1e12", "1e18",
    "1e19", "1e100", "1e300", "1e308", "2147483647", "2147483648", "9223372036854775807", ".inf",
    "inf", ".nan", "nan", "9" * 40, "9" * 400, "00", "1.5", "1e", "x",
)  # fmt: skip
ENCODINGS = (
    "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "latin-1", "cp1252",
    "utf-7", "cp037",
)  # fmt: skip
SIZES = (0, 1, 2, 3, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 2**24, 2**28, 2**31 - 1, 2**31, 2**32 - 1)
_LITERAL = re.compile(r"-?\d+(?:\.\d*)?(?:e[+-]?\d+)?")
_LONGEST = 1 << 20
"""No mutant of text is longer: what takes long because it is long is another question."""


@dataclass
class Mutator:
    """One mutant in the making."""

    random: Random
    steps: list[str] = field(default_factory=list)
    """What was done, for whoever looks for the fault."""

    @classmethod
    def of(cls, name: str, seed: int) -> Mutator:
        """The same mutant everywhere: Random takes a text by its SHA-512."""
        return cls(Random(f"{name} {seed}"))

    def mutated(self, files: Files) -> Files:
        """One to three mistakes in one or more of the files."""
        found = dict(files)
        for _ in range(self.random.choice((1, 1, 1, 2, 3))):
            names = [name for name, content in found.items() if isinstance(content, bytes)]
            if not names:
                break
            self._one(found, self.random.choice(names))
        return found

    def _one(self, files: Files, name: str) -> None:
        content = files[name]
        assert isinstance(content, bytes)
        ways: list[Callable[[bytes], bytes]]
        if name.endswith(TEXT):
            ways = [self._fields] * 4 + [self._lines] * 3 + [self._encoding, self._bytes]
            ways += [self._literal] * 2
            if name.endswith((".yaml", ".json")):
                ways += [self._tree] * 8
        else:
            ways = [self._bytes, self._numbers, self._numbers]
            if name.endswith(".png"):
                ways += [self._png] * 2
        if self.random.random() < 0.12:
            self._place(files, name)
            return
        way = self.random.choice([*ways, self._size])
        self.steps.append(f"{name}: {way.__name__.strip('_')}")
        files[name] = way(content)

    def note(self, what: object) -> None:
        """More about the last step."""
        self.steps[-1] += f", {str(what)[:60]!r}"

    # Bytes.

    def _bytes(self, data: bytes) -> bytes:
        r = self.random
        at, length = self._range(len(data))
        changed = bytearray(data)
        match r.randrange(8):
            case 0:
                for _ in range(r.choice((1, 1, 2, 8))):
                    if changed:
                        changed[r.randrange(len(changed))] ^= 1 << r.randrange(8)
            case 1:
                for _ in range(r.choice((1, 1, 4))):
                    if changed:
                        changed[r.randrange(len(changed))] = r.randrange(256)
            case 2:
                changed[at:at] = r.randbytes(r.choice((1, 2, 7, 64)))
            case 3:
                del changed[at : at + length]
            case 4:
                changed[at:at] = changed[at : at + length]
            case 5:
                del changed[at:]
            case 6:
                changed[at : at + length] = bytes(length)
            case 7:
                changed += r.randbytes(r.choice((1, 16, 200)))
        return bytes(changed)

    def _range(self, size: int) -> tuple[int, int]:
        at = self.random.randrange(size + 1)
        return at, min(size - at, self.random.choice((1, 2, 4, 16, 100, 1000)))

    def _numbers(self, data: bytes) -> bytes:
        """A size, a count or a position that lies."""
        r = self.random
        form = r.choice(("<I", "<I", "<Q", ">I", ">H", "<H", "<B"))
        width = struct.calcsize(form)
        if len(data) < width:
            return data
        # Headers are at the beginning, indices at the end.
        near = r.choice((64, 400, len(data)))
        at = r.randrange(min(near, len(data) - width + 1))
        if r.random() < 0.3:
            at = len(data) - width - at
        value = r.choice(SIZES) & ((1 << 8 * width) - 1)
        if form == "<Q" and r.random() < 0.3:
            value = r.choice((2**63 - 1, 2**64 - 1, 2**40))
        if r.random() < 0.4:
            value = (struct.unpack_from(form, data, at)[0] + r.choice((1, -1, 8, 256))) & (
                (1 << 8 * width) - 1
            )
        self.note(f"{form} {value} at {at}")
        return data[:at] + struct.pack(form, value) + data[at + width :]

    def _size(self, data: bytes) -> bytes:
        way = self.random.randrange(4)
        self.note(("empty", "half", "twice", "many times")[way])
        return (b"", data[: len(data) // 2], data + data, (data * 20)[:_LONGEST])[way]

    def _png(self, data: bytes) -> bytes:
        """Another size, depth, color or filter in the header, with a right checksum."""
        r = self.random
        if len(data) < 33:
            return data
        head = list(struct.unpack_from(">IIBBBBB", data, 16))
        place = r.randrange(7)
        head[place] = r.choice((0, 1, 2, 3, 4, 6, 8, 16, 17, 32, 100, 255))
        if place < 2:
            head[place] = r.choice((0, 1, 17, 1000, 30_000, 65_535, 2**20, 2**31 - 1, 2**32 - 1))
            if r.random() < 0.5:
                head[0] = head[1] = r.choice((20_000, 30_000, 32_767, 2**16))
        self.note(head)
        chunk = b"IHDR" + struct.pack(">IIBBBBB", *head)
        return data[:12] + chunk + struct.pack(">I", zlib.crc32(chunk)) + data[33:]

    # Text.

    def _encoding(self, data: bytes) -> bytes:
        r = self.random
        text = data.decode("utf-8", "replace")
        way = r.randrange(6)
        if way == 0:
            return data.replace(b"\n", r.choice((b"\r\n", b"\r", b"\n\n", b"\x0b", b"\x85")))
        if way == 1:
            return r.choice((codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF32_BE)) + data
        if way == 2:
            text += r.choice(("# gr\u00f6\u00dfer", "\u4e2d\u6587", "\U0001f600", "\u200b"))
        encoding = r.choice(ENCODINGS)
        self.note(encoding)
        coded = text.encode(encoding, "replace")
        return coded[: r.randrange(len(coded) + 1)] if way == 3 else coded

    def _lines(self, data: bytes) -> bytes:
        r = self.random
        lines = data.decode("utf-8", "replace").split("\n")
        at, other = r.randrange(len(lines)), r.randrange(len(lines))
        match r.randrange(11):
            case 0:
                del lines[at]
            case 1:
                lines.insert(at, lines[other])
            case 2:
                lines[at], lines[other] = lines[other], lines[at]
            case 3:
                r.shuffle(lines)
            case 4:
                lines[at:] = lines[at : at + 1] * r.choice((2, 3, 500))
            case 5:
                lines.insert(
                    at, r.choice(("", " ", "\t", "#", "# x", "%", "---", "...", "a, b, c"))
                )
            case 6:
                lines[at] = lines[at] + r.choice((" ", ",", ";", " 1", "x", "\\")) + lines[other]
            case 7:
                lines[at] = r.choice(WORDS)
            case 8:
                lines[at] = r.choice(("  ", "\t", "- ", "#")) + lines[at]
            case 9:
                lines = lines[: at + 1]
            case 10:
                lines[at] = (lines[at] + " ") * r.choice((2, 50, 2000))
        return "\n".join(lines).encode("utf-8", "replace")[:_LONGEST]

    def _fields(self, data: bytes) -> bytes:
        """Of one line, or of all lines the same field."""
        r = self.random
        lines = data.decode("utf-8", "replace").split("\n")
        separator = r.choice((" ", " ", ",")) if b"," in data else " "
        at, place, way = r.randrange(len(lines)), r.randrange(9), r.randrange(8)
        word, factor = r.choice(WORDS), r.choice((-1, 0, 10, 1e3, 1e9, 1e-3))
        if r.random() < 0.5:
            self.note(word)

        def change(line: str) -> str:
            words = line.split(separator)
            where = place % len(words)
            if way == 0:
                del words[where]
            elif way == 1:
                words.insert(where, word)
            elif way == 2:
                words.append(words[where])
            elif way == 3:
                words.reverse()
            elif way == 4:
                words[where] = _times(words[where], factor)
            else:
                words[where] = word
            return separator.join(words)

        if r.random() < 0.2:
            lines = [change(line) for line in lines]
        else:
            lines[at] = change(lines[at])
        return "\n".join(lines).encode("utf-8", "surrogatepass")[:_LONGEST]

    def _literal(self, data: bytes) -> bytes:
        """One of the numbers of the text, wherever it stands."""
        text = data.decode("utf-8", "replace")
        found = list(_LITERAL.finditer(text))
        if not found:
            return data
        one, number = self.random.choice(found), self.random.choice(NUMBERS)
        self.note(number)
        return (text[: one.start()] + number + text[one.end() :]).encode("utf-8")

    def _tree(self, data: bytes) -> bytes:
        """A value, a key or an entry of YAML or JSON, and what only YAML can say."""
        r = self.random
        try:
            tree = yaml.safe_load(data.decode())
        except Exception:  # an earlier step has left no YAML, which PyYAML says in many ways
            return data
        nodes = list(_nodes(tree))
        if not nodes:
            return data
        inside, key = r.choice(nodes)
        value = r.choice(VALUES)
        way = r.randrange(8)
        self.note(f"{key}: {value}")
        if way == 0:
            del inside[key]
        elif way == 1 and isinstance(inside, dict):
            inside[r.choice(("x", f"{key}s", "", "id", 1, 1.5, "\u00e4", "-"))] = inside.pop(key)
        elif way == 2 and isinstance(inside, list):
            inside.append(value)
        elif way == 3 and isinstance(inside, list):
            inside.insert(0, inside[key])
        elif way == 4:
            inside[key] = [inside[key]]
        elif way == 5:
            other_inside, other = r.choice(nodes)
            inside[key] = other_inside.get(other) if isinstance(other_inside, dict) else None
        elif way == 6 and isinstance(inside[key], int | float):
            inside[key] = inside[key] * r.choice((-1, 0, 10, 1e6, 1e-6))
        else:
            inside[key] = value
        try:
            return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True).encode("utf-8")
        except Exception:
            return data

    # Places.

    def _place(self, files: Files, name: str) -> None:
        r = self.random
        way = r.randrange(8)
        kinds = ("gone", "renamed", "a folder", "a link to nothing", "a link to itself")
        more = ("another's content", "one more", "a system's file beside it")
        self.steps.append(f"{name}: {(*kinds, *more)[way]}")
        folder, slash, leaf = name.rpartition("/")
        if way == 0:
            del files[name]
        elif way == 1:
            new = r.choice((leaf.upper(), f"{leaf}.bak", f" {leaf}", "\u00e4", "-", f"0{leaf}"))
            files[f"{folder}{slash}{new}"] = files.pop(name)
        elif way == 2:
            files[name] = Folder()
        elif way == 3:
            files[name] = Link("nowhere")
        elif way == 4:
            files[name] = Link(leaf)
        elif way == 5:
            files[name] = files[r.choice(sorted(files))]
        elif way == 6:
            digits = "".join(letter for letter in leaf if letter.isdigit()) or "1"
            number = r.choice((f"{int(digits) + 1:0{len(digits)}}", "9" * 15, "9" * 30, "\u00b2"))
            files[f"{folder}{slash}{leaf.replace(digits, number)}"] = files[name]
        else:
            extra = r.choice((f"._{leaf}", "Thumbs.db", ".DS_Store", "desktop.ini", f"{leaf}~"))
            files[f"{folder}{slash}{extra}"] = r.randbytes(100)


def _times(word: str, factor: float) -> str:
    try:
        return repr(float(word) * factor)
    except ValueError:
        return word


def _nodes(tree: Any) -> list[tuple[Any, Any]]:
    """Every mapping or list with each of its keys, by which a value can be changed."""
    if not isinstance(tree, dict | list):
        return []
    found = []
    waiting, seen = [tree], {id(tree)}
    while waiting:
        inside = waiting.pop()
        keys = list(inside) if isinstance(inside, dict) else range(len(inside))
        for key in keys:
            found.append((inside, key))
            if isinstance(inside[key], dict | list) and id(inside[key]) not in seen:
                seen.add(id(inside[key]))
                waiting.append(inside[key])
    return found


def write(files: Files, folder: Path) -> None:
    """Puts them there; a name that no file system takes is left out."""
    for name, content in files.items():
        path = folder / name
        if path.is_dir() and not path.is_symlink():
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, Link):
            path.symlink_to(content.target)
        elif isinstance(content, Folder):
            path.mkdir(exist_ok=True)
        else:
            path.write_bytes(content)


def empty(folder: Path) -> Path:
    """The folder, with nothing in it."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
