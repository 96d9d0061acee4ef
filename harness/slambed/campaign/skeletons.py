# SPDX-License-Identifier: Apache-2.0
"""`slambed new`: creates files from a template (catalog/templates/)."""

import re
import shlex
from pathlib import Path

from slambed.campaign.plan import must_be_free
from slambed.data.catalog import Catalog
from slambed.errors import SlambedError
from slambed.files.remove import remove_entry
from slambed.native import repository_root
from slambed.spec.library import Library

KINDS = ("system", "dataset", "experiment")
NAME = re.compile(r"[a-z][a-z0-9_]*")
PLACEHOLDER, SCHEMAS = "NAME", "SCHEMAS"
FOLDER_SYSTEM = "folder_system"
"""Templates that replace those of a system if it reads a recorded folder."""


def write_skeleton(kind: str, name: str, folder: Path, reads_folder: bool = False) -> list[str]:
    """Returns the written files and the next steps, line by line. Never overwrites a file.

    `reads_folder`: the system is a program that reads a recorded folder, without our client.
    """
    if kind not in KINDS:
        raise SlambedError(f"unknown kind '{kind}'; known: {', '.join(KINDS)}")
    if reads_folder and kind != "system":
        raise SlambedError(f"--reads-folder is for a system; a {kind} has no such choice")
    if not NAME.fullmatch(name):
        raise SlambedError(f"'{name}' is no name: small letters, digits and _, a letter first")
    _must_be_free(kind, name)
    source = repository_root() / "catalog" / "templates"
    if kind != "system":
        target = folder / f"{name}.yaml"
        _write(target, {target: source / f"{kind}.yaml"}, name)
        given = shlex.quote(f"{target}")
        if kind == "experiment":
            return [f"{target}", f"next: slambed run {given} --check"]
        return [
            f"{target}",
            f"next: slambed data prepare {given}",
            f"      slambed data show {given}",
            f"then, in an experiment beside it: datasets: [./{target.name}]",
        ]
    place = folder / name
    # pip compiles a template's Python file, which leaves a folder beside it.
    files = {path.name: path for path in (source / kind).iterdir() if path.is_file()}
    if reads_folder:
        files |= {path.name: path for path in (source / FOLDER_SYSTEM).iterdir() if path.is_file()}
    written = {place / file.replace(PLACEHOLDER, name): files[file] for file in sorted(files)}
    _write(place, written, name)
    return [
        *map(str, written),
        f"next: slambed check-system {shlex.quote(str(place / 'system.yaml'))}",
        f"      slambed run {shlex.quote(str(place / f'{name}_beside_ours.yaml'))} --engine local",
    ]


def _must_be_free(kind: str, name: str) -> None:
    """Raises SlambedError for the name of one of ours: the new file would be refused."""
    if kind == "experiment":
        must_be_free(name)
    taken = False
    if kind == "system":
        taken = name in Library().systems()
    elif kind == "dataset":
        taken = name in Catalog.load().files
    if taken:
        raise SlambedError(f"there is a {kind} {name} already; choose another name")


def _write(place: Path, templates: dict[Path, Path], name: str) -> None:
    """Writes each file from its template, all of them or none. `place`: the only file or the folder
    of all; must not exist."""
    if place.exists():
        raise SlambedError(f"{place} is there already; choose another name or --folder")
    schemas = str(repository_root() / "catalog" / "schemas")
    target = place
    try:
        for target, source in templates.items():
            text = source.read_text().replace(SCHEMAS, schemas).replace(PLACEHOLDER, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text)
    except OSError as error:
        if place.exists():
            remove_entry(place)
        raise SlambedError(f"{target}: {error.strerror}; choose another --folder") from None
