# SPDX-License-Identifier: Apache-2.0
"""Downloads a dataset by its recipe: verified, unpacked to a temporary folder, then moved.

It uses the standard library (data/fetch.py) instead of pooch (1.9), which cannot resume, knows no
mirrors, and does not support `file:` URLs.
"""

from __future__ import annotations

import errno
import lzma
import shutil
import struct
import tarfile
import tempfile
import zipfile
import zlib
from pathlib import Path

from slambed.data.fetch import Wanted, fetch, forget, shown
from slambed.data.preparation import Progress
from slambed.data.recipe import Dataset, Download
from slambed.errors import SlambedError, environment_error

_ENCRYPTED = 0x1
"""Flag of an entry in a zip."""
_IS_KIND = {"tar": tarfile.is_tarfile, "zip": zipfile.is_zipfile}
_BROKEN = (
    tarfile.TarError,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    RuntimeError,
    ValueError,
    OverflowError,
    LookupError,
)
"""What the standard library raises for archives that are damaged or that it does not support."""

_OF_THE_ARCHIVE = (None, errno.EINVAL, errno.ENAMETOOLONG)
"""Numbers of an OSError that is not the disk's: gzip and bz2 give none, damaged zips seek before
their begin."""


def recipe_text(dataset: Dataset, folder: Path) -> str:
    """Returns the recipe as instructions for the user."""
    recipe = _recipe(dataset)
    size = f"{recipe.size_bytes} bytes" if recipe.size_bytes else "size not known"
    action = "see the page" if recipe.unpack == "none" else f"unpack into {folder / recipe.into}"
    terms = f"; terms: {dataset.license}" if dataset.license else ""
    addresses = " or ".join(map(shown, (recipe.url, *recipe.mirrors)))
    return f"{dataset.id}: {addresses} ({size}, sha256 {recipe.sha256}); {action}{terms}"


def how_to_get(dataset: Dataset) -> str:
    """Returns in one clause how to get a missing dataset; empty if nothing offers it."""
    if dataset.synthetic is not None:
        return f"generate it with 'slambed data prepare {dataset.id}'"
    if dataset.download is None:
        return ""
    if dataset.download.unpack == "none":
        return f"get it from {shown(dataset.download.url)}"
    command = f"slambed data download {dataset.id}"
    if dataset.download.verified:
        return f"get it with '{command}'"
    return f"get it with '{command} --force' (no checksum is known)"


def download(
    dataset: Dataset, folder: Path, force: bool = False, progress: Progress | None = None
) -> str:
    """Executes a recipe and returns the SHA-256 of the downloaded file.

    Without a verified checksum this requires `force`; a wrong checksum raises SlambedError and
    keeps nothing. A partial download is kept, and the next call resumes it (data/fetch.py).
    """
    recipe = _recipe(dataset)
    if recipe.unpack == "none":
        raise SlambedError(
            f"{dataset.id} cannot be fetched directly; {recipe_text(dataset, folder)}"
        )
    if not recipe.verified and not force:
        raise SlambedError(
            f"{dataset.id}: the checksum of {shown(recipe.url)} is {recipe.sha256}; "
            "fetch it by hand or repeat with --force"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        wanted = Wanted(
            (recipe.url, *recipe.mirrors),
            recipe.sha256 if recipe.verified else None,
            recipe.size_bytes,
        )
        archive, digest = fetch(wanted, folder, progress)
        try:
            with tempfile.TemporaryDirectory(prefix=".download-", dir=folder) as scratch:
                unpacked = Path(scratch) / "unpacked"
                unpacked.mkdir()
                _unpack(recipe, archive, unpacked)
                _merge(unpacked, folder / recipe.into)
        except SlambedError:
            forget(archive)
            raise
        # After a full disk or Ctrl-C the next call takes this archive, if its checksum is known.
        forget(archive)
    except OSError as refused:
        raise environment_error(f"{folder}: {refused.strerror or refused}") from refused
    return digest


def _recipe(dataset: Dataset) -> Download:
    if dataset.synthetic is not None:
        raise SlambedError(f"dataset '{dataset.id}' is not downloaded; {how_to_get(dataset)}")
    if dataset.download is None:
        raise SlambedError(
            f"dataset '{dataset.id}' has no download recipe; {dataset.note}".rstrip("; ")
        )
    return dataset.download


def _unpack(recipe: Download, archive: Path, target: Path) -> None:
    """Rejects archive members with paths outside the target, and archives without files."""
    url = shown(recipe.url)
    try:
        _check_kind(recipe, archive)
        if recipe.unpack == "tar":
            with tarfile.open(archive) as tar:
                tar.extractall(target, filter="data")
        else:
            _unpack_zip(url, archive, target)
    except _BROKEN as broken:
        raise _not_unpacked(url, broken) from broken
    except OSError as broken:
        if broken.errno not in _OF_THE_ARCHIVE:
            raise
        raise _not_unpacked(url, broken) from broken
    if all(path.is_dir() for path in target.rglob("*")):
        raise SlambedError(f"{url}: has no files; correct the url")


def _not_unpacked(url: str, broken: Exception) -> SlambedError:
    why = getattr(broken, "strerror", None) or str(broken) or type(broken).__name__
    return SlambedError(f"{url}: cannot be unpacked ({why})")


def _check_kind(recipe: Download, archive: Path) -> None:
    """Raises SlambedError for a web page, or for the other kind of archive."""
    if _IS_KIND[recipe.unpack](archive):
        return
    found = [kind for kind, is_kind in _IS_KIND.items() if is_kind(archive)]
    what_to_do = f"it is a {found[0]}: say unpack: {found[0]}" if found else "correct the url"
    raise SlambedError(f"{shown(recipe.url)}: is no {recipe.unpack} archive; {what_to_do}")


def _unpack_zip(url: str, archive: Path, target: Path) -> None:
    with zipfile.ZipFile(archive) as packed:
        for entry in packed.infolist():
            if not (target / entry.filename).resolve().is_relative_to(target.resolve()):
                raise SlambedError(f"{url}: '{entry.filename}' leaves the folder; not unpacked")
            if entry.flag_bits & _ENCRYPTED:
                raise SlambedError(f"{url}: is encrypted; fetch and unpack it by hand")
        packed.extractall(target)


def _merge(source: Path, target: Path) -> None:
    target.mkdir(parents=True, exist_ok=True)
    for entry in source.iterdir():
        if (target / entry.name).exists():
            raise SlambedError(f"{target / entry.name} exists already; move it away first")
    for entry in source.iterdir():
        shutil.move(entry, target / entry.name)
