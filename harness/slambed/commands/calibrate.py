# SPDX-License-Identifier: Apache-2.0
"""`slambed calibrate`."""

from pathlib import Path
from typing import Annotated

import typer

from slambed.errors import SlambedError

LIMITS_S = 10.0


def calibrate(
    stages: Annotated[
        list[Path] | None,
        typer.Option("--stages", help="Live runs to fit to: run or result folders; repeatable."),
    ] = None,
    match: Annotated[
        str | None,
        typer.Option(
            "--match", help="Name in catalog/devices/fits/: scale devices to a paper's times."
        ),
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="With --match: show what the devices give as they are."),
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Device file that gets the model of --stages."),
    ] = None,
    cores: Annotated[
        int | None, typer.Option(min=1, help="Cores of the device; this host's if not given.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Virtual runs of --match at a time.")
    ] = None,
    host: Annotated[
        bool, typer.Option("--host", help="Measure how fast this host is, and keep it.")
    ] = False,
    limits: Annotated[
        str | None,
        typer.Option("--limits", help="Device: what do busy threads get under its limits here?"),
    ] = None,
    engine: Annotated[
        str | None,
        typer.Option(help="docker or local, for --limits; if not given, those usable here."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=1.0, help="Per measurement of --limits; 10 s if not given."),
    ] = None,
) -> None:
    """Measure the speed of this host, and fit the costs of a device.

    --host measures the speed of a core with fixed work and stores it. From then on it sets the
    limits of devices with a board (cores, core_speed). --limits shows what one and four busy
    threads get under a device's limits, and a thread's longest freeze.

    --stages fits a device's cost model (a + b*n1 + c*n2 per stage) to live runs of this host and
    shows the residuals; -o writes it to a device file. --match scales the model until virtual runs
    show the component times that a paper prints, and writes the devices of that fit. With --check
    it writes nothing and shows how well they fit.
    """
    from slambed.calibrate.actions import calibrate_host, check_limits, fit_host, match_paper

    asked = [stages is not None, match is not None, host, limits is not None]
    if sum(asked) != 1:
        raise SlambedError("give one of --host, --limits DEVICE, --stages RUNS, --match FIT")
    for option, given, goes_with, there in (
        ("--check", check, "--match FIT", match is not None),
        ("--jobs", jobs is not None, "--match FIT", match is not None),
        ("--output", output is not None, "--stages RUNS", stages is not None),
        ("--cores", cores is not None, "--stages RUNS", stages is not None),
        ("--engine", engine is not None, "--limits DEVICE", limits is not None),
        ("--seconds", seconds is not None, "--limits DEVICE", limits is not None),
    ):
        if given and not there:
            raise SlambedError(f"{option} goes with {goes_with}")
    if host:
        calibrate_host()
    elif limits is not None:
        check_limits(limits, engine, LIMITS_S if seconds is None else seconds)
    elif match is not None:
        match_paper(match, jobs, check)
    else:
        fit_host(stages or [], output, cores)
