# SPDX-License-Identifier: Apache-2.0
"""What a board needs before a run: the node image for its architecture, and the sequence."""

import hashlib
import io
import os
import subprocess
import tarfile
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import docker
from docker.errors import ImageNotFound, NotFound

from slambed.engines.base import LABEL
from slambed.engines.board.connection import BoardConnection
from slambed.engines.docker_errors import daemon_failures
from slambed.engines.docker_image import image_tag
from slambed.errors import SlambedError, environment_error
from slambed.files.json_file import read_object
from slambed.native import repository_root

ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64"}
"""Architecture name of the kernel -> of images."""
SEQUENCE_LABEL = f"{LABEL}.sequence"
"""Label of a volume that outlives runs: checksum of its sequence."""
PLACE = "/board"
"""Mount point of that volume in a container."""
SEQUENCE = f"{PLACE}/sequence"
VERIFIED = f"{PLACE}/verified"
"""Written last: a volume without it is copied again."""
CHUNK_BYTES = 1 << 20
Notify = Callable[[str], None]


def must_be_known(connection: BoardConnection) -> str:
    """Returns the board's architecture as images name it."""
    found = connection.seen.architecture
    if found not in ARCHITECTURES:
        raise environment_error(
            f"board {connection.name} is {found}, for which there is no node image; a 64-bit "
            f"system is needed there: {', '.join(ARCHITECTURES)}"
        )
    return ARCHITECTURES[found]


def bring_image(
    connection: BoardConnection, here: docker.DockerClient | None, notify: Notify
) -> Any:
    """Returns the node image of these sources on the board: an existing one, or else a copy of
    this machine's image for its architecture, or else one built on the board.

    An image for another architecture than this machine's has a name of its own, such as
    slambed-node:HASH-arm64 (tools/arm64.sh).
    """
    wanted, tag = must_be_known(connection), image_tag()
    with daemon_failures(f"look for {tag} on board {connection.name}"):
        there = _image(connection.docker, tag)
        if there is not None and there.attrs["Architecture"] == wanted:
            return there
        if (ours := _image_here(here, tag, wanted)) is not None:
            name, image = ours
            size_mb = image.attrs["Size"] / 2**20
            notify(f"copying image {name} to board {connection.name} ({size_mb:.0f} MB)")
            connection.docker.images.load(image.save(named=name))
            connection.docker.images.get(name).tag(tag)
        else:
            notify(f"building image {tag} on board {connection.name}, for {wanted}")
            _build_there(connection, tag)
        there = _image(connection.docker, tag)
    if there is None or there.attrs["Architecture"] != wanted:
        raise environment_error(
            f"board {connection.name} is {connection.seen.architecture} and has no image {tag} for "
            f"{wanted}; run 'slambed images' there, at this commit"
        )
    return there


def _image(client: docker.DockerClient, tag: str) -> Any | None:
    try:
        return client.images.get(tag)
    except ImageNotFound:
        return None


def _image_here(here: docker.DockerClient | None, tag: str, wanted: str) -> tuple[str, Any] | None:
    """Returns name and image of this machine for an architecture; None if it has none."""
    for name in (tag, f"{tag}-{wanted}"):
        image = None if here is None else _image(here, name)
        if image is not None and image.attrs["Architecture"] == wanted:
            return name, image
    return None


def _build_there(connection: BoardConnection, tag: str) -> None:
    command = ["bash", str(repository_root() / "tools" / "build_image.sh"), tag]
    # Its programs are for the board: they must not replace those of this machine.
    with tempfile.TemporaryDirectory(prefix="slambed-build-") as programs:
        environment = os.environ | {"DOCKER_HOST": connection.docker_url, "SLAMBED_BUILD": programs}
        if subprocess.run(command, check=False, env=environment).returncode != 0:
            raise environment_error(
                f"the node image could not be built on board {connection.name}; see the lines above"
            )


def bring_sequence(connection: BoardConnection, image: Any, sequence: Path, notify: Notify) -> str:
    """Returns the volume on the board with a prepared sequence; copies it if missing, and
    verifies each file on the board."""
    checksum = str((read_object(sequence / "sequence.json") or {}).get("checksum", ""))
    if not checksum:
        raise SlambedError(
            f"{sequence} is no prepared sequence; make it with 'slambed data prepare'"
        )
    name = f"{LABEL}-sequence-{checksum[:16]}"
    client = connection.docker
    with daemon_failures(f"copy {sequence.name} to board {connection.name}"):
        try:
            volume = client.volumes.get(name)
            if _is_verified(client, image, name):
                return name
            volume.remove()
        except NotFound:
            pass
        files = sorted(path for path in sequence.rglob("*") if path.is_file())
        size_mb = sum(path.stat().st_size for path in files) / 2**20
        notify(f"copying {sequence.name} to board {connection.name} ({size_mb:.0f} MB)")
        client.volumes.create(name, labels={SEQUENCE_LABEL: checksum})
        container = _helper(client, image, name, "rw")
        try:
            container.put_archive(PLACE, _archive(sequence, files))
            container.start()
            sums = _sums(container.logs(stream=True, follow=True))
        finally:
            container.remove(force=True)
        for path in files:
            inside = path.relative_to(sequence).as_posix()
            if sums.get(f"./{inside}") != _sha256(path):
                raise environment_error(
                    f"{sequence.name}: {inside} came to board {connection.name} as another file; "
                    "is its disk full or broken?"
                )
        _mark_verified(client, image, name, checksum)
    return name


def _helper(client: docker.DockerClient, image: Any, volume: str, mode: str) -> Any:
    """Returns a container that prints the checksums of all files of the volume's sequence."""
    program = f"cd {SEQUENCE} && find . -type f -exec sha256sum {{}} +"
    return client.containers.create(
        image.id,
        entrypoint=["/bin/sh", "-c", program],
        labels={LABEL: "sequence", f"{LABEL}.role": "copy"},
        network_mode="none",
        user="0:0",
        volumes={volume: {"bind": PLACE, "mode": mode}},
    )


def _is_verified(client: docker.DockerClient, image: Any, volume: str) -> bool:
    container = _helper(client, image, volume, "ro")
    try:
        container.get_archive(VERIFIED)
    except NotFound:
        return False
    finally:
        container.remove(force=True)
    return True


def _mark_verified(client: docker.DockerClient, image: Any, volume: str, checksum: str) -> None:
    container = _helper(client, image, volume, "rw")
    try:
        container.put_archive(PLACE, packed({Path(VERIFIED).name: checksum.encode()}))
    finally:
        container.remove(force=True)


def packed(files: dict[str, bytes]) -> bytes:
    """Returns a tar archive of these files, readable by all users."""
    made = io.BytesIO()
    with tarfile.open(fileobj=made, mode="w") as archive:
        for name, content in files.items():
            entry = tarfile.TarInfo(name)
            entry.size, entry.mode = len(content), 0o644
            archive.addfile(entry, io.BytesIO(content))
    return made.getvalue()


def _archive(sequence: Path, files: list[Path]) -> Iterator[bytes]:
    """Yields the sequence as a tar archive in pieces, because it may be larger than memory."""
    root = Path(SEQUENCE).name
    for path in files:
        entry = tarfile.TarInfo(f"{root}/{path.relative_to(sequence).as_posix()}")
        entry.size, entry.mode = path.stat().st_size, 0o644
        yield entry.tobuf()
        with path.open("rb") as file:
            while piece := file.read(CHUNK_BYTES):
                yield piece
        yield bytes(-entry.size % tarfile.BLOCKSIZE)
    yield bytes(2 * tarfile.BLOCKSIZE)


def _sums(lines: Iterator[bytes]) -> dict[str, str]:
    """Parses sha256sum output: file -> SHA-256."""
    text = b"".join(lines).decode(errors="replace")
    pairs = (line.split(maxsplit=1) for line in text.splitlines())
    return {pair[1]: pair[0] for pair in pairs if len(pair) == 2}


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
