# SPDX-License-Identifier: Apache-2.0
"""`slambed profiles`: lists and plots link profiles."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from slambed.commands.shared_options import PictureOption
from slambed.data.places import picture
from slambed.errors import SlambedError
from slambed.files.outputs import figure_file
from slambed.terminal import JsonOption, console, lists_alone, print_json

if TYPE_CHECKING:
    from slambed.link.profile import Profile

app = typer.Typer(help="Link profiles: how latency, loss and rate change.")

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


def load_changed(name: str, values: list[str]) -> Profile:
    """Returns the profile of this name or file, with changed parameters (`name=number`)."""
    from slambed.link.profile import load_profile, parse_profile

    if not values:
        return load_profile(name)
    if name.endswith((".yaml", ".yml")):
        profile = load_profile(name, _params(values))
        return replace(profile, name=f"{profile.name}[{','.join(values)}]")
    return parse_profile({"profile": name, "params": _params(values)}, "--set")


SetOption = Annotated[list[str] | None, typer.Option("--set", help="Parameter: name=number.")]


def list_profiles(as_json: JsonOption = False) -> None:
    """List every profile that has a file."""
    from slambed.link.profile import load_profile, profile_names
    from slambed.link.summary import rtt_words

    if as_json:
        print_json([_entry(name) for name in profile_names()])
        return
    table = Table("profile", "RTT [ms]", "length [s]", "description", box=None)
    for name in profile_names():
        try:
            profile = load_profile(name)
        except SlambedError as error:
            table.add_row(name, "-", "-", f"not usable here: {error}")
            continue
        length = "for ever" if not profile.duration else f"{profile.duration:g}"
        table.add_row(name, rtt_words(profile), length, profile.description)
    screen = console()
    screen.print(table)
    screen.print("values over time, with a picture: 'slambed profiles show NAME'")


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="Name in netem_profiles/, or path of a YAML file.")],
    values: SetOption = None,
    output: PictureOption = None,
    until_s: Annotated[float | None, typer.Option(help="Seconds to show.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Print a profile's values over time and plot them."""
    import numpy as np

    from slambed.link.plots import plot_profile, span_s
    from slambed.link.summary import length_s

    if until_s is not None and not LEAST_SHOWN_S <= until_s <= MOST_SHOWN_S:
        raise SlambedError(
            f"--until-s {until_s:g} is not between {LEAST_SHOWN_S:g} and {MOST_SHOWN_S:g}"
        )
    asked = figure_file(output) if output else None
    profile = load_changed(name, values or [])
    if as_json:
        print_json(_facts(profile))
        return
    for line in _heading(profile, _params(values or [])):
        typer.echo(line)
    end = span_s(profile) if until_s is None else until_s
    table = Table("time [s]", "RTT [ms]", "up [ms]", "down [ms]", box=None)
    for t in np.linspace(0.0, end, ROWS):
        up, down = profile.delays_ms(float(t))
        table.add_row(f"{t:.2f}", f"{up + down:.3f}", f"{up:.3f}", f"{down:.3f}")
    console().print(table)
    for line in facts(profile, length_s(profile) if until_s is None else until_s):
        typer.echo(line)
    for line in profile.remarks:
        typer.echo(f"note: {line}")
    target = asked or picture(f"profile_{profile.name}.png")
    plot_profile(profile, target, end)
    typer.echo(f"plot: {target}")


def _entry(name: str) -> dict[str, object]:
    from slambed.link.profile import load_profile

    try:
        return _facts(load_profile(name))
    except SlambedError as error:
        return {"name": name, "error": str(error)}


def _facts(profile: Profile) -> dict[str, object]:
    """Returns the profile's content and derived values, for scripts."""
    from slambed.link.summary import rtt_range_ms

    return {
        "name": profile.name, "description": profile.description, "source": profile.source,
        "duration_s": profile.duration, "rtt_range_ms": rtt_range_ms(profile),
        "up": profile.up.model_dump(mode="json"), "down": profile.down.model_dump(mode="json"),
        "definition": dict(profile.content),
    }  # fmt: skip


def _heading(profile: Profile, params: dict[str, float]) -> list[str]:
    """Returns name and description of the file; these refer to its own numbers and not to
    `params`."""
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


def facts(profile: Profile, end_s: float) -> list[str]:
    """Returns what a table of samples does not show: range, impairments and gaps."""
    import numpy as np

    from slambed.link.summary import impairments, outages, recorded_rate, summary_times

    rtt = profile.rtt_series_ms(summary_times(end_s))
    # Each value stands for the step after it, so the one at the end is not part of the mean.
    lines = [f"RTT: mean {rtt[:-1].mean():.2f} ms, {rtt.min():.2f} to {rtt.max():.2f} ms"]
    crossings = int(np.count_nonzero(np.diff(rtt > CROSSING_MS)))
    if crossings:
        lines.append(f"crosses {CROSSING_MS:g} ms {crossings} times in {end_s:.0f} s")
    for name, side in (("up", profile.up), ("down", profile.down)):
        rate = recorded_rate(side, profile.rate_traces)
        lines += [f"{name}: {text}" for text in [*impairments(side), rate] if text]
    losses = [side.loss.mean() for side in (profile.up, profile.down) if side.loss is not None]
    if len(losses) == 2:
        either = 1 - (1 - losses[0]) * (1 - losses[1])
        lines.append(f"loss of round trips: {either:.3%}, as each direction loses packets")
    return lines + outages(profile)


lists_alone(app, list_profiles)
