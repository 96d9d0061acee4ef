# SPDX-License-Identifier: Apache-2.0
"""Software tags of systems with their own programs."""

from collections.abc import Mapping
from pathlib import Path

from slambed.engines.base import Engine
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.runtime import Runtime, foreign_digest
from slambed.spec.software import software_of_systems

PLAYER_LIBRARY = "play"
"""The C++ layer that slambed-play is built from."""


def software_of_foreign(
    experiment: Experiment, library: Library, engine: Engine, software: str
) -> dict[str, str]:
    """Returns system -> software tag, where `software` is the tag of the built-in systems.

    Raises SlambedError for a missing image or file.
    """
    found: dict[str, str] = {}
    for named in dict.fromkeys(choice.system for choice in experiment.systems):
        system = library.system(named)
        if system.runtime is not None:
            images = engine.image_ids(system.runtime, system.name)
            folder = library.system_file(named).parent
            found[system.name] = foreign_software(
                software, system.runtime, folder, images, library.root
            )
    return found


def foreign_software(
    software: str,
    runtime: Runtime,
    folder: Path,
    images: Mapping[str, str],
    root: Path | None = None,
) -> str:
    """Returns the tag of a system with its own program: the player's tag and the system's digest.

    `images`: role -> image id, for containers.
    """
    player = software_of_systems(software, [PLAYER_LIBRARY], root).get(PLAYER_LIBRARY, software)
    return f"{player}.{foreign_digest(runtime, folder, images)}"
