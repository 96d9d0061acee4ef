# SPDX-License-Identifier: Apache-2.0
"""The actions of `slambed calibrate`, one per option, and their tables."""

import os
from pathlib import Path

import typer
from rich.table import Table

from slambed.calibrate.device_file import write_model
from slambed.calibrate.fit import StageFit, fit_stages
from slambed.calibrate.match import Fit, Played, Setting, experiment_on
from slambed.calibrate.measured import stages_of
from slambed.calibrate.targets import Targets
from slambed.campaign.datasets import prepare_sequence
from slambed.campaign.masks import make_masks
from slambed.campaign.plan import masks_asked
from slambed.data.places import cache_folder
from slambed.errors import ExitCode, SlambedError
from slambed.files.yaml_source import load_yaml, parse
from slambed.native import SIMULATION, find_program
from slambed.process.cpus import own_cpus
from slambed.spec.device import CostModel
from slambed.spec.host_speed import load_host_speed, save_host_speed
from slambed.spec.library import Library
from slambed.spec.software import host_software
from slambed.terminal import console


def calibrate_host() -> None:
    """Executes `--host`."""
    from slambed.calibrate.host import REFERENCE_UNITS_PER_S, measure_host

    measured = measure_host()
    speed = measured.speed
    rounds = ", ".join(f"{value:.0f}" for value in measured.units_per_s)
    typer.echo(f"units of work per CPU second: {rounds}")
    typer.echo(
        f"a core of this host: {speed.speed:.3f} of the reference ({REFERENCE_UNITS_PER_S:.0f}), "
        f"spread {100 * (speed.spread or 0):.0f} %"
    )
    typer.echo(f"kept in {save_host_speed(speed)}")
    library = Library()
    table = Table("device", "board", "cores", "quota", "per thread", "missing here", box=None)
    for path in sorted((library.root / "catalog" / "devices").glob("*.yaml")):
        device = library.device(path.stem)
        if (board := device.board) is None:
            continue
        found = device.limits_on(speed.speed, len(own_cpus()))
        table.add_row(
            device.name,
            f"{board.cores} x {board.core_speed:g}",
            str(found.cores),
            f"{found.quota_cores:.3f}",
            f"{found.thread_cores:.3f}",
            device.shortfall(found, speed.speed) or "nothing",
        )
    _print(table)


def check_limits(name: str, engine: str | None, seconds: float) -> None:
    """Executes `--limits`."""
    from slambed.calibrate.limits import engines, limits_table, measure_limits, quiet_host

    if engine not in (None, "docker", "local"):
        raise SlambedError(f"unknown engine '{engine}' for --limits; known: docker, local")
    device = Library().device(name)
    speed = load_host_speed()
    with quiet_host():
        rows = [
            measure_limits(device, speed, one, count, seconds)
            for one in engines(engine)
            for count in (1, 4)
        ]
    _print(limits_table(rows))
    if problems := [f"engine {row.engine}: {text}" for row in rows for text in row.problems]:
        raise SlambedError("; ".join(problems), ExitCode.NOT_ALL_GOOD)


def fit_host(stages: list[Path], output: Path | None, cores: int | None) -> None:
    """Executes `--stages`."""
    fits = fit_stages(stages_of(stages))
    if not fits:
        raise SlambedError("no stage was measured often enough; give longer or more runs")
    _print(fit_table(fits))
    if output is not None:
        model = CostModel(
            cores=cores or os.cpu_count() or 1, stages={fit.name: fit.cost for fit in fits}
        )
        comments = {"": "Fitted by 'slambed calibrate --stages' to CPU times of live runs."}
        write_model(output, model, comments, f"Fitted to {len(stages)} folders of live runs")
        typer.echo(f"cost model written to {output}")


def match_paper(name: str, jobs: int | None, check: bool) -> None:
    """Executes `--match`, with or without `--check`."""
    library = Library()
    source = load_yaml(library.root / "catalog" / "devices" / "fits" / f"{name}.yaml")
    targets = parse(Targets, source)
    sequences = {
        name: prepare_sequence(name) for name in sorted(map(targets.dataset_of, targets.conditions))
    }
    masks = {
        entry: made
        for name, sequence in sequences.items()
        for entry, made in make_masks(
            masks_asked(experiment_on(targets, name), library), {name: sequence}, typer.echo
        ).items()
    }
    setting = Setting(
        sequences={
            name: Played(sequence.path, sequence.played_s(targets.playback), sequence.checksum)
            for name, sequence in sequences.items()
        },
        program=find_program(SIMULATION),
        features=cache_folder() / "features",
        software=host_software(program=SIMULATION),
        jobs=jobs or len(own_cpus()),
        masks=masks,
    )
    fit = Fit(targets, source, library)
    if check:
        fit.look_again(setting, as_written=True)
        _print(match_table(fit))
        return
    for number in range(targets.rounds):
        fit.round(setting)
        typer.echo(f"round {number + 1} of {targets.rounds}: {worst_line(fit)}")
    # Simulates once more, so that the table below belongs to the models written.
    fit.look_again(setting)
    _print(match_table(fit))
    head = f"Found by 'slambed calibrate --match {name}': {targets.title}."
    # All of them before the first is written: a device may be refused.
    models = [fit.models(role) for role, fitted in targets.devices.items() if not fitted.given]
    for device, model in (pair for of_role in models for pair in of_role.items()):
        path = library.root / "catalog" / "devices" / f"{device}.yaml"
        write_model(path, model, {"": head}, targets.title)
        typer.echo(f"cost model written to {path}")


def worst_line(fit: Fit) -> str:
    """Returns a line about the component that is farthest from its printed mean."""
    errors = {key: abs(fit.error_percent(*key)) for key in fit.seen}
    (component, condition), error = max(errors.items(), key=lambda item: item[1])
    return f"largest error {error:.0f} % ({component}, {condition})"


def match_table(fit: Fit) -> Table:
    table = Table("component", "condition", "printed ms", "simulated ms", "error %", box=None)
    for component in fit.targets.components:
        for condition, mean in component.mean_ms.items():
            seen = fit.seen[component.name, condition]
            sd = component.sd_ms.get(condition)
            table.add_row(
                component.name,
                condition,
                f"{mean:.1f}" + (f" +/- {sd:.1f}" if sd is not None else ""),
                f"{seen.mean:.1f} +/- {seen.sd:.1f}",
                f"{fit.error_percent(component.name, condition):+.1f}",
            )
    return table


def _print(table: Table) -> None:
    console().print(table)


def fit_table(fits: list[StageFit]) -> Table:
    """Returns the fit and residuals of every stage."""
    columns = ["stage", "n", "mean us", "a us", "b us", "c us", "jitter"]
    table = Table(*columns, "mean %", "median %", "p95 %", box=None)
    for fit in fits:
        cost = fit.cost
        numbers = [fit.mean_us, cost.a_us, cost.b_us, cost.c_us, cost.jitter]
        errors = [fit.mean_error_percent, fit.median_error_percent, fit.p95_error_percent]
        table.add_row(
            fit.name,
            str(fit.count),
            *(f"{value:.4g}" for value in numbers),
            *(f"{value:+.1f}" for value in errors[:2]),
            f"{errors[2]:.0f}",
        )
    return table
