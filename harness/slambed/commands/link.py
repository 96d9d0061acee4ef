# SPDX-License-Identifier: Apache-2.0
"""`slambed link`: measures the emulated link on this machine."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from slambed.commands.profiles import SetOption, load_changed
from slambed.commands.shared_options import PictureOption
from slambed.data.places import picture
from slambed.errors import ExitCode, SlambedError
from slambed.files.outputs import figure_file, make_folder, must_be_writable, writing
from slambed.terminal import console

if TYPE_CHECKING:
    import pandas as pd

app = typer.Typer(help="The emulated link between the nodes.", no_args_is_help=True)


@app.command()
def measure(
    name: Annotated[str, typer.Argument(help="Profile: name or YAML file.")] = "ramp",
    values: SetOption = None,
    backend: Annotated[str, typer.Option(help="relay, netem, none or auto.")] = "auto",
    seconds: Annotated[float, typer.Option(min=1.0, help="How long.")] = 20.0,
    seed: Annotated[int, typer.Option(help="Of losses and jitter.")] = 1,
    tcp: Annotated[bool, typer.Option(help="Also follow a TCP connection's tcpi_rtt.")] = False,
    log: Annotated[Path | None, typer.Option(help="Link log to write: .csv or .parquet.")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Plot to write: .png, .svg or .pdf.")
    ] = None,
) -> None:
    """Verify the link on this machine: play a profile between two namespaces, compare requested
    with measured RTT."""
    from slambed.link.bench import measure_link
    from slambed.link.plots import plot_links

    output = figure_file(output) if output else None
    for file, option in ((log, "--log"), (output, "--output")):
        if file is not None:
            must_be_writable(file, option)
    run = measure_link(load_changed(name, values or []), backend, seconds, seed, with_tcp=tcp)
    table = Table("", "", box=None, show_header=False)
    for key, value in vars(run.record.proof).items():
        shown = f"{value:.3f}" if isinstance(value, float) else str(value)
        table.add_row(key, shown or "-")
    table.add_row("backend", run.record.backend)
    table.add_row("dropped", f"{run.record.drops['up']} up, {run.record.drops['down']} down")
    console().print(table)
    if log is not None:
        _write_log(run.record.frame, log, "--log")
        typer.echo(f"log: {log}")
    if output is not None:
        plot_links({run.record.backend: run.record.frame}, output)
        typer.echo(f"plot: {output}")
    if not run.record.proof.valid:
        raise SlambedError(f"link not proved: {run.record.proof.reason}", ExitCode.NOT_ALL_GOOD)


def _write_log(frame: pd.DataFrame, path: Path, option: str = "--output") -> None:
    with writing(path, option):
        if path.suffix == ".parquet":
            frame.to_parquet(path)
        else:
            frame.to_csv(path, index=False, float_format="%.6g")


@app.command()
def bench(
    backend: Annotated[str, typer.Option(help="relay or netem.")] = "relay",
    seconds: Annotated[float, typer.Option(min=1.0, help="Per profile.")] = 30.0,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the table and the logs.")
    ] = Path("bench"),
    flood: Annotated[int, typer.Option(help="Packets of the reordering test; 0 = none.")] = 0,
) -> None:
    """Measure a backend: delay errors of six profiles, TCP throughput, packet reordering."""
    import pandas as pd

    from slambed.link import bench as measurements

    make_folder(output, "--output")
    rows = []
    for profile in measurements.bench_profiles(seconds):
        row, frame = measurements.bench(profile, backend, seconds)
        _write_log(frame, output / f"{backend}_{profile.name}.csv")
        rows.append(asdict(row))
    table = pd.DataFrame(rows)
    table.to_csv(output / f"{backend}.csv", index=False, float_format="%.4f")
    typer.echo(table.round(3).to_string(index=False))
    for rtt_ms in (0.0, 40.0):
        up, down = measurements.throughput(backend, rtt_ms)
        typer.echo(f"TCP at {rtt_ms:g} ms RTT: {up:.0f} Mbit/s up, {down:.0f} Mbit/s down")
    if flood:
        found = measurements.reordering(backend, flood)
        typer.echo(
            f"{found.received} of {flood} packets came in {found.seconds:.1f} s while the delay "
            f"swung by 20 ms one way, {found.reordered} out of order"
        )


@app.command()
def statistics(
    seconds: Annotated[float, typer.Option(min=1.0, help="Per impairment.")] = 30.0,
    seed: Annotated[int, typer.Option(help="Of losses and jitter.")] = 1,
) -> None:
    """Check that loss and jitter of real packets are within 3 standard errors of the requested
    values."""
    from slambed.link import statistics as measurements

    headings = ["impairment", "packets", "held up", "", "asked", "found", "standard errors"]
    table = Table(*headings, box=None)
    found = []
    for case in measurements.CASES:
        result = measurements.check(case, seconds, seed)
        found.append(result)
        whose = [result.case, str(result.packets), str(result.held_up)]
        for figure in result.figures:
            numbers = [f"{figure.asked:.4g}", f"{figure.found:.4g}", f"{figure.sigmas:+.1f}"]
            table.add_row(*whose, figure.name, *numbers)
        if result.repeated is not None:
            same = "yes" if result.repeated else "no"
            table.add_row(*whose, "same packets again", "yes", same, "")
    console().print(table)
    if bad := [result.case for result in found if not result.good]:
        raise SlambedError(f"not as asked: {', '.join(bad)}", ExitCode.NOT_ALL_GOOD)


@app.command()
def messages(
    backend: Annotated[str, typer.Option(help="relay or netem.")] = "relay",
    repetitions: Annotated[int, typer.Option(min=1, help="Of each size.")] = 5,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="CSV to write too, with all digits.")
    ] = None,
    profile: Annotated[
        str, typer.Option(help="A profile with loss, jitter, rate or cuts: steady traffic over it.")
    ] = "",
    count: Annotated[int, typer.Option(min=1, help="With --profile: messages.")] = 250,
    size: Annotated[int, typer.Option(min=64, help="With --profile: bytes of each.")] = 25_000,
    hz: Annotated[float, typer.Option(min=0.1, help="With --profile: messages a second.")] = 10.0,
    seeds: Annotated[int, typer.Option(min=1, help="With --profile: seeds 1 to this.")] = 3,
) -> None:
    """Send the same messages through a real link and through the virtual engine's link model."""
    from slambed.link import messages as traffic
    from slambed.link.profile import load_profile

    if output is not None:
        must_be_writable(output, "--output")
    if profile:
        steady = traffic.Trace.steady(count, size, hz)
        rows = traffic.compare_profile(load_profile(profile), steady, range(1, seeds + 1), backend)
        _keep(rows, output)
        typer.echo(rows.round(1).to_string(index=False))
        medians = rows.median()
        for quantile in ("50", "90", "100"):
            live, virtual = medians[f"live_{quantile}_ms"], medians[f"virtual_{quantile}_ms"]
            typer.echo(f"quantile {quantile} %: live {live:.1f} ms, virtual {virtual:.1f} ms")
        return
    profiles = [(rtt, rate) for rate in traffic.RATES_MBPS for rtt in traffic.RTTS_MS]
    table = traffic.compare(profiles, traffic.SIZES, repetitions, backend)
    _keep(table, output)
    typer.echo(table.round(2).to_string(index=False))
    error = table["error_percent"].abs()
    typer.echo(f"error of the model: median {error.median():.1f} %, largest {error.max():.1f} %")


def _keep(table: pd.DataFrame, output: Path | None) -> None:
    """Writes the table if an output was given."""
    if output is not None:
        with writing(output):
            table.to_csv(output, index=False, float_format="%.4f")


@app.command()
def compare(
    logs: Annotated[list[Path], typer.Argument(help="Link logs: CSV of `link bench` or Parquet.")],
    output: PictureOption = None,
) -> None:
    """Plot link logs side by side: requested, applied and measured RTT, and the error."""
    from slambed.link.plots import plot_links

    frames = {title: _read_log(path) for title, path in _titles(logs).items()}
    file = figure_file(output) if output else picture("links.png")
    plot_links(frames, file)
    typer.echo(f"plot: {file}")


def _titles(logs: list[Path]) -> dict[str, Path]:
    """Returns the logs by title: the file's name, of several with one name the folder's, and of
    several such folders the whole path."""
    logs = list(dict.fromkeys(logs))
    stems = Counter(path.stem for path in logs)
    folders = Counter(path.absolute().parent.name for path in logs if stems[path.stem] > 1)
    titles = {}
    for path in logs:
        title, folder = path.stem.replace("_", ", ", 1), path.absolute().parent.name
        if stems[path.stem] > 1:
            title = folder if folders[folder] == 1 else str(path)
        titles[str(path) if title in titles else title] = path
    return titles


def _read_log(path: Path) -> pd.DataFrame:
    import pandas as pd

    if not path.is_file():
        raise SlambedError(f"no such link log: {path}")
    try:
        frame = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
        if missing := {"t_s", "series", "value"} - set(frame):
            raise ValueError(f"it has no column {min(missing)}")
        return frame.astype({"t_s": float, "series": str, "value": float})
    except (OSError, ValueError, TypeError) as broken:
        reason = str(broken).partition("\n")[0]
        raise SlambedError(
            f"{path} is no link log: {reason}; give one of 'link bench', or a run's link.parquet"
        ) from None
