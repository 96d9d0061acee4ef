# SPDX-License-Identifier: Apache-2.0
"""Removes whatever has a name: a file, a folder, a link itself, a pipe."""

import shutil
from contextlib import suppress
from pathlib import Path


def remove_entry(path: Path) -> None:
    """Removes it; a link is removed and not followed, and what is missing is well."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    with suppress(FileNotFoundError):
        path.unlink()
