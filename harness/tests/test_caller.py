# SPDX-License-Identifier: Apache-2.0
"""What root writes through sudo belongs to the caller."""

import os
from pathlib import Path

import pytest
from command_line import slambed, slambed_process
from harness_parts import needs_root

from slambed.caller import give_to_caller
from slambed.errors import ExitCode

pytestmark = needs_root
CALLER = {"SUDO_UID": "65534", "SUDO_GID": "65533"}
ROOT = (0, 0)
MINE = (65534, 65533)


def owner(path: Path) -> tuple[int, int]:
    status = path.lstat()
    return status.st_uid, status.st_gid


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home as a first run through sudo leaves it; a second folder is root's on purpose."""
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


def test_a_real_process_that_only_tells_its_version_touches_no_owner(tmp_path: Path) -> None:
    """What a cache holds may be anybody's. The inodes' change times tell of any chown at all."""
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
