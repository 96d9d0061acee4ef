# SPDX-License-Identifier: Apache-2.0
"""Systems that are programs of their own: what their runs' software is called."""

from slambed.engines.base import Engine
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.software import foreign_software


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
