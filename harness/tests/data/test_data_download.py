# SPDX-License-Identifier: Apache-2.0
"""Download recipes: only verified ones run without --force, and no unverified file is kept."""

from __future__ import annotations

import gzip
import hashlib
import io
import os
import random
import tarfile
import zipfile
from pathlib import Path
from typing import Literal

import pytest
from command_line import slambed
from data_samples import one_line

from slambed.data.catalog import Catalog
from slambed.data.download import download, how_to_get, recipe_text
from slambed.data.recipe import Dataset
from slambed.errors import ExitCode, MissingDataError, SlambedError


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


def test_after_a_full_disk_the_archive_is_not_fetched_again(
    tmp_path: Path, archive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = dataset(url=archive.as_uri(), sha256=digest(archive), unpack="tar")
    folder = tmp_path / "data"
    with monkeypatch.context() as full:
        full.setattr("shutil.move", lambda *_: os.truncate("/dev/full/x", 0))
        with pytest.raises(SlambedError, match=str(folder)):
            download(chosen, folder)
    with monkeypatch.context() as offline:
        offline.setattr("slambed.data.fetch._transfer", None)
        assert download(chosen, folder) == digest(archive)
    assert (folder / "d/rgb.txt").is_file()
    assert [path.name for path in folder.iterdir()] == ["d"]


def test_what_is_here_is_not_fetched_again(tmp_path: Path, archive: Path) -> None:
    folder = tmp_path / "datasets"
    folder.mkdir()
    (folder / "own.yaml").write_text(
        "id: own\ntitle: Own\nreader: tum\nsensor: mono\npaths: [d]\n"
        f"download: {{url: {archive.as_uri()}, sha256: {digest(archive)}, unpack: tar}}\n"
    )
    places = {"SLAMBED_DATASETS": str(folder), "SLAMBED_CACHE": str(tmp_path / "cache")}
    assert slambed("data", "download", "own", **places)[0] == ExitCode.OK
    archive.unlink()
    code, out, err = slambed("data", "download", "own", **places)
    assert code == ExitCode.OK, err
    assert f"own: is here already, {tmp_path / 'cache/data/d'}; move it away" in out


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
    assert error.value.code == ExitCode.BAD_INPUT
    assert one_line(error) == (
        f"{(tmp_path / 'none.tgz').as_uri()}: No such file or directory; name a file that can be "
        "read"
    )


def a_zip(compression: int = zipfile.ZIP_DEFLATED, name: str = "d/a.txt") -> bytearray:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", compression) as file:
        if name:
            file.writestr(name, "abc" * 1000)
    return bytearray(packed.getvalue())


def a_tar(kind: Literal["", "gz", "bz2", "xz"], *names: str) -> bytearray:
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode=f"w:{kind}") as file:
        for name in names:
            entry = tarfile.TarInfo(name)
            entry.type = tarfile.DIRTYPE if name.endswith("/") else tarfile.REGTYPE
            entry.size = 0 if entry.isdir() else 100_000
            file.addfile(entry, io.BytesIO(random.Random(1).randbytes(50_000).hex().encode()))
    return bytearray(packed.getvalue())


def changed(content: bytearray, *places: int, to: int) -> bytearray:
    for place in places:
        content[place] = to
    return content


def of_directory(content: bytearray, offset: int) -> int:
    """Returns the place of a field in the first entry of a zip's directory."""
    return content.index(b"PK\x01\x02") + offset


FLAGS, METHOD = 8, 10
PLAIN = a_zip()


@pytest.mark.parametrize(
    ("unpack", "content", "said"),
    [
        ("zip", changed(a_zip(), 6, of_directory(PLAIN, FLAGS), to=1), "is encrypted; "),
        (
            "zip",
            changed(a_zip(), 8, of_directory(PLAIN, METHOD), to=99),
            "cannot be unpacked (That compression method is not supported)",
        ),
        ("zip", changed(a_zip(), *range(40, 50), to=255), "cannot be unpacked (Error -3 while"),
        (
            "zip",
            changed(a_zip(zipfile.ZIP_LZMA), *range(50, 60), to=255),
            "cannot be unpacked (Corrupt input data)",
        ),
        ("zip", a_zip()[9:], "cannot be unpacked ("),
        ("zip", a_zip(name="n" * 300), "cannot be unpacked (File name too long)"),
        (
            "zip",
            changed(a_zip(zipfile.ZIP_BZIP2), *range(50, 60), to=255),
            "cannot be unpacked (Invalid data stream)",
        ),
        (
            "tar",
            gzip.compress(a_tar("", "a")[:50_000]) + gzip.compress(b"")[:10] + b"\x07",
            "cannot be unpacked (Error -3 while decompressing",
        ),
        (
            "tar",
            changed(a_tar("xz", "a"), *range(40_000, 40_100), to=255),
            "cannot be unpacked (Corrupt input data)",
        ),
        ("tar", a_tar("gz", "a")[:40_000], "cannot be unpacked (Compressed file ended"),
        ("tar", a_zip(), "is no tar archive; it is a zip: say unpack: zip"),
        ("zip", a_tar("gz", "a"), "is no zip archive; it is a tar: say unpack: tar"),
        ("tar", b"<html>sign in</html>", "is no tar archive; correct the url"),
        ("zip", b"<html>sign in</html>", "is no zip archive; correct the url"),
        ("tar", b"", "is no tar archive; correct the url"),
        ("zip", a_zip(name=""), "has no files; correct the url"),
        ("zip", a_zip(name="d/"), "has no files; correct the url"),
        ("tar", a_tar(""), "has no files; correct the url"),
        ("tar", a_tar("gz", "d/", "d/e/"), "has no files; correct the url"),
    ],
)
def test_what_cannot_be_unpacked_is_told_in_a_line(
    tmp_path: Path, unpack: str, content: bytes, said: str
) -> None:
    (tmp_path / "x").write_bytes(content)
    chosen = dataset(url=(tmp_path / "x").as_uri(), unpack=unpack, sha256=digest(tmp_path / "x"))
    with pytest.raises(SlambedError) as error:
        download(chosen, tmp_path / "data")
    assert error.value.code == ExitCode.BAD_INPUT
    assert one_line(error).startswith(f"{(tmp_path / 'x').as_uri()}: {said}")
    assert not list((tmp_path / "data").iterdir())


def test_a_password_is_not_shown(tmp_path: Path) -> None:
    kept = dataset(url="ftp://me:pw@127.0.0.1:9/x.zip", mirrors=["http://a:pw@b/x"], unpack="zip")
    shown = "ftp://me:***@127.0.0.1:9/x.zip"
    assert f"{shown} or http://a:***@b/x (" in recipe_text(kept, tmp_path)
    with pytest.raises(SlambedError) as error:
        download(kept, tmp_path)
    assert f"the checksum of {shown} is" in one_line(error)
    with pytest.raises(MissingDataError) as missing:
        Catalog({kept.id: kept}, (tmp_path / "data",), tmp_path).must_be_here(kept.id, tmp_path)
    assert f"get it from {shown} (" in one_line(missing)
    page = dataset(url="http://me:pw@host/page")
    assert how_to_get(page) == "get it from http://me:***@host/page"
