# SPDX-License-Identifier: Apache-2.0
"""Software tags of systems with their own programs."""

from collections.abc import Callable, Mapping
from pathlib import Path

from slambed.engines.base import Engine
from slambed.engines.python_packages import (
    kept_environment,
    make_environment,
    must_have_debian_packages,
)
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.runtime import Runtime, foreign_digest
from slambed.spec.software import software_of_systems

PLAYER_LIBRARY = "play"
"""The C++ layer that slambed-play is built from."""


def software_of_foreign(
    experiment: Experiment,
    library: Library,
    engine: Engine,
    software: str,
    notify: Callable[[str], None] | None = None,
) -> dict[str, str]:
    """Returns system -> software tag, where `software` is the tag of the built-in systems.

    With `notify`, missing Python packages of these systems are installed. Raises SlambedError for
    a missing image, file or package.
    """
    found: dict[str, str] = {}
    for named in dict.fromkeys(choice.system for choice in experiment.systems):
        system = library.system(named)
        if system.runtime is not None:
            folder = library.system_file(named).parent
            images = engine.image_ids(system.runtime, system.name)
            found[system.name] = foreign_software(
                software, system.runtime, folder, images, library.root, notify
            )
    return found


def foreign_software(
    software: str,
    runtime: Runtime,
    folder: Path,
    images: Mapping[str, str],
    root: Path | None = None,
    notify: Callable[[str], None] | None = None,
) -> str:
    """Returns the tag of a system with its own program: the player's tag and the system's digest.

    `images`: role -> image id, for containers. With `notify`, missing Python packages are
    installed.
    """
    player = software_of_systems(software, [PLAYER_LIBRARY], root).get(PLAYER_LIBRARY, software)
    packages = ""
    if runtime.python is not None:
        if not images:
            must_have_debian_packages(runtime.python, folder)
        packages = (
            kept_environment(runtime.python, folder)
            if notify is None
            else make_environment(runtime.python, folder, notify)
        ).lock
    return f"{player}.{foreign_digest(runtime, folder, images, packages)}"
