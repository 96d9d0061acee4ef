# SPDX-License-Identifier: Apache-2.0
"""Download recipes: only verified ones run without --force, and no unverified file is kept."""

from __future__ import annotations

import hashlib
import tarfile
import zipfile
from pathlib import Path

import pytest
from data_samples import one_line

from slambed.data.download import download, recipe_text
from slambed.data.recipe import Dataset
from slambed.errors import ExitCode, SlambedError


def dataset(**recipe: object) -> Dataset:
    return Dataset.model_validate(
        {
            "id": "d",
            "title": "D",
            "reader": "tum",
            "paths": ["d"],
            "depth_unit_m": 0.001,
            "license": "free",
            "download": recipe,
        }
    )


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    (tmp_path / "d").mkdir()
    (tmp_path / "d/rgb.txt").write_text("1 a.png\n")
    with tarfile.open(tmp_path / "d.tgz", "w:gz") as tar:
        tar.add(tmp_path / "d", "d")
    return tmp_path / "d.tgz"


def digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def test_a_verified_recipe_is_carried_out(tmp_path: Path, archive: Path) -> None:
    chosen = dataset(
        url=archive.as_uri(),
        sha256=digest(archive),
        size_bytes=archive.stat().st_size,
        unpack="tar",
        into="sub",
    )
    assert download(chosen, tmp_path / "data") == digest(archive)
    assert (tmp_path / "data/sub/d/rgb.txt").read_text() == "1 a.png\n"
    with pytest.raises(SlambedError, match="exists already"):
        download(chosen, tmp_path / "data")
    assert [p.name for p in (tmp_path / "data").iterdir()] == ["sub"]


def test_a_mirror_is_asked_where_the_first_address_is_dead(tmp_path: Path, archive: Path) -> None:
    dead = (tmp_path / "none.tgz").as_uri()
    chosen = dataset(url=dead, mirrors=[archive.as_uri()], sha256=digest(archive), unpack="tar")
    assert f"{dead} or {archive.as_uri()} (" in recipe_text(chosen, tmp_path)
    assert download(chosen, tmp_path / "data") == digest(archive)
    assert [p.name for p in (tmp_path / "data").iterdir()] == ["d"]


def test_an_unverified_recipe_needs_force(tmp_path: Path, archive: Path) -> None:
    chosen = dataset(url=archive.as_uri(), unpack="tar")
    with pytest.raises(SlambedError) as error:
        download(chosen, tmp_path / "data")
    assert "unverified here" in one_line(error) and "--force" in one_line(error)
    assert download(chosen, tmp_path / "data", force=True) == digest(archive)


def test_a_wrong_checksum_keeps_nothing(tmp_path: Path, archive: Path) -> None:
    chosen = dataset(url=archive.as_uri(), sha256="0" * 64, unpack="tar")
    with pytest.raises(SlambedError, match="nothing was kept"):
        download(chosen, tmp_path / "data", force=True)
    assert list((tmp_path / "data").iterdir()) == []


def test_a_hostile_archive_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as packed:
        packed.writestr("../../evil.txt", "x")
    chosen = dataset(url=(tmp_path / "evil.zip").as_uri(), unpack="zip")
    with pytest.raises(SlambedError, match="leaves the folder"):
        download(chosen, tmp_path / "data", force=True)
    assert not (tmp_path / "evil.txt").exists()


def test_pages_and_dead_links(tmp_path: Path) -> None:
    page = dataset(url="https://example.org/register", unpack="none")
    assert "see the page" in recipe_text(page, tmp_path) and "free" in recipe_text(page, tmp_path)
    with pytest.raises(SlambedError, match="cannot be fetched directly"):
        download(page, tmp_path, force=True)
    dead = dataset(url=(tmp_path / "none.tgz").as_uri(), unpack="tar")
    with pytest.raises(SlambedError) as error:
        download(dead, tmp_path / "data", force=True)
    assert error.value.code == ExitCode.ENVIRONMENT and "none.tgz" in one_line(error)
