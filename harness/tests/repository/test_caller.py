# SPDX-License-Identifier: Apache-2.0
"""What root writes through sudo belongs to the caller."""

import os
import subprocess
from pathlib import Path

import pytest
from command_line import slambed, slambed_process
from harness_parts import needs_root

from slambed.caller import give_to_caller, will_be_callers
from slambed.errors import ExitCode
from slambed.native import repository_root

pytestmark = needs_root
CALLER = {"SUDO_UID": "65534", "SUDO_GID": "65533"}
ROOT = (0, 0)
MINE = (65534, 65533)


def owner(path: Path) -> tuple[int, int]:
    status = path.lstat()
    return status.st_uid, status.st_gid


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home as left by a first run with sudo; a second folder belongs to root on purpose."""
    (tmp_path / "home").mkdir()
    os.chown(tmp_path / "home", *MINE)
    prepared = tmp_path / "home" / ".cache" / "slambed" / "prepared"
    prepared.mkdir(parents=True)
    (prepared / "sequence").write_text("")
    (prepared / "link").symlink_to(tmp_path / "elsewhere")
    (prepared / "others").write_text("")
    (prepared.parent / "of_root").write_text("")
    os.chown(prepared / "others", 1234, 1234)
    (tmp_path / "elsewhere").write_text("")
    (tmp_path / "home" / "of_root").mkdir()
    return tmp_path / "home"


def where(home: Path, command: tuple[str, ...] = ("data", "where"), **environment: str) -> None:
    unset = {"XDG_CACHE_HOME": "", "SLAMBED_CACHE": "", "MPLCONFIGDIR": str(home / "mpl")}
    code, _, err = slambed(*command, **{"HOME": str(home), **unset, **environment})
    assert code == ExitCode.OK, err


def test_the_cache_is_the_callers_after_every_command(home: Path) -> None:
    where(home, **CALLER)
    cache = home / ".cache" / "slambed"
    for path in (home / ".cache", cache, cache / "prepared", *(cache / "prepared").iterdir()):
        assert owner(path) == ((1234, 1234) if path.name == "others" else MINE), path
    assert owner(home / "of_root") == owner(home.parent / "elsewhere") == ROOT
    assert owner(cache / "of_root") == ROOT  # nothing that slambed makes


def test_a_command_that_writes_nothing_gives_nothing(home: Path) -> None:
    for option in ("--version", "--help"):
        where(home, (option,), **CALLER)
    assert owner(home / ".cache") == owner(home / ".cache" / "slambed" / "prepared") == ROOT


def test_a_real_process_that_only_reports_its_version_touches_no_owner(tmp_path: Path) -> None:
    """Files in a cache may belong to any user. The inodes' change times reveal any chown."""
    for owner_of_it, name in (
        (0, "prepared"),
        (1234, "features"),
        (0, "somebody's"),
        (65534, "uml"),
    ):
        (tmp_path / name / "below").mkdir(parents=True)
        os.chown(tmp_path / name / "below", owner_of_it, owner_of_it)
    os.chown(tmp_path, *MINE)
    paths = [tmp_path, *sorted(tmp_path.rglob("*"))]
    before = [(owner(path), path.lstat().st_ctime_ns) for path in paths]
    code, out, err = slambed_process("--version", SLAMBED_CACHE=str(tmp_path), **CALLER)
    assert code == ExitCode.OK and out.strip() and not err
    assert [(owner(path), path.lstat().st_ctime_ns) for path in paths] == before


def test_a_cache_of_roots_own_stays_so(home: Path) -> None:
    cache = home / ".cache" / "slambed"
    where(home)
    assert owner(cache) == ROOT
    os.chown(home, *ROOT)
    where(home, **CALLER)
    assert owner(cache) == owner(cache / "prepared" / "sequence") == ROOT


def test_a_cache_where_everybody_may_write_is_given(home: Path) -> None:
    home.chmod(0o1777)
    os.chown(home, *ROOT)
    where(home, SLAMBED_CACHE=str(home / "of_root"), **CALLER)
    assert owner(home / "of_root") == MINE and owner(home) == owner(home / ".cache") == ROOT


def test_results_are_given_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in CALLER.items():
        monkeypatch.setenv(name, value)
    (tmp_path / "results" / "runs").mkdir(parents=True)
    give_to_caller(tmp_path / "results")
    assert owner(tmp_path / "results") == owner(tmp_path / "results" / "runs") == MINE
    assert owner(tmp_path) == ROOT


def test_what_another_campaign_removes_meanwhile_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in CALLER.items():
        monkeypatch.setenv(name, value)
    (tmp_path / "runs" / "1").mkdir(parents=True)
    (tmp_path / "runs" / "2").mkdir()
    chown = os.lchown

    def remove_first(path: Path, *caller: int) -> None:
        if path.name == "1":
            path.rmdir()
        chown(path, *caller)

    monkeypatch.setattr(os, "lchown", remove_first)
    give_to_caller(tmp_path / "runs")
    assert owner(tmp_path / "runs") == owner(tmp_path / "runs" / "2") == MINE


def test_a_folder_that_was_written_to_is_given_at_the_end_of_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A report is written after the campaign, with a lock file next to it."""
    monkeypatch.setattr("slambed.caller._written", set())
    mine, roots = tmp_path / "mine", tmp_path / "roots"
    for home in (mine, roots):
        (home / "results" / ".work").mkdir(parents=True)
        (home / "results" / ".work" / ".lock").write_text("")
        (home / "results" / "others").write_text("")
        os.chown(home / "results" / "others", 1234, 1234)
        will_be_callers(home / "results")
    os.chown(mine, *MINE)
    where(mine, **CALLER)
    assert {owner(path) for path in (mine / "results").rglob("*")} == {MINE, (1234, 1234)}
    assert owner(mine / "results") == MINE and owner(roots / "results" / ".work") == ROOT


GIVE = 'source "$1/tools/environment.sh" >/dev/null; give_to_caller "$2" "$3" /nowhere/at/all'


def test_what_make_made_under_sudo_is_the_callers(tmp_path: Path) -> None:
    mine, roots = tmp_path / "mine", tmp_path / "roots"
    for tree in (mine, roots):
        (tree / ".venv" / "bin").mkdir(parents=True)
        (tree / ".venv" / "bin" / "python").symlink_to("/elsewhere")
    os.chown(mine, *MINE)
    command = ["bash", "-euc", GIVE, "bash", repository_root(), mine / ".venv", roots / ".venv"]
    subprocess.run(command, check=True, env=os.environ | CALLER)
    assert {owner(path) for path in (mine / ".venv").rglob("*")} == {MINE}
    assert owner(mine / ".venv") == MINE and owner(roots / ".venv") == ROOT
