# SPDX-License-Identifier: Apache-2.0
"""A C++ folder may include only from dependencies of its CMake target. So a system includes another
one only if that is a declared dependency; CMake itself checks libraries only."""

import re
from collections import defaultdict
from pathlib import Path

import pytest

from slambed.native import repository_root
from slambed.spec.linked import below, libraries_of, programs_of

INCLUDE = re.compile(r'#include "([^"]+)/[^"/]+"')
NOT_LINKED = {"tests", "bench", "fuzz"}
SHARED_PARTS = {"systems", "core"}
"""Include directories, which an include does not name."""


def included_as(folder: Path, root: Path) -> str:
    """Returns `map` for systems/core/map, `apps/relay` for systems/apps/relay."""
    parts = folder.relative_to(root).parts
    return "/".join(part for part in parts if part not in SHARED_PARTS)


def wrong_includes(root: Path) -> list[str]:
    """Returns files that include from a folder that their layer or program does not depend on."""
    libraries = libraries_of(root)
    stands_on: dict[Path, set[str]] = defaultdict(set)
    for name, library in libraries.items():
        stands_on[library.folder].add(name)
    for program in programs_of(root).values():
        stands_on[program.folder].update(program.depends)
    names = {included_as(folder, root): folder for folder in stands_on}
    found = []
    for folder, used in sorted(stands_on.items()):
        allowed = {libraries[item].folder for item in below(used, libraries)} | {folder}
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder).parts
            if path.suffix not in {".cpp", ".hpp", ".h"} or NOT_LINKED.intersection(inside):
                continue
            if any(parent in stands_on for parent in path.parents[: len(inside) - 1]):
                continue  # in a folder with its own library
            found += [
                f"{path.relative_to(root)}: {include}"
                for include in INCLUDE.findall(path.read_text(encoding="utf-8"))
                if owner(include, names) not in allowed
            ]
    return found


def owner(include: str, names: dict[str, Path]) -> Path | None:
    """Returns the innermost folder with a CMake target that contains the included file."""
    parts = include.split("/")
    heads = ("/".join(parts[:count]) for count in range(len(parts), 0, -1))
    return next((names[head] for head in heads if head in names), None)


def test_nothing_is_included_that_is_not_below() -> None:
    assert wrong_includes(repository_root()) == []


def with_cmake_files_only(root: Path) -> Path:
    for path in (repository_root() / "systems").rglob("CMakeLists.txt"):
        copy = root / path.relative_to(repository_root())
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    return root


@pytest.mark.parametrize(
    ("file", "include"),
    [
        ("systems/core/map/map.hpp", "slam/tracker.hpp"),
        ("systems/core/node/policy.hpp", "run/run_config.hpp"),
        ("systems/core/offload/uplink/keyframe_uplink.hpp", "edgeslam/edgeslam.hpp"),
        ("systems/core/slam/tracker.cpp", "synth/scene.hpp"),
        ("systems/cloudslam/policies.cpp", "offload/edge/edge_mapper.hpp"),
        ("systems/edgeslam/edgeslam.cpp", "dynnetslam/strategy.hpp"),
        ("systems/edgeslam/edgeslam.cpp", "orbslam2/orbslam2.hpp"),
        ("systems/synth/scene.cpp", "slam/tracker.hpp"),
        ("systems/apps/relay/relay.cpp", "apps/pace/busy.hpp"),
        ("systems/apps/play/player.cpp", "edgeslam/edgeslam.hpp"),
        ("systems/apps/maps/slambed_map.cpp", "node/mobile_node.hpp"),
    ],
)
def test_one_that_is_included_is_found(tmp_path: Path, file: str, include: str) -> None:
    path = with_cmake_files_only(tmp_path) / file
    path.parent.mkdir(exist_ok=True)
    path.write_text(f'#include "{include}"\n', encoding="utf-8")
    assert wrong_includes(tmp_path) == [f"{file}: {include.rpartition('/')[0]}"]


def test_a_system_includes_another_one_where_cmake_says_that_it_builds_on_it(
    tmp_path: Path,
) -> None:
    folder = with_cmake_files_only(tmp_path) / "systems" / "mine"
    folder.mkdir()
    (folder / "mine.cpp").write_text('#include "edgeslam/edgeslam.hpp"\n', encoding="utf-8")
    text = "slambed_library(mine SOURCES mine.cpp DEPENDS slambed_offload)\n"
    (folder / "CMakeLists.txt").write_text(text, encoding="utf-8")
    assert wrong_includes(tmp_path) == ["systems/mine/mine.cpp: edgeslam"]
    text = text.replace("offload", "edgeslam")
    (folder / "CMakeLists.txt").write_text(text, encoding="utf-8")
    assert wrong_includes(tmp_path) == []
