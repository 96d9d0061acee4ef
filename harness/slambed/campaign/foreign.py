# SPDX-License-Identifier: Apache-2.0
"""Systems that are programs of their own: what their runs' software is called."""

from collections.abc import Mapping
from pathlib import Path

from slambed.engines.base import Engine
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.runtime import Runtime, foreign_digest
from slambed.spec.software import software_of_systems

PLAYER_FLOOR = "play"
"""The floor of the C++ sources that slambed-play is made of."""


def software_of_foreign(
    experiment: Experiment, library: Library, engine: Engine, software: str
) -> dict[str, str]:
    """System -> tag of its software, where `software` is that of ours.

    Raises SlambedError for an image or file that is not here."""
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
    """Tag of a system that is a program of its own: that of the player, and its own digest.

    `images`: role -> id of its image, where containers are made of them."""
    player = software_of_systems(software, [PLAYER_FLOOR], root).get(PLAYER_FLOOR, software)
    return f"{player}.{foreign_digest(runtime, folder, images)}"
