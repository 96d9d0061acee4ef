# SPDX-License-Identifier: Apache-2.0
"""Schemas of the YAML files, tested with a validator independent of pydantic."""

import datetime
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from checkout import known_files
from command_line import refused, slambed
from jsonschema import Draft202012Validator

from slambed.commands.completion import KINDS as OFFERED
from slambed.native import repository_root
from slambed.schema.kinds import KINDS, schema_text

ROOT = repository_root()
OTHERS = (".github/", ".vscode/")
"""Folders with files of other tools' formats."""


def kind_of(path: str) -> str:
    """Returns the one kind with a matching pattern; an editor would mix two of them."""
    if path in ("catalog/templates/experiment.yaml", "catalog/templates/dataset.yaml"):
        return Path(path).stem

    def fits(pattern: str) -> bool:
        return Path(path).match(pattern.removeprefix("!").removeprefix("**/"))

    found = [
        kind
        for kind, item in KINDS.items()
        if any(fits(p) for p in item.places if p[0] != "!")
        and not any(fits(p) for p in item.places if p[0] == "!")
    ]
    assert len(found) == 1, (path, found)
    return found[0]


def plain(value: Any) -> Any:
    """Converts to JSON types: keys and dates are text."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value.isoformat() if isinstance(value, datetime.date) else value


def files() -> list[str]:
    found = known_files(ROOT, "*.yaml", "*.yml") or [
        str(p.relative_to(ROOT)) for p in ROOT.glob("[a-z]*/**/*.yaml")
    ]
    return [path for path in found if not path.startswith((*OTHERS, "build"))]


VALIDATORS = {kind: Draft202012Validator(json.loads(schema_text(kind))) for kind in KINDS}


@pytest.mark.parametrize("kind", KINDS)
def test_a_schema_is_one_and_is_the_one_that_lies_in_the_checkout(kind: str) -> None:
    Draft202012Validator.check_schema(VALIDATORS[kind].schema)
    message = f"'slambed schema --folder catalog/schemas' writes {kind}.json anew"
    assert (ROOT / "catalog/schemas" / f"{kind}.json").read_text() == schema_text(kind), message


def test_every_yaml_file_of_the_repository_keeps_to_its_schema() -> None:
    listed = files()
    assert len(listed) > 200
    wrong = []
    used = set()
    for path in listed:
        kind = kind_of(path)
        used.add(kind)
        # In templates NAME is a placeholder for a name.
        content = plain(yaml.safe_load((ROOT / path).read_text().replace("NAME", "mine")))
        wrong += [
            f"{path}: {e.json_path} {e.message}" for e in VALIDATORS[kind].iter_errors(content)
        ]
    assert not wrong, "\n".join(wrong[:20])
    assert used == set(KINDS)


def bad(kind: str, path: str, change: Callable[[Any], Any]) -> list[str]:
    content = plain(yaml.safe_load((ROOT / path).read_text()))
    change(content)
    return [error.message for error in VALIDATORS[kind].iter_errors(content)]


@pytest.mark.parametrize(
    ("kind", "path", "change"),
    [
        ("experiment", "experiments/quickstart.yaml", lambda d: d.update(titel="x")),
        ("experiment", "experiments/quickstart.yaml", lambda d: d.pop("systems")),
        ("experiment", "experiments/quickstart.yaml", lambda d: d["link"].pop("profiles")),
        ("experiment", "experiments/quickstart.yaml", lambda d: d.update(engine="moby")),
        ("experiment", "experiments/quickstart.yaml", lambda d: d.update(grid={"n_orb": [1]})),
        (
            "experiment", "experiments/quickstart.yaml",
            lambda d: d["link"].update(profiles=[{"name": "x", "rtt": 4}]),
        ),
        ("system", "systems/orbslam2/system.yaml", lambda d: d["params"]["n_orb"].pop("type")),
        ("system", "systems/edgeslam/system.yaml", lambda d: d.update(roles=["car"])),
        ("system", "examples/opencv_odometry/system.yaml", lambda d: d["runtime"].pop("mobile")),
        ("shared-params", "systems/core/offload/params.yaml", lambda d: d.update(x={"min": 1})),
        ("device", "catalog/devices/raspberry_pi_4.yaml", lambda d: d.update(limits={"core": 1})),
        ("device-fit", "catalog/devices/fits/ijnc.yaml", lambda d: d.update(components=[])),
        ("dataset", "catalog/datasets/synthetic_room.yaml", lambda d: d.update(sensor="lidar")),
        ("profile", "netem_profiles/sine.yaml", lambda d: d.pop("rtt_ms")),
        ("profile", "netem_profiles/sine.yaml", lambda d: d.update(rtt_ms={"wave": {}})),
        ("profile", "netem_profiles/sine.yaml", lambda d: d.update(rtt_ms="high")),
        ("profile", "netem_profiles/sine.yaml", lambda d: d.update(loss={"random": 2})),
        ("paper", "papers/dynnetslam/paper.yaml", lambda d: d.update(kind="book")),
        ("plan", "papers/dynnetslam/plan.yaml", lambda d: d.pop("frozen")),
        ("input", "catalog/inputs/{first}", lambda d: d.update(yields="gold")),
        ("network", "catalog/networks/slambed_people.yaml", lambda d: d.update(license=5)),
        ("inference", "papers/dynnetslam/inference/dynnet_t2.yaml", lambda d: d.update(open=[])),
        ("hosts", "examples/hosts/hosts.yaml", lambda d: d.update(hosts=[])),
        ("hosts", "examples/hosts/hosts.yaml", lambda d: d["hosts"][0].update(core=4)),
        ("hosts", "examples/hosts/hosts.yaml", lambda d: d["hosts"][0].update(address="-oProxy")),
    ],
)  # fmt: skip
def test_what_is_wrong_is_refused(kind: str, path: str, change: Callable[[Any], Any]) -> None:
    path = path.replace("{first}", min(p.name for p in (ROOT / "catalog/inputs").glob("*.yaml")))
    assert bad(kind, path, lambda _: None) == []
    assert bad(kind, path, change)


def test_keys_say_what_they_mean() -> None:
    playback = VALIDATORS["experiment"].schema["$defs"]["Playback"]["properties"]
    assert "every k-th frame is kept" in playback["fps"]["description"]


def test_editors_find_them() -> None:
    """The setting of VS Code's YAML extension names every schema and its places."""
    settings = json.loads((ROOT / ".vscode/settings.json").read_text())["yaml.schemas"]
    assert settings == {
        f"./catalog/schemas/{k}.json": list(item.places) for k, item in KINDS.items()
    }
    assert set(OFFERED) == set(KINDS)


def test_a_skeleton_names_its_schema(tmp_path: Path) -> None:
    for kind, file in (("experiment", "mine.yaml"), ("system", "own/system.yaml")):
        name = file.split("/")[0].removesuffix(".yaml")
        assert slambed("new", kind, name, "--folder", str(tmp_path))[0] == 0
        head = (tmp_path / file).read_text().splitlines()[0]
        named = head.removeprefix("# yaml-language-server: $schema=")
        assert json.loads(Path(named).read_text())["title"] == KINDS[kind].title


def test_the_command_prints_one_and_refuses_others(tmp_path: Path) -> None:
    code, out, err = slambed("schema", "device")
    assert (code, err) == (0, "") and out == schema_text("device")
    assert "did you mean 'system'" in refused(2, "schema", "sytem")
    assert slambed("schema", "--folder", str(tmp_path / "all"))[0] == 0
    assert {path.stem for path in (tmp_path / "all").iterdir()} == set(KINDS)
