# SPDX-License-Identifier: Apache-2.0
"""A floor of the C++ includes what lies below it and nothing else; CMake sees libraries only."""

import re
from pathlib import Path

import pytest

from slambed.native import repository_root
from slambed.spec.linked import below, floors_of

INCLUDE = re.compile(r'#include "([a-z0-9_/]+)/[^"/]+"')
NOT_LINKED = {"tests", "bench", "fuzz"}
ABOVE_ALL = {"systems", "retrieval"}
"""They link every system, or are programs for people at a desk."""


def included_as(folder: Path, root: Path) -> str:
    """`map` of systems/core/map, `offload/edge` of systems/core/offload/edge."""
    parts = folder.relative_to(root / "systems").parts
    return "/".join(part for part in parts if part != "core")


def wrong_includes(root: Path) -> list[str]:
    """Files that include from a folder that their floor does not stand on."""
    floors = floors_of(root)
    found = []
    for name, (folder, _) in floors.items():
        if name in ABOVE_ALL:
            continue
        allowed = {included_as(floors[item][0], root) for item in below([name], floors)}
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder).parts
            if path.suffix not in {".cpp", ".hpp", ".h"} or NOT_LINKED.intersection(inside):
                continue
            found += [
                f"{path.relative_to(root)}: {used}"
                for used in INCLUDE.findall(path.read_text(encoding="utf-8"))
                if not any(f"{used}/".startswith(f"{item}/") for item in allowed)
            ]
    return found


def test_no_header_of_a_floor_above_is_included() -> None:
    assert wrong_includes(repository_root()) == []


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("systems/core/map/map.hpp", '#include "slam/tracker.hpp"'),
        ("systems/core/node/policy.hpp", '#include "run/run_config.hpp"'),
        ("systems/edgeslam/edgeslam.cpp", '#include "dynnetslam/strategy.hpp"'),
        ("systems/cloudslam/policies.cpp", '#include "offload/edge/edge_mapper.hpp"'),
    ],
)
def test_one_that_is_included_is_found(tmp_path: Path, file: str, line: str) -> None:
    for path in (repository_root() / "systems").rglob("CMakeLists.txt"):
        copy = tmp_path / path.relative_to(repository_root())
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / file).write_text(line + "\n", encoding="utf-8")
    assert wrong_includes(tmp_path) == [f"{file}: {line.split(chr(34))[1].rpartition('/')[0]}"]


def test_no_source_is_longer_than_can_be_read_at_once() -> None:
    most = 350
    long = [
        f"{path.relative_to(repository_root())}: {lines}"
        for folder in ("systems", "harness")
        for path in sorted((repository_root() / folder).rglob("*.[ch]pp"))
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > most
    ]
    assert long == [], f"more than {most} lines"
