# SPDX-License-Identifier: Apache-2.0
"""The node image, named by the hash of its sources so that an outdated one is never used."""

import os
import subprocess
from typing import Any

import docker
from docker.errors import ImageNotFound

from slambed.engines.docker_errors import DAEMON_ERRORS, daemon_failures
from slambed.errors import SlambedError, environment_error
from slambed.native import build_folder, repository_root
from slambed.spec.software import source_hash

REPOSITORY = "slambed-node"


def image_tag() -> str:
    """Returns the tag of the image for the sources of this checkout."""
    return f"{REPOSITORY}:{source_hash()}"


def connect() -> docker.DockerClient:
    """Returns a client of the daemon on this host."""
    try:
        client = docker.from_env(timeout=60)
        client.ping()
    except DAEMON_ERRORS as error:
        raise environment_error(f"no Docker: {_reason(error)}; {advice(error)}") from None
    return client


def advice(error: Exception) -> str:
    """Returns advice for an unreachable daemon."""
    if "permission" in str(error).lower():
        return "run with sudo or join the group docker"
    return "start the Docker daemon; without it engine local runs live, as root"


def _reason(error: Exception) -> str:
    text = str(error)
    if "Permission" in text:
        return "no permission for the daemon's socket"
    if "FileNotFound" in text or "Connection refused" in text or "ConnectionRefused" in text:
        return "the daemon does not answer"
    return text.splitlines()[0]


def find_image(client: docker.DockerClient) -> Any | None:
    """Returns the image of these sources; None if it is not built."""
    with daemon_failures("look for the node image"):
        try:
            return client.images.get(image_tag())
        except ImageNotFound:
            return None


def build_image() -> None:
    """Like `make images`: builds the image, and its base if needed; output goes to the terminal."""
    command = ["bash", str(repository_root() / "tools" / "build_image.sh"), image_tag()]
    environment = os.environ | {"SLAMBED_BUILD": str(build_folder())}
    if subprocess.run(command, check=False, env=environment).returncode != 0:
        raise SlambedError("the node image could not be built; see the lines above")
