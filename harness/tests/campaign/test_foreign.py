# SPDX-License-Identifier: Apache-2.0
"""Systems with their own programs: the meaning of their description, before any start."""

import errno
import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from command_line import slambed
from harness_parts import write_library

from slambed.campaign.foreign import foreign_software
from slambed.engines.base import NodePlan
from slambed.engines.foreign import container_options, environment, player_arguments
from slambed.errors import SlambedError
from slambed.link.facts import LinkDetails, LinkFacts
from slambed.metrics.declared import described_by
from slambed.metrics.run_data import RunData
from slambed.metrics.run_summary import summary_of
from slambed.native import repository_root
from slambed.records.kept_spec import KeptSpec
from slambed.records.manifest import Manifest
from slambed.spec.device import Limits
from slambed.spec.library import Library
from slambed.spec.runtime import Runtime, foreign_digest

MINE = """
name: mine
title: Mine
roles: [mobile]
runtime:
  image: mine:1
  mobile: {command: [python3, run.py, "{folder}/map"], env: {PYTHONPATH: more, A: "1"}}
"""


def write_system(folder: Path, text: str = MINE) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "run.py").write_text("print(1)\n")
    path = folder / "system.yaml"
    path.write_text(text)
    return path


@pytest.fixture
def library(tmp_path: Path) -> Library:
    write_library(tmp_path / "checkout")
    return Library(tmp_path / "checkout")


def runtime_of(library: Library, path: Path) -> Runtime:
    found = library.system(str(path)).runtime
    assert found is not None
    return found


def test_a_system_is_found_by_its_file_and_by_the_folders_of_systems(
    library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_system(tmp_path / "others" / "mine")
    assert library.system(str(path)).name == "mine"
    with pytest.raises(SlambedError, match="unknown system 'mine'"):
        library.system("mine")
    monkeypatch.setenv("SLAMBED_SYSTEMS", f"/nowhere:{tmp_path / 'others'}")
    assert library.system_file("mine") == path
    assert library.systems() == ["pair", "solo"]


def test_a_path_in_an_experiment_is_seen_from_its_file(library: Library, tmp_path: Path) -> None:
    path = write_system(tmp_path / "mine")
    experiment = tmp_path / "one.yaml"
    experiment.write_text(
        "id: one\ntitle: one\nsystems: [{system: ./mine/system.yaml}]\ndatasets: [room]\n"
    )
    found, _ = library.experiment(str(experiment))
    assert found.systems[0].system == str(path)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"runtime": None}, "needs a section runtime"),
        ({"name": "solo"}, "name"),
        ({"roles": ["mobile", "edge"]}, "runtime has an edge where roles have one"),
        ({"runtime": {"mobile": {"command": []}}}, "command"),
        ({"runtime": {"mobile": {"command": ["x"], "client": False}}}, "by a client"),
    ],
)
def test_what_cannot_be_started_is_refused(
    library: Library, tmp_path: Path, change: dict[str, object], line: str
) -> None:
    content = yaml.safe_load(MINE) | change
    path = write_system(tmp_path / "mine", yaml.safe_dump(content))
    with pytest.raises(SlambedError, match=line):
        library.system(str(path))


def test_a_name_of_ours_is_refused(library: Library, tmp_path: Path) -> None:
    path = write_system(tmp_path / "solo", MINE.replace("mine\n", "solo\n", 1))
    with pytest.raises(SlambedError, match="there is a system solo already"):
        library.system(str(path))


def test_engine_virtual_is_refused_in_one_line(tmp_path: Path) -> None:
    write_system(tmp_path / "mine")
    experiment = tmp_path / "one.yaml"
    experiment.write_text(
        "id: one\ntitle: one\nsystems: [{system: ./mine/system.yaml}]\ndatasets: [synthetic_room]\n"
    )
    code, _, err = slambed("run", str(experiment), "--engine", "virtual")
    assert code == 2 and err.count("\n") == 1
    assert "a program of its own" in err and "--engine local or docker" in err


@pytest.mark.parametrize(
    ("engine", "expected"),
    [("local", "a GPU, which engine local"), ("virtual", "a program of its own")],
)
def test_a_gpu_is_refused_in_one_line_where_no_container_gets_it(
    tmp_path: Path, engine: str, expected: str
) -> None:
    write_system(tmp_path / "mine", MINE.replace("mobile: {", "mobile: {gpu: all, "))
    experiment = tmp_path / "one.yaml"
    experiment.write_text(
        "id: one\ntitle: one\nsystems: [{system: ./mine/system.yaml}]\ndatasets: [synthetic_room]\n"
    )
    code, _, err = slambed("run", str(experiment), "--check", "--engine", engine)
    assert code == 2 and err.count("\n") == 1 and expected in err


@pytest.mark.parametrize("wrong", ["true", "0", "-1", "some", "[]", "[0]", "['']", "1.5"])
def test_what_is_no_gpu_is_reported_with_its_line(
    library: Library, tmp_path: Path, wrong: str
) -> None:
    path = write_system(tmp_path / "mine", MINE.replace("mobile: {", f"mobile: {{gpu: {wrong}, "))
    with pytest.raises(SlambedError, match=r"runtime\.mobile\.gpu.* line 7"):
        library.system(str(path))


@pytest.mark.parametrize(
    ("written", "asked"),
    [
        ("all", {"Count": -1, "DeviceIDs": []}),
        ("2", {"Count": 2, "DeviceIDs": []}),
        ('["0", "GPU-6f"]', {"Count": 0, "DeviceIDs": ["0", "GPU-6f"]}),
    ],
)
def test_a_gpu_is_asked_for_as_docker_has_it(
    library: Library, tmp_path: Path, written: str, asked: dict[str, Any]
) -> None:
    path = write_system(tmp_path / "mine", MINE.replace("mobile: {", f"mobile: {{gpu: {written}, "))
    runtime = runtime_of(library, path)
    plan = NodePlan("mobile", "key", tmp_path, tmp_path, Limits(), [0], False, runtime, tmp_path)
    (request,) = container_options(plan, "image", "/out/run.json", "/out/go")["device_requests"]
    assert request == {"Driver": "", "Capabilities": [["gpu"]], "Options": {}} | asked
    path.write_text(MINE)
    plan = replace(plan, runtime=runtime_of(library, path))
    assert "device_requests" not in container_options(plan, "image", "/out/run.json", "/out/go")


def test_who_asks_for_no_gpu_keeps_the_keys_of_before(library: Library, tmp_path: Path) -> None:
    folder, images, before = tmp_path / "mine", {"mobile": "sha256:1"}, "dc562812e090"
    path = write_system(folder)
    assert foreign_digest(runtime_of(library, path), folder, images) == before
    path.write_text(MINE.replace("mobile: {", "mobile: {gpu: 1, "))
    assert foreign_digest(runtime_of(library, path), folder, images) != before


def test_its_software_is_its_files_its_start_and_its_image(
    library: Library, tmp_path: Path
) -> None:
    folder = tmp_path / "mine"
    path = write_system(folder)
    first = foreign_digest(runtime_of(library, path), folder, {"mobile": "sha256:1"})
    assert foreign_digest(runtime_of(library, path), folder, {"mobile": "sha256:2"}) != first
    (folder / "README.md").write_text("words")
    path.write_text(MINE + "doc: words\n")
    assert foreign_digest(runtime_of(library, path), folder, {"mobile": "sha256:1"}) == first
    path.write_text(MINE.replace('A: "1"', 'A: "2"'))
    assert foreign_digest(runtime_of(library, path), folder, {"mobile": "sha256:1"}) != first
    path.write_text(MINE)
    (folder / "run.py").write_text("print(2)\n")
    assert foreign_digest(runtime_of(library, path), folder, {"mobile": "sha256:1"}) != first


def test_a_file_that_belongs_to_the_software_must_be_there(
    library: Library, tmp_path: Path
) -> None:
    path = write_system(tmp_path / "mine", MINE + "  files: [vocabulary.txt]\n")
    with pytest.raises(SlambedError, match=r"vocabulary\.txt: No such file"):
        foreign_software("other", runtime_of(library, path), tmp_path / "mine", {})


def test_the_players_command_has_the_systems_folder_and_a_clean_environment(
    library: Library, tmp_path: Path
) -> None:
    runtime = runtime_of(library, write_system(tmp_path / "mine"))
    plan = NodePlan("mobile", "key", tmp_path, tmp_path, Limits(), [0], False, runtime, tmp_path)
    assert player_arguments(plan, "/out/run.json", "/system") == [
        *("--role", "mobile", "--config", "/out/run.json", "--directory", "/system"),
        *("--", "python3", "run.py", "/system/map"),
    ]
    found = environment(plan, "/clients", "/bin")
    assert found["PYTHONPATH"] == "/clients:more" and found["A"] == "1" and found["PATH"] == "/bin"
    assert "SLAMBED_TEST_PLACE" not in found


def test_bytes_of_a_system_that_reports_no_messages_are_the_links(tmp_path: Path) -> None:
    (tmp_path / "edge").mkdir()
    facts = Manifest(link=LinkFacts(details=LinkDetails(carried_bytes={"up": 700, "down": 50})))
    spec = KeptSpec.of({"roles": ["mobile", "edge"], "device_edge": {"name": "x"}})
    run = RunData(tmp_path, spec, None, facts)
    assert run.bytes_moved == {"up": 700, "down": 50}
    (tmp_path / "edge" / "events.jsonl").write_text(
        json.dumps({"t_ns": 1, "type": "message", "direction": "up", "bytes": 9, "channel": "k"})
        + "\n"
    )
    run = RunData(tmp_path, spec, None, facts)
    assert run.bytes_moved == {"up": 9, "down": 0}


@pytest.mark.parametrize("kind", ["system", "dataset", "experiment"])
def test_a_skeleton_is_written_once(kind: str, tmp_path: Path) -> None:
    assert slambed("new", kind, "fresh", "--folder", str(tmp_path))[0] == 0
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert written and not any("NAME" in path.name + path.read_text() for path in written)
    code, _, err = slambed("new", kind, "fresh", "--folder", str(tmp_path))
    assert code == 2 and "is there already" in err
    assert slambed("new", kind, "No-Name", "--folder", str(tmp_path))[0] == 2
    if kind != "system":
        code, _, err = slambed("new", kind, "other", "--reads-folder", "--folder", str(tmp_path))
        assert code == 2 and "--reads-folder is for a system" in err


def test_half_a_skeleton_does_not_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = Path.write_text

    def full(path: Path, text: str) -> int:
        if path.name == "system.yaml":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, text)

    monkeypatch.setattr(Path, "write_text", full)
    code, _, err = slambed("new", "system", "fresh", "--folder", str(tmp_path))
    assert code == 2 and f"{tmp_path / 'fresh' / 'system.yaml'}: No space left" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs a C compiler ('make build')")
def test_the_header_is_c_and_below_200_lines(tmp_path: Path) -> None:
    header = repository_root() / "systems" / "apps" / "play" / "client" / "slambed_client.h"
    assert len(header.read_text().splitlines()) < 200
    program = tmp_path / "one.c"
    program.write_text(
        f'#include "{header}"\nint main(void) {{ slambed_client c; return '
        "slambed_open(&c) == -1 ? 0 : 1; }\n"
    )
    command = ["gcc", "-std=c11", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Werror", "-o"]
    subprocess.run([*command, tmp_path / "one", program], check=True)
    ended = subprocess.run([tmp_path / "one"], capture_output=True, text=True, check=False)
    assert ended.returncode == 0 and ended.stderr.startswith("error: SLAMBED_CLIENT is not set")


def test_metrics_of_its_own_are_found_by_the_file_that_a_run_names(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    metric = "metrics: {looks: {doc: looks, event: seen, take: count, label: looks}}\n"
    write_system(folder, MINE + metric)
    (tmp_path / "mobile").mkdir()
    (tmp_path / "mobile" / "events.jsonl").write_text('{"t_ns": 1, "type": "seen"}\n')
    spec = KeptSpec(system="mine", system_folder=str(folder))
    assert summary_of(RunData(tmp_path, spec, None, Manifest()))["looks"] == 1
    # A folder with several systems names its files after them.
    (folder / "system.yaml").rename(folder / "mine.yaml")
    assert described_by("mine", str(folder)) == str(folder / "mine.yaml")
    assert described_by("mine", str(tmp_path)) == "mine"


@pytest.mark.parametrize("command", ["../build/slam", "{folder}/../build/slam", ".venv/bin/slam"])
def test_a_program_beside_the_listed_files_is_software_too(
    library: Library, tmp_path: Path, command: str
) -> None:
    folder = tmp_path / "mine"
    text = MINE.replace("  image: mine:1\n", "").replace("python3, run.py", f'"{command}"')
    path = write_system(folder, text)
    program = folder / command.replace("{folder}", str(folder))
    program.parent.mkdir(parents=True)
    program.write_text("1")
    before = foreign_digest(runtime_of(library, path), folder, {})
    program.write_text("2")
    assert foreign_digest(runtime_of(library, path), folder, {}) != before
