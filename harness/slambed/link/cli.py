# SPDX-License-Identifier: Apache-2.0
"""`slambed profile ...` (app) and `slambed link ...` (link_app)."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from rich.table import Table

from slambed.errors import ExitCode, SlambedError
from slambed.link.impairments import Side
from slambed.link.profile import Profile, load_profile, parse_profile, profile_names
from slambed.outputs import make_folder, picture, writing
from slambed.terminal import console

app = typer.Typer(help="Link profiles: how latency, loss and rate change.", no_args_is_help=True)
link_app = typer.Typer(help="The emulated link between the nodes.", no_args_is_help=True)

ROWS = 12
CROSSING_MS = 40.0
"""DynNetSLAM's offloading limit L_OL."""
LEAST_SHOWN_S, MOST_SHOWN_S = 0.1, 86_400.0


def _params(values: list[str]) -> dict[str, float]:
    params = {}
    for value in values:
        name, _, number = value.partition("=")
        try:
            params[name] = float(number)
        except ValueError:
            raise SlambedError(f"--set {value} is not name=number") from None
    return params


def _load(name: str, values: list[str]) -> Profile:
    if not values:
        return load_profile(name)
    if name.endswith((".yaml", ".yml")):
        profile = load_profile(name, _params(values))
        return replace(profile, name=f"{profile.name}[{','.join(values)}]")
    return parse_profile({"profile": name, "params": _params(values)}, "--set")


SetOption = Annotated[list[str] | None, typer.Option("--set", help="Parameter: name=number.")]


@app.command("list")
def list_profiles() -> None:
    """Every profile that has a file."""
    table = Table("profile", "RTT [ms]", "length [s]", "description", box=None)
    for name in profile_names():
        try:
            profile = load_profile(name)
        except SlambedError as error:
            table.add_row(name, "-", "-", f"not usable here: {error}")
            continue
        low, high = _range(profile)
        rtt = f"{low:g}" if low == high else f"{low:.4g} to {high:.4g}"
        length = "for ever" if not profile.duration else f"{profile.duration:g}"
        table.add_row(name, rtt, length, profile.description)
    console().print(table)


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="Name in netem_profiles/, or path of a YAML file.")],
    values: SetOption = None,
    output: Annotated[Path | None, typer.Option(help="PNG to write.")] = None,
    until_s: Annotated[float | None, typer.Option(help="Seconds to show.")] = None,
) -> None:
    """Print a profile's values over time and plot them."""
    from slambed.link.plots import plot_profile, span_s

    if until_s is not None and not LEAST_SHOWN_S <= until_s <= MOST_SHOWN_S:
        raise SlambedError(
            f"--until-s {until_s:g} is not between {LEAST_SHOWN_S:g} and {MOST_SHOWN_S:g}"
        )
    profile = _load(name, values or [])
    for line in _heading(profile, _params(values or [])):
        typer.echo(line)
    end = span_s(profile) if until_s is None else until_s
    table = Table("time [s]", "RTT [ms]", "up [ms]", "down [ms]", box=None)
    for t in np.linspace(0.0, end, ROWS):
        up, down = profile.delays_ms(float(t))
        table.add_row(f"{t:.2f}", f"{up + down:.3f}", f"{up:.3f}", f"{down:.3f}")
    console().print(table)
    for line in facts(profile, end):
        typer.echo(line)
    target = output or picture(f"profile_{profile.name}.png")
    plot_profile(profile, target, end)
    typer.echo(f"plot: {target}")


def _heading(profile: Profile, params: dict[str, float]) -> list[str]:
    """Name and words of the file, which are about its own numbers and not about `params`."""
    source = f"source: {profile.source}" if profile.source else ""
    if not params:
        lines = [f"{profile.name}: {profile.description}", source]
    else:
        changed = ", ".join(f"{key} = {value:g}" for key, value in params.items())
        lines = [
            f"{profile.name}: changed, {changed}",
            f"the file, of its own numbers: {profile.description}",
            source and f"their {source}",
        ]
    return [line for line in lines if line]


def _range(profile: Profile) -> tuple[float, float]:
    from slambed.link.plots import span_s

    values = profile.rtt_series_ms(np.arange(0.0, span_s(profile), 0.01))
    return float(values.min()), float(values.max())


def facts(profile: Profile, end_s: float) -> list[str]:
    """What a table of samples does not show."""
    t = np.arange(0.0, end_s, 0.01)
    rtt = profile.rtt_series_ms(t)
    lines = [f"RTT: mean {rtt.mean():.2f} ms, {rtt.min():.2f} to {rtt.max():.2f} ms"]
    crossings = int(np.count_nonzero(np.diff(rtt > CROSSING_MS)))
    if crossings:
        lines.append(f"crosses {CROSSING_MS:g} ms {crossings} times in {end_s:.0f} s")
    for name, side in (("up", profile.up), ("down", profile.down)):
        lines += [f"{name}: {text}" for text in _impairments(side)]
    for gap in profile.gaps:
        again = f", every {gap.every_s:g} s" if gap.every_s else ""
        what = "waits" if profile.gap_mode == "hold" else "is dropped"
        lines.append(f"silence of {gap.length_s:g} s at {gap.start_s:g} s{again}; traffic {what}")
    return lines


def _impairments(side: Side) -> list[str]:
    lines = []
    if side.rate is not None:
        lines.append(f"rate {side.rate.trace or f'{side.rate.mbps:g} Mbit/s'}")
    if side.jitter is not None:
        size = side.jitter.sd_ms or side.jitter.mean_ms
        lines.append(f"{side.jitter.shape} jitter {size:g} ms")
    if side.loss is not None:
        lines.append(f"loss {side.loss.mean():.3%}")
    return lines


@link_app.command()
def measure(
    name: Annotated[str, typer.Argument(help="Profile: name or YAML file.")] = "ramp",
    values: SetOption = None,
    backend: Annotated[str, typer.Option(help="relay, netem, none or auto.")] = "auto",
    seconds: Annotated[float, typer.Option(help="How long.")] = 20.0,
    seed: Annotated[int, typer.Option(help="Of losses and jitter.")] = 1,
    tcp: Annotated[bool, typer.Option(help="Also follow a TCP connection's tcpi_rtt.")] = False,
    log: Annotated[Path | None, typer.Option(help="Link log to write: .csv or .parquet.")] = None,
    output: Annotated[Path | None, typer.Option(help="PNG to write.")] = None,
) -> None:
    """Prove the link on this machine: two namespaces, a profile, asked against measured."""
    from slambed.link.bench import measure_link
    from slambed.link.plots import plot_links

    run = measure_link(_load(name, values or []), backend, seconds, seed, with_tcp=tcp)
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


@link_app.command()
def bench(
    backend: Annotated[str, typer.Option(help="relay or netem.")] = "relay",
    seconds: Annotated[float, typer.Option(help="Per profile.")] = 30.0,
    output: Annotated[Path, typer.Option(help="Folder for the table and the logs.")] = Path(
        "bench"
    ),
    flood: Annotated[int, typer.Option(help="Packets of the reordering test; 0 = none.")] = 0,
) -> None:
    """Measure a backend: delay errors of six profiles, TCP throughput, reordering."""
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


@link_app.command()
def statistics(
    seconds: Annotated[float, typer.Option(min=1.0, help="Per impairment.")] = 30.0,
    seed: Annotated[int, typer.Option(help="Of losses and jitter.")] = 1,
) -> None:
    """Are loss and jitter of real packets those asked for? Each within 3 standard errors."""
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


@link_app.command()
def messages(
    backend: Annotated[str, typer.Option(help="relay or netem.")] = "relay",
    repetitions: Annotated[int, typer.Option(min=1, help="Of each size.")] = 5,
    output: Annotated[Path, typer.Option(help="CSV to write.")] = Path("messages.csv"),
    profile: Annotated[
        str, typer.Option(help="A profile with loss, jitter, rate or cuts: steady traffic over it.")
    ] = "",
    count: Annotated[int, typer.Option(min=1, help="With --profile: messages.")] = 250,
    size: Annotated[int, typer.Option(min=64, help="With --profile: bytes of each.")] = 25_000,
    hz: Annotated[float, typer.Option(min=0.1, help="With --profile: messages a second.")] = 10.0,
    seeds: Annotated[int, typer.Option(min=1, help="With --profile: seeds 1 to this.")] = 3,
) -> None:
    """Send the same messages through a real link and through the virtual engine's model of it."""
    from slambed.link import messages as traffic

    if profile:
        steady = traffic.Trace.steady(count, size, hz)
        rows = traffic.compare_profile(load_profile(profile), steady, range(1, seeds + 1), backend)
        with writing(output):
            rows.to_csv(output, index=False, float_format="%.4f")
        typer.echo(rows.round(1).to_string(index=False))
        medians = rows.median()
        for quantile in ("50", "90", "100"):
            live, virtual = medians[f"live_{quantile}_ms"], medians[f"virtual_{quantile}_ms"]
            typer.echo(f"quantile {quantile} %: live {live:.1f} ms, virtual {virtual:.1f} ms")
        return
    profiles = [(rtt, rate) for rate in traffic.RATES_MBPS for rtt in traffic.RTTS_MS]
    table = traffic.compare(profiles, traffic.SIZES, repetitions, backend)
    with writing(output):
        table.to_csv(output, index=False, float_format="%.4f")
    typer.echo(table.round(2).to_string(index=False))
    error = table["error_percent"].abs()
    typer.echo(f"error of the model: median {error.median():.1f} %, largest {error.max():.1f} %")


@link_app.command()
def compare(
    logs: Annotated[list[Path], typer.Argument(help="Link logs: CSV of `link bench` or Parquet.")],
    output: Annotated[Path, typer.Option(help="PNG to write.")] = Path("links.png"),
) -> None:
    """Plot link logs side by side: asked, applied, measured, and the error."""
    from slambed.link.plots import plot_links

    frames = {}
    for path in logs:
        if not path.is_file():
            raise SlambedError(f"no such link log: {path}")
        read = pd.read_parquet if path.suffix == ".parquet" else pd.read_csv
        frames[path.stem.replace("_", ", ", 1)] = read(path)
    plot_links(frames, output)
    typer.echo(f"plot: {output}")
