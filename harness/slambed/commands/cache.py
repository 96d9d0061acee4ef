# SPDX-License-Identifier: Apache-2.0
"""`slambed cache size|prune`: shows and frees the cache outside of results."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from stat import S_ISDIR
from typing import Annotated

import typer

from slambed.data.places import MADE_AGAIN, ONLY_IF_NAMED, cache_folder, no_cache
from slambed.errors import SlambedError
from slambed.terminal import JsonOption, print_json

app = typer.Typer(
    help="What is kept of sequences and what is computed of them.", no_args_is_help=True
)
KINDS = ", ".join(
    f"{kind} (only if named)" if kind in ONLY_IF_NAMED else kind for kind in MADE_AGAIN
)
GIGABYTE = 1e9
DAY_S = 86400.0
BLOCK_BYTES = 512
"""Unit of st_blocks, independent of the disk's block size (POSIX)."""


@dataclass(frozen=True)
class Item:
    """One sequence, mask cache, exported folder, ..., with all its files."""

    kind: str
    path: Path
    bytes: int
    """On disk."""
    used_s: float
    """Last access or write, in seconds since the epoch. Linux updates access times once a day
    (`relatime`), or never on a disk mounted with `noatime`."""

    def unused_days(self) -> float:
        return (time.time() - self.used_s) / DAY_S


def items(cache: Path) -> Iterator[Item]:
    """Yields everything in `cache` that slambed can recreate, by kind and name."""
    for kind in MADE_AGAIN:
        try:
            entries = sorted((cache / kind).iterdir())
        except FileNotFoundError:
            continue
        except OSError as refused:
            raise no_cache(cache / kind, refused) from refused
        for entry in entries:
            # Deleting a lock file would break the lock for processes that wait on it.
            if entry.suffix != ".lock" and entry.name != ".lock":
                yield from _item(kind, entry)


def _item(kind: str, path: Path) -> Iterator[Item]:
    """Yields nothing when a concurrent campaign has just removed it."""
    inside = [] if path.is_symlink() or not path.is_dir() else path.rglob("*")
    try:
        statuses = [(file, file.lstat()) for file in [path, *inside]]
    except FileNotFoundError:
        return
    except OSError as refused:
        raise no_cache(path, refused) from refused
    # Listing a folder changes its access time, which is not a use of its files.
    times = [s.st_mtime if S_ISDIR(s.st_mode) else max(s.st_atime, s.st_mtime) for _, s in statuses]
    yield Item(kind, path, BLOCK_BYTES * sum(s.st_blocks for _, s in statuses), max(times))


def remove(item: Item) -> None:
    """Removes an item atomically for other processes: a sequence without its frames would be
    damaged."""
    try:
        if item.path.is_symlink() or not item.path.is_dir():
            item.path.unlink(missing_ok=True)
            return
        gone = item.path.with_name(f".{item.path.name.lstrip('.')}.partial-{os.getpid()}")
        item.path.rename(gone)
        shutil.rmtree(gone)
    except FileNotFoundError:
        return  # another process removed it
    except OSError as refused:
        raise no_cache(item.path, refused) from refused


@app.command()
def size(as_json: JsonOption = False) -> None:
    """Show how much space each kind takes, and how long it has been unused."""
    cache = cache_folder()
    found = list(items(cache))
    if as_json:
        kinds = {kind: [item for item in found if item.kind == kind] for kind in MADE_AGAIN}
        by_kind = {
            kind: {
                "items": len(of_kind),
                "bytes": sum(item.bytes for item in of_kind),
                "unused_days_max": max((item.unused_days() for item in of_kind), default=None),
            }
            for kind, of_kind in kinds.items()
        }
        print_json({"cache": str(cache), "kinds": by_kind})
        return
    for kind, what in MADE_AGAIN.items():
        if of_kind := [item for item in found if item.kind == kind]:
            days = max(item.unused_days() for item in of_kind)
            typer.echo(
                f"{kind} ({what}): {_size_and_age(of_kind)}, unused for up to {days:.0f} days"
            )
    typer.echo(f"{cache}: {_size_and_age(found)}; free what is not used: slambed cache prune")


@app.command()
def prune(
    unused_days: Annotated[
        float, typer.Option(min=0.0, help="Only what nobody has used for so long.")
    ] = 30.0,
    kind: Annotated[list[str] | None, typer.Option(help=f"Only this kind: {KINDS}.")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Really remove it.")] = False,
) -> None:
    """Remove cached items that slambed recreates when an experiment needs them; downloads stay."""
    if unknown := sorted(set(kind or ()) - set(MADE_AGAIN)):
        raise SlambedError(f"no kind {unknown[0]!r}; --kind is one of {', '.join(MADE_AGAIN)}")
    kinds = set(kind or MADE_AGAIN.keys() - ONLY_IF_NAMED)
    old = [
        item
        for item in items(cache_folder())
        if item.kind in kinds and item.unused_days() >= unused_days
    ]
    for item in old:
        if yes:
            remove(item)
        message = f"{item.bytes / GIGABYTE:.2f} GB, unused for {item.unused_days():.0f} days"
        typer.echo(f"{item.kind}/{item.path.name}: {message}")
    typer.echo(
        f"removed {_size_and_age(old)}"
        if yes
        else f"would remove {_size_and_age(old)}; give --yes to do it"
    )


def _size_and_age(several: list[Item]) -> str:
    return f"{len(several)} items, {sum(item.bytes for item in several) / GIGABYTE:.2f} GB"
