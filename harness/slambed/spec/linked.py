# SPDX-License-Identifier: Apache-2.0
"""Which sources one system really links: what changes elsewhere leaves its runs what they are."""

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

from slambed.native import repository_root

FLOOR = re.compile(r"slambed_floor\(\s*(\w+)([^)]*)\)")
LIBRARY = re.compile(r"\bslambed_(\w+)")
ALWAYS = (
    "CMakeLists.txt", "cmake", "docker", "harness/pace", "harness/relay",
    "systems/CMakeLists.txt", "systems/core/CMakeLists.txt", "systems/programs",
)  # fmt: skip
"""How everything is built, the programs around the system, and what every live run starts."""
AROUND = "run"
"""The floor that builds nodes out of a system; no system names it."""
LEFT_OUT_FOLDERS = {"tests", "bench", "fuzz", "__pycache__"}
LEFT_OUT_SUFFIXES = {".md", ".yaml"}
CPP_SUFFIXES = {".cpp", ".hpp", ".inl", ".h"}
# Literals are kept as they are: a string may hold what looks like a comment, a digit separator is
# no quote.
CPP_TOKEN = re.compile(
    r'(?P<raw>R"(?P<mark>[^\s()\\]{0,16})\(.*?\)(?P=mark)")'
    r'|(?P<string>"(?:\\.|[^"\\\n])*")'
    r"|(?P<char>(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+')"
    r"|(?P<comment>//[^\n]*|/\*.*?\*/)",
    re.DOTALL,
)
CMAKE_COMMENT = re.compile(r"(?m)^\s*#[^\n]*$")


def linked_hash(system: str, root: Path | None = None) -> str | None:
    """SHA-256 (12 hex digits) over names and code of what a node of this system is built from,
    comments and blank lines left out; None for a system without sources here."""
    base = root or repository_root()
    floors = floors_of(base)
    if system not in floors:
        return None
    relay = (base / "harness" / "relay" / "CMakeLists.txt").read_text(encoding="utf-8")
    wanted = below([system, AROUND, *LIBRARY.findall(relay)], floors)
    starts = [base / name for name in ALWAYS] + [floors[name][0] for name in wanted]
    digest = hashlib.sha256()
    for path in sorted({file for start in starts for file in _files(start, base)}):
        digest.update(path.relative_to(base).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(_code(path)).digest())
    return digest.hexdigest()[:12]


def floors_of(base: Path) -> dict[str, tuple[Path, list[str]]]:
    """Name -> its folder and the floors that it names as dependencies."""
    found: dict[str, tuple[Path, list[str]]] = {}
    for path in sorted((base / "systems").rglob("CMakeLists.txt")):
        for name, arguments in FLOOR.findall(path.read_text(encoding="utf-8")):
            found[name] = (path.parent, LIBRARY.findall(arguments))
    return found


def below(names: list[str], floors: dict[str, tuple[Path, list[str]]]) -> set[str]:
    """These floors and all that they stand on."""
    found: set[str] = set()
    while names:
        name = names.pop()
        if name in floors and name not in found:
            found.add(name)
            names += floors[name][1]
    return found


def _files(start: Path, base: Path) -> Iterator[Path]:
    for path in [start] if start.is_file() else start.rglob("*"):
        inside = path.relative_to(base).parts
        hidden = path.name.startswith(".")
        if hidden or LEFT_OUT_FOLDERS.intersection(inside) or not path.is_file():
            continue
        if path.suffix not in LEFT_OUT_SUFFIXES:
            yield path


def _code(path: Path) -> bytes:
    content = path.read_bytes()
    if path.suffix in CPP_SUFFIXES:
        text = content.decode("utf-8", errors="replace")
        text = CPP_TOKEN.sub(lambda m: " " if m["comment"] is not None else m[0], text)
    elif path.suffix == ".cmake" or path.name == "CMakeLists.txt":
        text = CMAKE_COMMENT.sub("", content.decode("utf-8", errors="replace"))
    else:
        return content
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line).encode()
