# SPDX-License-Identifier: Apache-2.0
"""Downloads a dataset by its recipe: verified, unpacked to a temporary folder, then moved.

It uses the standard library (data/fetch.py) instead of pooch (1.9), which cannot resume, knows no
mirrors, and does not support `file:` URLs.
"""

from __future__ import annotations

import shutil
import tarfile
import tempfile
import zipfile
from pathlib import Path

from slambed.data.fetch import Wanted, fetch, forget
from slambed.data.preparation import Progress
from slambed.data.recipe import Dataset, Download
from slambed.errors import SlambedError, environment_error


def recipe_text(dataset: Dataset, folder: Path) -> str:
    """Returns the recipe as instructions for the user."""
    recipe = _recipe(dataset)
    size = f"{recipe.size_bytes} bytes" if recipe.size_bytes else "size not known"
    action = "see the page" if recipe.unpack == "none" else f"unpack into {folder / recipe.into}"
    terms = f"; terms: {dataset.license}" if dataset.license else ""
    mirrors = "".join(f" or {mirror}" for mirror in recipe.mirrors)
    return f"{dataset.id}: {recipe.url}{mirrors} ({size}, sha256 {recipe.sha256}); {action}{terms}"


def how_to_get(dataset: Dataset) -> str:
    """Returns in one clause how to get a missing dataset; empty if nothing offers it."""
    if dataset.synthetic is not None:
        return f"generate it with 'slambed data prepare {dataset.id}'"
    if dataset.download is None:
        return ""
    if dataset.download.unpack == "none":
        return f"get it from {dataset.download.url}"
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
            f"{dataset.id}: the checksum of {recipe.url} is {recipe.sha256}; "
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
        finally:
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
    """Rejects archive members with paths outside the target."""
    try:
        if recipe.unpack == "tar":
            with tarfile.open(archive) as tar:
                tar.extractall(target, filter="data")
        else:
            with zipfile.ZipFile(archive) as packed:
                for name in packed.namelist():
                    if not (target / name).resolve().is_relative_to(target.resolve()):
                        raise SlambedError(
                            f"{recipe.url}: '{name}' leaves the folder; not unpacked"
                        )
                packed.extractall(target)
    except (tarfile.TarError, zipfile.BadZipFile, EOFError) as broken:
        raise SlambedError(f"{recipe.url}: cannot be unpacked ({broken})") from broken


def _merge(source: Path, target: Path) -> None:
    target.mkdir(parents=True, exist_ok=True)
    for entry in source.iterdir():
        if (target / entry.name).exists():
            raise SlambedError(f"{target / entry.name} exists already; move it away first")
    for entry in source.iterdir():
        shutil.move(entry, target / entry.name)
