# SPDX-License-Identifier: Apache-2.0
"""Files and folders that a user named: an unwritable one is reported in one line."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slambed.errors import SlambedError

FIGURES = (".png", ".svg", ".pdf")
SHEETS = (".png",)


def resolved(path: Path) -> Path:
    """Without links and `..`; of a link to itself, which Path.resolve() takes for an error, itself:
    whoever opens it says what is wrong."""
    return Path(os.path.realpath(path))


def at_home(name: str) -> Path:
    """With the home folder for `~`; of a user who does not exist, as it is written."""
    return Path(os.path.expanduser(name))  # noqa: PTH111


def is_file(path: Path) -> bool:
    """Whether it is one; a name that no file can have is none, which Path.is_file() takes for an
    error."""
    return os.path.isfile(path)  # noqa: PTH113


@contextmanager
def writing(path: Path, option: str = "--output") -> Iterator[None]:
    """Turns an OSError while writing to the path given by `option` into a SlambedError."""
    try:
        yield
    except OSError as refused:
        why = refused.strerror or str(refused)
        raise SlambedError(f"{path}: {why}; choose another {option}") from refused


def must_be_writable(path: Path, option: str) -> None:
    """Raises SlambedError before long work whose result could not be written to this file."""
    with writing(path, option):
        new = not path.exists()
        path.open("ab").close()
        if new:
            path.unlink()


def make_folder(path: Path, option: str) -> None:
    """Creates the folder given by `option`, with its parents."""
    with writing(path, option):
        path.mkdir(parents=True, exist_ok=True)
        if not os.access(path, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def figure_file(path: Path, formats: tuple[str, ...] = FIGURES) -> Path:
    """Returns the file name of a figure; PNG is the default format."""
    if path.is_dir():
        raise SlambedError(f"{path}: a folder, expected a file; name the picture, as {path}/a.png")
    if path.suffix in ("", "."):
        return path.with_name(f"{path.name.rstrip('.')}.png")
    if path.suffix.lower() not in formats:
        raise SlambedError(f"unknown picture format {path}; known: {', '.join(formats)}")
    return path
