# SPDX-License-Identifier: Apache-2.0
"""Which C++ sources a node is built from: part of the run key and of the image's tag.

The build calls this module before any packages are installed, so it uses the standard library only.
"""

import hashlib
import json
import re
import subprocess
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from slambed import __version__
from slambed.errors import environment_error
from slambed.native import SIMULATION, find_program, how_to_build, repository_root
from slambed.spec.linked import linked_hash

ROOTS = ("CMakeLists.txt", "cmake", "systems", "docker")
# None of these changes the behavior of a node.
LEFT_OUT_FOLDERS = {"tests", "bench", "__pycache__"}
LEFT_OUT_SUFFIXES = {".md", ".yaml"}
STAMP = "sources.sha256"
MACHINE = "@"
"""Separates sources and machine in the software tag of a virtual run."""


def source_hash(root: Path | None = None) -> str:
    """Returns SHA-256 (12 hex digits) over names and bytes of all sources of a node."""
    base = root or repository_root()
    digest = hashlib.sha256()
    for path in sorted(_sources(base)):
        digest.update(path.relative_to(base).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:12]


def _sources(base: Path) -> Iterator[Path]:
    for name in ROOTS:
        start = base / name
        for path in [start] if start.is_file() else start.rglob("*"):
            inside = path.relative_to(base).parts
            hidden = path.name.startswith(".")
            if hidden or LEFT_OUT_FOLDERS.intersection(inside) or not path.is_file():
                continue
            if path.suffix not in LEFT_OUT_SUFFIXES:
                yield path


def image_software(root: Path | None = None) -> str:
    """Returns the software tag of runs in the image built from this checkout."""
    return f"{__version__}+{source_hash(root)}"


def host_software(root: Path | None = None, program: str = "slambed-node") -> str:
    """Returns the software tag of runs with the programs built on this host.

    `make build` leaves a stamp next to the programs. A stamp of other sources means that the
    programs are stale; programs without a stamp (a developer's own build) are identified by a hash
    of their bytes. The tag of a virtual run also names the compiler and the libraries of the
    simulation: results are bit-identical only where these are the same too
    (docs/explanation/virtual-time.md).
    """
    path = find_program(program)
    stamp = path.parent / STAMP
    if not stamp.is_file():
        return f"{__version__}+bin.{hashlib.sha256(path.read_bytes()).hexdigest()[:12]}"
    if stamp.read_text().strip() != source_hash(root):
        raise environment_error(f"{path} is older than the sources; run {how_to_build()}")
    machine = _machine(path, path.stat().st_mtime_ns) if program == SIMULATION else ""
    return image_software(root) + machine


@cache
def _machine(simulation: Path, _mtime_ns: int) -> str:
    """Returns `@gcc12.2.0-libstdcxx12-...` as the program reports it, cached for the whole
    campaign."""
    try:
        done = subprocess.run([simulation, "--machine"], capture_output=True, check=True)
        facts: dict[str, str] = json.loads(done.stdout)
    except (OSError, subprocess.CalledProcessError, ValueError):
        line = f"{simulation} does not say what it was compiled for; run {how_to_build()}"
        raise environment_error(line) from None
    words = (word for text in facts.values() for word in text.split(","))
    return MACHINE + "-".join(re.sub(r"[^\w.]", "", word) for word in words)


def software_of_systems(
    software: str, systems: Iterable[str], root: Path | None = None
) -> dict[str, str]:
    """Returns system -> tag of the sources that its runs link, if `software` is that of this
    checkout. A virtual tag includes the machine. Returns nothing for programs of unknown
    sources."""
    sources, at, machine = software.partition(MACHINE)
    if sources != image_software(root):
        return {}
    linked = {system: linked_hash(system, root, virtual=bool(at)) for system in systems}
    return {
        name: f"{__version__}+{tag}{at}{machine}" for name, tag in linked.items() if tag is not None
    }


if __name__ == "__main__":
    print(source_hash())
