# SPDX-License-Identifier: Apache-2.0
"""`slambed systems`, `devices` and `experiments`: lists what an experiment file can name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.console import Console
from rich.table import Table

from slambed.errors import SlambedError
from slambed.terminal import JsonOption, console, json_entry, lists_alone, print_json

if TYPE_CHECKING:
    from pydantic import BaseModel

    from slambed.spec.device import Device
    from slambed.spec.experiment import Experiment
    from slambed.spec.system import Parameter, System

systems = typer.Typer(help="Systems under test, with their variants and parameters.")
devices = typer.Typer(help="Devices that a node may be, live by limits, virtually by costs.")
experiments = typer.Typer(help="Experiments that have a file.")

Named = TypeVar("Named", bound="BaseModel")


def _list(
    headings: tuple[str, ...],
    names: list[str],
    load: Callable[[str], Named],
    row: Callable[[Named], tuple[str, ...]],
    further: str,
    as_json: bool,
) -> None:
    """Prints one row per name, with the title last; an unreadable file shows the reason instead."""
    if as_json:
        print_json([json_entry(name, load) for name in names])
        return
    table = Table(*headings, "title", box=None)
    for name in names:
        try:
            cells = row(load(name))
        except SlambedError as error:
            cells = (*[""] * (len(headings) - 1), f"not usable: {error}")
        table.add_row(name, *cells)
    screen = console()
    screen.print(table)
    screen.print(further)


def list_systems(as_json: JsonOption = False) -> None:
    """List every system of the checkout and of the folders in $SLAMBED_SYSTEMS."""
    from slambed.spec.library import Library

    library = Library()
    _list(
        ("system", "nodes", "sensors", "variants"),
        library.known_systems(),
        library.system,
        lambda s: (", ".join(s.roles), ", ".join(s.sensors), ", ".join(s.variants) or "-", s.title),
        "parameters, ranges, sources: 'slambed systems show NAME'",
        as_json,
    )


@systems.command("show")
def show_system(
    name: Annotated[str, typer.Argument(help="Name, or path of a system.yaml.")],
    as_json: JsonOption = False,
) -> None:
    """Show variants, parameters and stages of a system: defaults, ranges, units, sources, costs."""
    from slambed.spec.library import Library

    system = Library().system(name)
    if as_json:
        typer.echo(system.model_dump_json(indent=2))
        return
    screen = console()
    _head(screen, system.title, system.doc)
    screen.print(f"nodes: {', '.join(system.roles)}; plays: {', '.join(system.sensors)}")
    if system.variants:
        screen.print(_variants(system))
    screen.print(_parameters(system))
    if system.stages:
        screen.print(_stages(system))


def _stages(system: System) -> Table:
    """Returns what stages cost on devices whose files do not list them."""
    table = Table("stage", "costs", "node", "meaning", box=None)
    for name, stage in system.stages.items():
        factor = f"{stage.factor:g} of " if stage.factor != 1 else ""
        table.add_row(name, factor + stage.cost_as, stage.role or "both", stage.doc)
    return table


def _variants(system: System) -> Table:
    """Returns the table of variants; an experiment that names none gets the first one."""
    table = Table("variant", "title", "other than the defaults", box=None)
    for name, variant in system.variants.items():
        own = ", ".join(f"{key}={value}" for key, value in variant.params.items())
        table.add_row(name, variant.title, own or "-")
    return table


def _parameters(system: System) -> Table:
    table = Table("parameter", "default", "range", "unit", "meaning", "source", box=None)
    for name, parameter in system.params.items():
        default = str(parameter.default) or "-"
        table.add_row(
            name, default, _range(parameter), parameter.unit, parameter.doc, parameter.source
        )
    return table


def _range(parameter: Parameter) -> str:
    if parameter.choices is not None:
        return ", ".join(map(str, parameter.choices))
    low, high = parameter.min, parameter.max
    if low is None and high is None:
        return parameter.type
    if high is None:
        return f"from {low:g}"
    return f"to {high:g}" if low is None else f"{low:g} to {high:g}"


def list_devices(as_json: JsonOption = False) -> None:
    """List every device."""
    from slambed.spec.library import Library

    library = Library()
    _list(
        ("device", "live", "virtual"),
        library.devices(),
        library.device,
        lambda device: (_live(device), _virtual(device), device.title),
        "limits, costs of stages, how they were fitted: 'slambed devices show NAME'",
        as_json,
    )


def _live(device: Device) -> str:
    if device.board is not None:
        return f"{device.board.cores} cores of speed {device.board.core_speed:g}"
    limits = device.limits
    cores = limits.quota_cores or limits.cores
    return f"{cores:g} of this host's cores" if cores else "no limit"


def _virtual(device: Device) -> str:
    model = device.model
    return "no" if model is None else f"{model.cores} cores, {len(model.stages)} stages"


@devices.command("show")
def show_device(
    name: Annotated[str, typer.Argument(help="Name in catalog/devices/.")],
    as_json: JsonOption = False,
) -> None:
    """Show the limits of a device, and what each stage costs on it."""
    from slambed.spec.library import Library

    device = Library().device(name)
    if as_json:
        typer.echo(device.model_dump_json(indent=2))
        return
    screen = console()
    _head(screen, device.title, device.hardware)
    screen.print(f"live: {_live(device)}; limits: {_set(device.limits)}")
    if device.notes:
        screen.print(device.notes.strip())
    if device.model is None:
        screen.print("virtual: no costs, so it runs live only, at the host's pace")
        return
    busy = f", {device.model.background:g} busy with other work" if device.model.background else ""
    costs = f"costs divided by {device.model.speed:g}"
    screen.print(f"virtual, and live with pace: device: {device.model.cores} cores{busy}, {costs}")
    table = Table("stage", "fixed [us]", "per n1 [us]", "per n2 [us]", "jitter", "on", box=None)
    for stage, cost in device.model.stages.items():
        numbers = (f"{x:g}" for x in (cost.a_us, cost.b_us, cost.c_us, cost.jitter))
        table.add_row(stage, *numbers, cost.accelerator or "a core")
    screen.print(table)


def list_experiments(as_json: JsonOption = False) -> None:
    """List every experiment, with the published numbers that it reproduces."""
    from slambed.spec.library import Library

    library = Library()
    _list(
        ("experiment", "reproduces"),
        library.experiments(),
        lambda name: library.experiment(name)[0],
        lambda experiment: (", ".join(experiment.reproduces) or "-", experiment.title),
        "one of them: 'slambed experiments show NAME', then 'slambed run NAME'",
        as_json,
    )


@experiments.command("show")
def show_experiment(
    name: Annotated[str, typer.Argument(help="Name in experiments/, or path of a YAML file.")],
    as_json: JsonOption = False,
) -> None:
    """Show what an experiment compares, on which datasets, and how often; a grid is written out."""
    from slambed.spec.library import Library

    experiment, source = Library().experiment(name)
    if as_json:
        typer.echo(experiment.model_dump_json(indent=2))
        return
    screen = console()
    _head(screen, experiment.title, experiment.notes)
    for line in _compared(experiment):
        screen.print(line)
    screen.print(f"file: {source.path}; combinations and time: 'slambed run {name} --dry-run'")


def _compared(experiment: Experiment) -> list[str]:
    lines = []
    for choice in experiment.systems:
        named = ":".join(filter(None, (choice.system, choice.variant)))
        own = ", ".join(f"{key}={value}" for key, value in choice.params.items())
        label = f" as {choice.label}" if choice.label else ""
        lines.append(f"system: {named}{label}{f' ({own})' if own else ''}")
    lines.append(f"datasets: {', '.join(experiment.datasets)}; {_set(experiment.playback)}")
    if experiment.link is not None:
        reported = experiment.link.model_dump(mode="json")["profiles"]
        lines.append(f"link profiles: {', '.join(map(_profile, reported))}")
    lines.append(f"devices: {_set(experiment.devices)}")
    lines.append(f"runs per combination: {_set(experiment.runs)}; seed {experiment.seed}")
    return lines


def _profile(reported: object) -> str:
    if not isinstance(reported, dict):
        return f"{reported:g} ms" if isinstance(reported, int | float) else str(reported)
    return str(reported.get("name") or reported.get("profile") or "written in place")


def _set(model: BaseModel) -> str:
    """Returns the fields that are set, as `key value, key value`."""
    known = model.model_dump(mode="json", exclude_none=True)
    return ", ".join(f"{key} {value}" for key, value in known.items()) or "none"


def _head(screen: Console, title: str, text: str) -> None:
    screen.print(title, style="bold")
    if text.strip():
        screen.print(text.strip())


lists_alone(systems, list_systems)
lists_alone(devices, list_devices)
lists_alone(experiments, list_experiments)
