# SPDX-License-Identifier: Apache-2.0
"""Which sources a system links, so that a change elsewhere leaves its run keys unchanged."""

import hashlib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from slambed.native import repository_root


class Target(NamedTuple):
    """A CMake target: its folder and the layers that it depends on."""

    folder: Path
    depends: list[str]


LIBRARY = re.compile(r"slambed_library\(\s*(\w+)([^)]*)\)")
PROGRAM = re.compile(r"slambed_(?:program|tool)\(\s*([\w-]+)([^)]*)\)")
DEPENDENCY = re.compile(r"\bslambed_(\w+)")
ALWAYS = ("CMakeLists.txt", "cmake", "systems/CMakeLists.txt", "systems/core/CMakeLists.txt")
"""These files affect every build."""
ALWAYS_LIVE = (*ALWAYS, "docker")
NODE = "slambed-node"
LIVE_PROGRAMS = (NODE, "slambed-relay", "slambed-pace")
"""Programs that every live run starts. A system that needs its own node program, such as `play`,
replaces slambed-node."""
VIRTUAL_PROGRAMS = ("slambed-sim",)
LEFT_OUT_FOLDERS = {"tests", "bench", "fuzz", "__pycache__"}
LEFT_OUT_SUFFIXES = {".md", ".yaml"}
CPP_SUFFIXES = {".cpp", ".hpp", ".inl", ".h"}
# Literals are matched so that comment markers inside strings stay. A digit separator does not open
# a character literal.
CPP_TOKEN = re.compile(
    r'(?P<raw>R"(?P<mark>[^\s()\\]{0,16})\(.*?\)(?P=mark)")'
    r'|(?P<string>"(?:\\.|[^"\\\n])*")'
    r"|(?P<char>(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+')"
    r"|(?P<comment>//[^\n]*|/\*.*?\*/)",
    re.DOTALL,
)
CMAKE_COMMENT = re.compile(r"(?m)^\s*#[^\n]*$")


def linked_hash(system: str, root: Path | None = None, *, virtual: bool = False) -> str | None:
    """Returns SHA-256 (12 hex digits) over names and code of the sources of a live or virtual
    run of this system, without comments and blank lines. None for a system without sources in
    this checkout."""
    base = root or repository_root()
    libraries = libraries_of(base)
    if system not in libraries:
        return None
    programs = _programs_of_runs(system, programs_of(base), virtual)
    wanted = below([system, *(name for item in programs for name in item.depends)], libraries)
    folders = {libraries[name].folder for name in wanted} | {item.folder for item in programs}
    starts = [base / name for name in (ALWAYS if virtual else ALWAYS_LIVE)] + sorted(folders)
    others = {item.folder for item in libraries.values()} - folders
    digest = hashlib.sha256()
    for path in sorted({file for start in starts for file in _files(start, base)}):
        if not others.intersection(path.parents):
            digest.update(path.relative_to(base).as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(_code(path)).digest())
    return digest.hexdigest()[:12]


def _programs_of_runs(system: str, programs: dict[str, Target], virtual: bool) -> list[Target]:
    if virtual:
        return [programs[name] for name in VIRTUAL_PROGRAMS]
    own = f"slambed-{system}"
    return [programs[own if name == NODE and own in programs else name] for name in LIVE_PROGRAMS]


def libraries_of(base: Path) -> dict[str, Target]:
    """Returns name -> target of each library that CMake builds."""
    return _targets(base, LIBRARY)


def programs_of(base: Path) -> dict[str, Target]:
    """Returns name -> target of each program that CMake builds."""
    return _targets(base, PROGRAM)


def _targets(base: Path, call: re.Pattern[str]) -> dict[str, Target]:
    found: dict[str, Target] = {}
    for path in sorted((base / "systems").rglob("CMakeLists.txt")):
        for name, arguments in call.findall(path.read_text(encoding="utf-8")):
            named = arguments.partition("DEPENDS")[2]
            found[name] = Target(path.parent, DEPENDENCY.findall(named))
    return found


def below(names: Iterable[str], libraries: dict[str, Target]) -> set[str]:
    """Returns these layers and all their transitive dependencies."""
    found: set[str] = set()
    waiting = list(names)
    while waiting:
        name = waiting.pop()
        if name in libraries and name not in found:
            found.add(name)
            waiting += libraries[name].depends
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
