# SPDX-License-Identifier: Apache-2.0
"""Under sudo, gives files that slambed creates to the user who called sudo."""

import os
import stat
import sys
from contextlib import suppress
from pathlib import Path

from slambed.isolation import OURS
from slambed.native import is_installed

ROOT = 0
_written: set[Path] = set()


def give_to_caller(path: Path) -> None:
    """Gives a folder and everything in it to the caller. Another campaign may remove items of a
    shared store meanwhile."""
    if (caller := _caller()) is None:
        return
    items = [path]
    for folder, folders, files in os.walk(path):
        items += [Path(folder, name) for name in folders + files]
    for item in items:
        with suppress(FileNotFoundError):
            os.lchown(item, *caller)


def will_be_callers(folder: Path) -> None:
    """Registers a folder that the command writes to; root's files in it go to the caller at the
    end."""
    _written.add(folder.resolve())


def give_written_to_caller() -> None:
    """Gives the caller what root left in the caller's folders: results, caches, bytecode of our
    modules. Otherwise these files could not be changed later without sudo."""
    if _caller() is None:
        return
    bytecode = [] if is_installed() else OURS.rglob("__pycache__")
    for folder in (*_written, *bytecode):
        with suppress(OSError):
            _give(folder, _whole(folder))
    _give_caches()


def _give_caches() -> None:
    from slambed.data.places import cache_folder  # imported late: `--help` does not need it

    folders = [cache_folder()]
    if (matplotlib := sys.modules.get("matplotlib")) is not None:
        folders += [Path(matplotlib.get_cachedir()), Path(matplotlib.get_configdir())]
    for folder in folders:
        with suppress(OSError):
            give_cache_to_caller(folder.resolve())


def give_cache_to_caller(cache: Path) -> None:
    """Gives the caller root's files of ours in `cache`, and its parent folders up to one that the
    caller owns.

    A cache that the caller could not have created is left alone. Raises OSError when it does not
    exist.
    """
    from slambed.data.places import OURS as KINDS

    _give(cache, [item for name in KINDS for item in _whole(cache / name)])


def _give(folder: Path, items: list[Path]) -> None:
    if (caller := _caller()) is None:
        return
    above: list[Path] = []
    for place in (folder, *folder.parents):
        status = place.stat()
        for_all = place in (folder, folder.parent) and status.st_mode & stat.S_IWOTH
        if status.st_uid == caller[0] or for_all:
            break
        if status.st_uid != ROOT:
            return
        above.append(place)
    else:
        return
    for item in [*above, *items]:
        with suppress(OSError):  # another campaign may have removed it
            if item.lstat().st_uid == ROOT:
                os.lchown(item, *caller)


def _whole(path: Path) -> list[Path]:
    return [path, *path.rglob("*")] if path.exists() else []


def _caller() -> tuple[int, int] | None:
    """Returns the user and group ID of sudo's caller, or None without sudo."""
    uid, gid = os.environ.get("SUDO_UID"), os.environ.get("SUDO_GID")
    if os.geteuid() != ROOT or uid is None or gid is None:
        return None
    return int(uid), int(gid)
