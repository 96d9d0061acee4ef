# SPDX-License-Identifier: Apache-2.0
"""Leftovers of killed campaigns on boards: containers and the volumes of their runs.

A campaign records each board that it takes in the cache, and removes the record after it has
cleaned up. The remaining records show which boards to clean.
"""

import contextlib
import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path

import docker
from docker.errors import NotFound
from pydantic import ValidationError

from slambed.data.places import cache_folder
from slambed.engines.base import LABEL
from slambed.engines.board.connection import BoardConnection
from slambed.engines.docker_errors import daemon_failures
from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.spec.board import RoleHost

FOLDER = "boards"


def remove_left(client: docker.DockerClient, name: str) -> str:
    """Removes leftovers from one board; returns a description, empty if there were none. The
    caller must hold the board's lock."""
    with daemon_failures(f"remove what runs left on board {name}"):
        containers = client.containers.list(all=True, filters={"label": LABEL})
        for container in containers:
            with contextlib.suppress(NotFound):
                container.remove(force=True, v=True)
        volumes = client.volumes.list(filters={"label": LABEL})
        for volume in volumes:
            with contextlib.suppress(NotFound):
                volume.remove()
    found = ((len(containers), "containers"), (len(volumes), "volumes"))
    return ", ".join(f"{count} {what}" for count, what in found if count)


def note(role: RoleHost) -> None:
    """Records that a campaign uses this board."""
    path = _place(role)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as out:
        out.write_text(role.model_dump_json(), encoding="utf-8")


def strike_out(role: RoleHost) -> None:
    """Removes the record: nothing is left on the board."""
    _place(role).unlink(missing_ok=True)


def noted() -> Iterator[RoleHost]:
    """Yields the boards of campaigns that did not end normally."""
    for path in sorted((cache_folder() / FOLDER).glob("*.json")):
        try:
            yield RoleHost.model_validate_json(path.read_bytes())
        except (OSError, ValidationError):
            path.unlink(missing_ok=True)  # truncated, or of another version


def clean_boards(notify: Callable[[str], None], but: RoleHost | None = None) -> None:
    """Cleans every recorded board except `but`, which was just cleaned. An unreachable board is
    reported and tried again next time."""
    for role in noted():
        if role == but:
            continue
        try:
            connection = BoardConnection(role)
            try:
                found = remove_left(connection.docker, role.called)
            finally:
                connection.close()
            strike_out(role)
            notify(f"board {role.called}: removed {found or 'nothing'}")
        except SlambedError as error:
            notify(f"not cleaned: {error}")


def _place(role: RoleHost) -> Path:
    name = hashlib.sha256(role.model_dump_json().encode()).hexdigest()[:16]
    return cache_folder() / FOLDER / f"{name}.json"
