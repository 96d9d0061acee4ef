# SPDX-License-Identifier: Apache-2.0
"""Which engine a campaign gets on this host."""

from collections.abc import Callable

from rich.console import Console

from slambed.engines.base import Engine
from slambed.engines.docker import DockerEngine
from slambed.engines.docker_image import build_image, connect, find_image
from slambed.engines.helper import is_root
from slambed.engines.local import LocalEngine
from slambed.errors import ExitCode, SlambedError, environment_error
from slambed.spec.software import host_software, image_software


def choose_engine(asked: str, console: Console) -> tuple[Engine, str]:
    """The engine and the tag of the software it runs.

    `auto` takes docker where a daemon answers, else local, and says which and why. A missing image
    is built.
    """
    if asked == "local":
        return _local()
    if asked == "docker":
        return _docker()
    try:
        connect().close()
    except SlambedError as error:
        if error.code != ExitCode.ENVIRONMENT:
            raise
        console.print(f"{error}: taking engine local", highlight=False, soft_wrap=True)
        return _local()
    return _docker()


def _local() -> tuple[Engine, str]:
    return LocalEngine(), host_software()


def _docker(build: Callable[[], None] = build_image) -> tuple[Engine, str]:
    client = connect()
    if find_image(client) is None:
        build()
    return DockerEngine(client), image_software()


def check_privilege(engine: str) -> None:
    """A live run needs root, or a Docker daemon that listens to us."""
    if is_root():
        return
    refused = "engine local needs root"
    if engine != "local":
        try:
            connect().close()
            return
        except SlambedError as error:
            refused = str(error)
    raise environment_error(
        f"no permission for a live run: not root, and {refused}; run the same command with sudo, "
        "or with --engine virtual, which needs no privilege"
    )
