# SPDX-License-Identifier: Apache-2.0
"""A system's software is what it links: a line elsewhere, or a comment, leaves its runs valid."""

import shutil
from pathlib import Path

import pytest

from slambed.native import repository_root
from slambed.spec.linked import linked_hash
from slambed.spec.software import image_software, software_of_systems

SYSTEMS = ("orbslam2", "edgeslam", "dynnetslam")


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for name in ("CMakeLists.txt", "cmake", "docker", "systems", "harness/pace", "harness/relay"):
        source, target = repository_root() / name, tmp_path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copy(source, target)
    return tmp_path


def changed_by(checkout: Path, name: str, line: str) -> set[str]:
    """Systems whose hash a line at the end of a file changes."""
    before = {system: linked_hash(system, checkout) for system in SYSTEMS}
    with (checkout / name).open("a") as out:
        out.write(line)
    return {system for system in SYSTEMS if linked_hash(system, checkout) != before[system]}


@pytest.mark.parametrize(
    ("name", "systems"),
    [
        ("systems/dynnetslam/strategy.cpp", {"dynnetslam"}),
        ("systems/edgeslam/policies.hpp", {"edgeslam"}),
        ("systems/core/offload/uplink/admission.cpp", {"edgeslam", "dynnetslam"}),
        ("systems/dynnetslam/handover_client.cpp", {"dynnetslam"}),
        ("systems/edgeslam/edge_slam.cpp", {"edgeslam"}),
        ("systems/core/slam/local_mapper.cpp", set(SYSTEMS)),
        ("systems/core/link/rate.cpp", set(SYSTEMS)),
        ("systems/core/slam/tests/new_test.cpp", set()),
        ("systems/tools/retrieval.cpp", set()),
        ("systems/dynnetslam/README.md", set()),
    ],
)
def test_a_line_counts_where_it_is_linked(checkout: Path, name: str, systems: set[str]) -> None:
    assert changed_by(checkout, name, "int added = 1;\n") == systems


@pytest.mark.parametrize("comment", ["// why\n", "/* a\n b */\n", "\n\n", "  // it's \"so\n"])
def test_comments_do_not_count(checkout: Path, comment: str) -> None:
    assert changed_by(checkout, "systems/core/slam/local_mapper.cpp", comment) == set()


def test_what_looks_like_a_comment_in_a_string_counts(checkout: Path) -> None:
    name = "systems/core/slam/local_mapper.cpp"
    for line in (
        'const char* a = "http://x";\n',
        'const char* a = "http://y";\n',
        'auto b = R"x( // y )x";\n',
        "const int n = 1'000; const char c = '\"'; // z\n",
    ):
        assert changed_by(checkout, name, line) == set(SYSTEMS)


def test_programs_of_unknown_sources_have_one_name() -> None:
    tags = software_of_systems(image_software(), SYSTEMS)
    assert set(tags) == set(SYSTEMS) and len(set(tags.values())) == 3
    assert software_of_systems("0.1.0+bin.123", SYSTEMS) == {}
