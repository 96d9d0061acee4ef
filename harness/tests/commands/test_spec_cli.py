# SPDX-License-Identifier: Apache-2.0
"""`slambed systems`, `devices` and `experiments` list everything that has a file."""

import json
from pathlib import Path

import pytest
from command_line import slambed
from test_foreign import write_system

from slambed.errors import ExitCode
from slambed.native import repository_root
from slambed.spec.library import Library

KINDS = {
    "systems": Library().systems(),
    "devices": Library().devices(),
    "experiments": Library().experiments(),
}


@pytest.fixture(autouse=True)
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "300")


@pytest.mark.parametrize("kind", KINDS)
def test_all_are_listed(kind: str) -> None:
    code, out, _ = slambed(kind)
    assert code == ExitCode.OK
    first = [line.split()[0] for line in out.splitlines() if line.startswith(" ") and line.split()]
    assert set(KINDS[kind]) <= set(first)
    assert "not usable" not in out


@pytest.mark.parametrize("kind", KINDS)
def test_each_is_shown(kind: str) -> None:
    for name in KINDS[kind]:
        code, out, _ = slambed(kind, "show", name)
        assert code == ExitCode.OK and len(out.splitlines()) > 2, name
        code, out, _ = slambed(kind, "show", name, "--json")
        assert code == ExitCode.OK and json.loads(out)["title"], name


def test_a_parameter_has_default_range_unit_and_source() -> None:
    _, out, _ = slambed("systems", "show", "orbslam2")
    line = next(line for line in out.splitlines() if line.split()[:1] == ["n_orb"])
    for part in ("1000", "50 to 10000", "features", "ORB-SLAM2, TUM settings"):
        assert part in line


@pytest.mark.parametrize(
    ("kind", "name", "expected"),
    [
        ("systems", "orbslam", "did you mean 'orbslam2'"),
        ("devices", "raspberry_pi", "raspberry_pi_4"),
        ("experiments", "quikstart", "did you mean 'quickstart'"),
    ],
)
def test_an_unknown_one_is_one_line(kind: str, name: str, expected: str) -> None:
    code, _, err = slambed(kind, "show", name)
    assert code == ExitCode.BAD_INPUT
    assert expected in err and len(err.splitlines()) == 1


def test_a_file_that_cannot_be_read_is_a_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for folder in ("systems", "catalog"):
        (tmp_path / folder).symlink_to(repository_root() / folder)
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments" / "torn.yaml").write_text("id: torn\ntitle: [\n")
    monkeypatch.setattr("slambed.spec.library.repository_root", lambda: tmp_path)
    code, out, _ = slambed("experiments")
    assert code == ExitCode.OK
    assert "torn" in out and "not usable" in out


LISTS = ("systems", "devices", "experiments", "profiles", "data", "inputs", "masks")


@pytest.mark.parametrize("kind", LISTS)
def test_all_lists_are_alike(kind: str) -> None:
    code, out, err = slambed(kind, "list")
    assert code == ExitCode.OK, err
    # The last lines tell how to show one.
    assert f"'slambed {kind} show " in "".join(out.splitlines()[-2:])
    assert slambed(kind) == (code, out, err)
    document = slambed(kind, "list", "--json")
    assert document[0] == ExitCode.OK and json.loads(document[1])
    assert slambed(kind, "--json") == document


def test_systems_of_ones_own_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_system(tmp_path / "mine")
    monkeypatch.setenv("SLAMBED_SYSTEMS", f"/nowhere:{tmp_path}")
    _, out, _ = slambed("systems")
    assert {"mine", "orbslam2"} <= {line.split()[0] for line in out.splitlines() if line.split()}
