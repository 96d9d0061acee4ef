# SPDX-License-Identifier: Apache-2.0
"""The run key of a system covers the code that it links; a change elsewhere, or in a comment,
leaves it unchanged."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from slambed.native import repository_root
from slambed.spec import linked
from slambed.spec.linked import linked_hash
from slambed.spec.software import image_software, software_of_systems

ORBSLAM2 = "orbslam2"
WITH_EDGE = {
    "cloudslam", "dynnetslam", "edgeslam", "edgeslam_semantic", "example_backpressure",
    "multithread_rl",
}  # fmt: skip
ALL = WITH_EDGE | {ORBSLAM2}
EDGE_SLAM = {"dynnetslam", "edgeslam", "example_backpressure", "multithread_rl"}
"""Systems that link Edge-SLAM's two nodes."""
WITH_MAPPER = EDGE_SLAM | {"edgeslam_semantic"}
EDGESLAM = {"edgeslam", "multithread_rl"}
"""edgeslam and the systems that build on it."""
PLAYER = "play"
"""The player of systems with their own programs, whose run keys include it."""
NONE: set[str] = set()
ADDED = "int added = 1;\n"

Keys = dict[tuple[str, bool], str | None]


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of the programs' sources; parsed files are cached."""
    root = tmp_path_factory.mktemp("sources")
    for name in ("CMakeLists.txt", "cmake", "docker", "systems"):
        source, target = repository_root() / name, root / name
        if source.is_dir():
            shutil.copytree(source, target)
        else:
            shutil.copy(source, target)
    parsed: dict[tuple[Path, bytes], bytes] = {}
    parse = linked._code

    def code(path: Path) -> bytes:
        key = (path, path.read_bytes())
        if key not in parsed:
            parsed[key] = parse(path)
        return parsed[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(linked, "_code", code)
        yield root


@pytest.fixture(scope="module")
def keys(sources: Path) -> Keys:
    """The hash of each system, live and virtual."""
    return keys_of(sources)


def keys_of(sources: Path) -> Keys:
    return {
        (name, virtual): linked_hash(name, sources, virtual=virtual)
        for name in {*ALL, PLAYER}
        for virtual in (False, True)
    }


def changed_by(
    sources: Path, keys: Keys, pattern: str, line: str = ADDED
) -> tuple[set[str], set[str]]:
    """Returns the systems whose live and whose virtual hashes change with a line added to the
    first matching file."""
    file = min(sources.glob(pattern))
    before = file.read_bytes()
    file.write_bytes(before + line.encode())
    try:
        after = keys_of(sources)
    finally:
        file.write_bytes(before)
    live, virtual = (
        {name for name, other in keys if other is kind and after[name, kind] != keys[name, kind]}
        for kind in (False, True)
    )
    return live, virtual - {PLAYER}  # It has live runs only.


@pytest.mark.parametrize(
    ("file", "live", "virtual"),
    [
        # The core: all systems.
        ("systems/core/map/map.cpp", ALL | {PLAYER}, ALL),
        ("systems/core/slam/local_mapper.cpp", ALL | {PLAYER}, ALL),
        ("systems/core/link/rate.cpp", ALL | {PLAYER}, ALL),
        ("systems/core/run/run_config.cpp", ALL | {PLAYER}, ALL),
        ("systems/core/features/data/orb_10k.slv", ALL | {PLAYER}, ALL),
        ("systems/core/CMakeLists.txt", ALL | {PLAYER}, ALL),
        ("systems/core/offload/channels/message_codec.cpp", WITH_EDGE, WITH_EDGE),
        ("systems/core/offload/maps/update_content.hpp", WITH_EDGE, WITH_EDGE),
        # The layers for the edge: the systems that use them.
        ("systems/core/offload/nodes/settings.cpp", EDGE_SLAM, EDGE_SLAM),
        ("systems/core/offload/downlink/update_rules.cpp", EDGE_SLAM, EDGE_SLAM),
        ("systems/core/offload/edge/edge_mapper.cpp", WITH_MAPPER, WITH_MAPPER),
        ("systems/core/offload/uplink/admission.cpp", WITH_MAPPER, WITH_MAPPER),
        ("systems/core/offload/shutdown/shutdown.cpp", WITH_EDGE, WITH_EDGE),
        ("systems/core/offload/CMakeLists.txt", NONE, NONE),
        # A system: itself, and the systems that build on it.
        ("systems/orbslam2/orbslam2.cpp", {ORBSLAM2}, {ORBSLAM2}),
        ("systems/dynnetslam/strategy.cpp", {"dynnetslam"}, {"dynnetslam"}),
        ("systems/cloudslam/trip_archive.cpp", {"cloudslam"}, {"cloudslam"}),
        ("systems/cloudslam/strategy.cpp", {"cloudslam"}, {"cloudslam"}),
        ("systems/multithread_rl/*.cpp", {"multithread_rl"}, {"multithread_rl"}),
        ("systems/edgeslam_semantic/uploads.cpp", {"edgeslam_semantic"}, {"edgeslam_semantic"}),
        ("systems/edgeslam/edgeslam.cpp", EDGESLAM, EDGESLAM),
        ("systems/edgeslam/CMakeLists.txt", EDGESLAM, EDGESLAM),
        # The programs: all runs that start them.
        ("systems/apps/node/slambed_node.cpp", ALL, NONE),
        ("systems/apps/relay/pipe.cpp", ALL | {PLAYER}, NONE),
        ("systems/apps/pace/metronome.cpp", ALL | {PLAYER}, NONE),
        ("systems/apps/sim/slambed_sim.cpp", NONE, ALL),
        ("systems/apps/registry/systems.cpp.in", ALL, ALL),
        ("systems/apps/play/player.cpp", {PLAYER}, NONE),
        ("systems/apps/play/client/slambed_client.h", {PLAYER}, NONE),
        ("docker/Dockerfile", ALL | {PLAYER}, NONE),
        ("cmake/SlambedTargets.cmake", ALL | {PLAYER}, ALL),
        # Not linked by any run.
        ("systems/synth/renderer.cpp", NONE, NONE),
        ("systems/synth/CMakeLists.txt", NONE, NONE),
        ("systems/apps/CMakeLists.txt", NONE, NONE),
        ("systems/apps/synth/slambed_synth.cpp", NONE, NONE),
        ("systems/apps/vocabulary/retrieval.cpp", NONE, NONE),
        ("systems/apps/vocabulary/slambed_vocab.cpp", NONE, NONE),
        ("systems/apps/culling/slambed_culling.cpp", NONE, NONE),
        ("systems/apps/maps/slambed_map.cpp", NONE, NONE),
        ("systems/core/slam/tests/tracker_test.cpp", NONE, NONE),
        ("systems/core/wire/fuzz/core_targets.cpp", NONE, NONE),
        ("systems/dynnetslam/README.md", NONE, NONE),
    ],
)
def test_a_line_counts_where_it_is_linked(
    sources: Path, keys: Keys, file: str, live: set[str], virtual: set[str]
) -> None:
    assert changed_by(sources, keys, file) == (live, virtual)


def test_a_system_that_builds_on_another_one_has_its_code_in_its_key(sources: Path) -> None:
    folder = sources / "systems" / "mine"
    folder.mkdir()
    (folder / "CMakeLists.txt").write_text(
        "slambed_library(mine SOURCES mine.cpp DEPENDS slambed_edgeslam)\n"
    )
    before = linked_hash("mine", sources)
    try:
        for pattern, changes in (
            ("systems/edgeslam/edgeslam.cpp", True),
            ("systems/core/offload/edge/edge_mapper.cpp", True),
            ("systems/dynnetslam/strategy.cpp", False),
        ):
            file = min(sources.glob(pattern))
            text = file.read_bytes()
            file.write_bytes(text + ADDED.encode())
            assert (linked_hash("mine", sources) != before) is changes
            file.write_bytes(text)
    finally:
        shutil.rmtree(folder)


def test_a_folder_inside_a_library_counts_as_the_library_does(sources: Path, keys: Keys) -> None:
    part = sources / "systems" / "core" / "map" / "a_part"
    part.mkdir()
    try:
        (part / "new.hpp").write_text("#pragma once\n")
        after = keys_of(sources)
    finally:
        shutil.rmtree(part)
    assert {name for name, virtual in keys if after[name, virtual] != keys[name, virtual]} == (
        ALL | {PLAYER}
    )


def test_a_folder_with_a_library_of_its_own_counts_where_that_is_linked(
    sources: Path, keys: Keys
) -> None:
    part = sources / "systems" / "core" / "map" / "a_part"
    part.mkdir()
    user = sources / "systems" / "orbslam2" / "CMakeLists.txt"
    before = user.read_text()
    try:
        (part / "CMakeLists.txt").write_text("slambed_library(a_part SOURCES a.cpp)\n")
        (part / "a.cpp").write_text("int a = 1;\n")
        assert keys_of(sources) == keys
        user.write_text(before.replace("DEPENDS ", "DEPENDS slambed_a_part "))
        linking = keys_of(sources)
        (part / "a.cpp").write_text("int a = 2;\n")
        after = keys_of(sources)
    finally:
        user.write_text(before)
        shutil.rmtree(part)
    assert {name for name, virtual in keys if after[name, virtual] != linking[name, virtual]} == {
        ORBSLAM2
    }


@pytest.mark.parametrize("comment", ["// why\n", "/* a\n b */\n", "\n\n", "  // it's \"so\n"])
def test_comments_do_not_count(sources: Path, keys: Keys, comment: str) -> None:
    for file in ("systems/core/slam/local_mapper.cpp", "systems/apps/relay/pipe.cpp"):
        assert changed_by(sources, keys, file, comment) == (NONE, NONE)


def test_comments_of_cmake_do_not_count(sources: Path, keys: Keys) -> None:
    for file in ("systems/CMakeLists.txt", "cmake/SlambedTargets.cmake"):
        assert changed_by(sources, keys, file, "# why\n") == (NONE, NONE)


def test_what_looks_like_a_comment_in_a_string_counts(sources: Path, keys: Keys) -> None:
    name = "systems/core/slam/local_mapper.cpp"
    for line in (
        'const char* a = "http://x";\n',
        'const char* a = "http://y";\n',
        'auto b = R"x( // y )x";\n',
        "const int n = 1'000; const char c = '\"'; // z\n",
    ):
        assert changed_by(sources, keys, name, line) == (ALL | {PLAYER}, ALL)


def test_programs_of_unknown_sources_have_one_name() -> None:
    tags = software_of_systems(image_software(), ALL)
    assert set(tags) == ALL and len(set(tags.values())) == len(ALL)
    assert software_of_systems("0.1.0+bin.123", ALL) == {}


def test_every_system_of_ours_is_in_the_table() -> None:
    systems = {file.parent.name for file in (repository_root() / "systems").glob("*/system.yaml")}
    assert systems & set(linked.libraries_of(repository_root())) == ALL
