# SPDX-License-Identifier: Apache-2.0
"""The engine checks of `slambed run` on this host, for `--check`."""

from collections.abc import Callable

from rich.console import Console

from slambed.errors import SlambedError
from slambed.native import SIMULATION, find_program
from slambed.spec.device import VIRTUAL
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.software import host_software


def engine_here(asked: str, experiment: Experiment, library: Library) -> list[str]:
    """Returns the engine that runs would get, and what is not ready. Raises SlambedError if this
    host refuses it, like `slambed run`."""
    # Importing containers takes 0.5 s, which virtual runs do not need.
    if asked == VIRTUAL:
        return [f"engine: {VIRTUAL}", *_not_ready(_virtual_is_ready)]
    from slambed.campaign.choose import choose_engine, decide
    from slambed.campaign.foreign import software_of_foreign
    from slambed.engines.docker_image import connect, find_image

    name, why = decide(asked)
    lines = [f"engine: {name}" + (f" ({why})" if why else "")]
    if name == "docker" and find_image(connect()) is None:
        lines.append("note: the node image is not built; 'slambed run' builds it first")

    def is_ready() -> None:
        engine, software = choose_engine(name, Console(quiet=True), build=None)
        software_of_foreign(experiment, library, engine, software)

    return [*lines, *_not_ready(is_ready)]


def _virtual_is_ready() -> None:
    find_program(SIMULATION)
    host_software(program=SIMULATION)


def _not_ready(is_ready: Callable[[], None]) -> list[str]:
    """Reports what must be built before runs can start, although files and host are valid."""
    try:
        is_ready()
    except SlambedError as error:
        return [f"note: 'slambed run' would be refused: {error}"]
    return []
