# SPDX-License-Identifier: Apache-2.0
"""What a killed campaign left on boards: containers and the volumes of their runs.

A campaign that takes a board notes it in the cache and strikes the note out when it has left
nothing there; so who cleans this machine knows which boards to ask.
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
    """Removes them from one board; what it was, in words, empty for nothing. Safe only for who has
    the board's lock."""
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
    """That a campaign has this board now."""
    path = _place(role)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as out:
        out.write_text(role.model_dump_json(), encoding="utf-8")


def strike_out(role: RoleHost) -> None:
    """Nothing is left there."""
    _place(role).unlink(missing_ok=True)


def noted() -> Iterator[RoleHost]:
    """Boards of campaigns that did not end by themselves."""
    for path in sorted((cache_folder() / FOLDER).glob("*.json")):
        try:
            yield RoleHost.model_validate_json(path.read_bytes())
        except (OSError, ValidationError):
            path.unlink(missing_ok=True)  # torn, or of another version


def clean_boards(notify: Callable[[str], None], but: RoleHost | None = None) -> None:
    """Asks every noted board, `but` one that has just been looked at. One that does not answer is
    reported, and asked again the next time."""
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
