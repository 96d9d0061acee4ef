# SPDX-License-Identifier: Apache-2.0
"""Selects the engine of a campaign on this host."""

from collections.abc import Callable
from typing import Literal

from rich.console import Console

from slambed.engines.base import Engine
from slambed.engines.docker import DockerEngine
from slambed.engines.docker_errors import daemon_failures
from slambed.engines.docker_image import build_image, connect, find_image
from slambed.engines.docker_kinds import shortcomings
from slambed.engines.helper import is_root
from slambed.engines.local import LocalEngine
from slambed.errors import ExitCode, SlambedError, environment_error
from slambed.spec.software import host_software, image_software


def decide(asked: str) -> tuple[Literal["docker", "local"], str]:
    """Returns the engine of live runs on this host, and why `auto` did not take docker. `auto`
    takes docker if a daemon answers, else local. Raises SlambedError if this host refuses live
    runs."""
    check_privilege(asked)
    if asked == "local":
        return "local", ""
    try:
        connect().close()
    except SlambedError as error:
        if asked == "docker" or error.code != ExitCode.ENVIRONMENT:
            raise
        return "local", f"{error}: taking engine local"
    return "docker", ""


def choose_engine(
    asked: str, console: Console, build: Callable[[], None] | None = build_image
) -> tuple[Engine, str]:
    """Returns the engine and its software tag; prints why `auto` takes local.

    Builds a missing image; with `build` None it does not, and the engine can only be queried.
    """
    name, why = decide(asked)
    if why:
        console.print(why, highlight=False, soft_wrap=True)
    return _local() if name == "local" else _docker(console, build)


def _local() -> tuple[Engine, str]:
    return LocalEngine(), host_software()


def _docker(console: Console, build: Callable[[], None] | None) -> tuple[Engine, str]:
    client = connect()
    with daemon_failures("describe itself"):
        for line in shortcomings(client.info()):
            console.print(f"note: {line}", highlight=False, soft_wrap=True)
    if build is not None and find_image(client) is None:
        build()
    return DockerEngine(client, for_questions=build is None), image_software()


def check_privilege(engine: str) -> None:
    """Raises unless we are root or have access to a Docker daemon."""
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
