# SPDX-License-Identifier: Apache-2.0
"""Which device a role of a system gets: the system's own or the experiment's, possibly changed."""

from slambed.errors import SlambedError
from slambed.files.yaml_source import Location, YamlSource
from slambed.spec.device import VIRTUAL, Device, DeviceChange
from slambed.spec.experiment import HOST_PACE, Experiment
from slambed.spec.library import Library
from slambed.spec.stages import costs_with
from slambed.spec.system import Role, System


def has_boards(experiment: Experiment, source: YamlSource, library: Library) -> bool:
    """Returns whether the limits of any live run derive from a board and the measured host
    speed."""
    systems = [(i, library.system(c.system)) for i, c in enumerate(experiment.systems)]
    return any(
        chosen_device(experiment, index, source, library, "", system, role).board is not None
        for index, system in systems
        for role in system.roles
    )


def chosen_device(
    experiment: Experiment,
    index: int,
    source: YamlSource,
    library: Library,
    engine: str,
    system: System,
    role: Role,
) -> Device:
    """Returns the device of the system for this role, or else that of the experiment. Where its
    cost model is used, the costs of the system's own stages are added. Raises a complaint with
    the place in the file when this engine cannot use the device."""
    place: Location = ("systems", index, "devices", role)
    asked: str | DeviceChange | None = getattr(experiment.systems[index].devices, role)
    if asked is None:
        place = ("devices", role)
        asked = experiment.devices.mobile if role == "mobile" else experiment.devices.edge
    try:
        if not isinstance(asked, DeviceChange):
            device = library.device(asked)
        elif asked.name in library.devices():
            raise SlambedError(f"there is a device {asked.name} already, name the changed one anew")
        elif engine not in (VIRTUAL, ""):
            raise SlambedError(f"a changed device needs engine virtual, not {engine}")
        else:
            device = asked.applied_to(library.device(asked.device))
    except (SlambedError, ValueError) as error:
        raise source.complaint(str(error), place) from None
    if engine != VIRTUAL and experiment.pace == HOST_PACE:
        return device
    if device.model is None:
        message = f"device {device.name} has no cost model"
        if engine != VIRTUAL:
            message += ", so that no live run can keep its pace (pace: device)"
        raise source.complaint(message, place, "fit one: slambed calibrate --stages")
    try:
        costs = costs_with(system.stages, device.model.stages, role)
    except ValueError as error:
        line = f"device {device.name}, system {system.name}: {error}"
        raise source.complaint(line, place) from None
    return device.model_copy(update={"model": device.model.model_copy(update={"stages": costs})})
