# SPDX-License-Identifier: Apache-2.0
"""Which C++ sources a node is made of: part of a run's key and of the image's tag.

What builds the programs calls this before there are any packages: the standard library must do.
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
# None of these changes what a node does.
LEFT_OUT_FOLDERS = {"tests", "bench", "__pycache__"}
LEFT_OUT_SUFFIXES = {".md", ".yaml"}
STAMP = "sources.sha256"
MACHINE = "@"
"""Between sources and machine in the tag of a virtual run's software."""


def source_hash(root: Path | None = None) -> str:
    """SHA-256 (12 hex digits) over names and bytes of everything a node is built from."""
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
    """Software tag of runs in the image that belongs to the sources of this checkout."""
    return f"{__version__}+{source_hash(root)}"


def host_software(root: Path | None = None, program: str = "slambed-node") -> str:
    """Software tag of runs with the programs built on this host.

    `make build` leaves a stamp beside the programs. A stamp of other sources means the programs
    are stale; programs without one (a developer's own build) are named by their own bytes.
    A virtual run's tag goes on with what the simulation was compiled for, by what and with which
    libraries: the same sources give the same bytes where these are the same
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
    """`@x86_64-sse2-gcc12.2.0-...`, as the program says it. Once for a campaign, not for a run."""
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
    """System -> tag of the sources that its runs link, where `software` is that of this checkout,
    live or virtual (a virtual one names its machine); for programs of unknown sources nothing more
    is known than their own name."""
    sources, at, machine = software.partition(MACHINE)
    if sources != image_software(root):
        return {}
    linked = {system: linked_hash(system, root, virtual=bool(at)) for system in systems}
    return {
        name: f"{__version__}+{tag}{at}{machine}" for name, tag in linked.items() if tag is not None
    }


if __name__ == "__main__":
    print(source_hash())
