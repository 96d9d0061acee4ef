# SPDX-License-Identifier: Apache-2.0
"""Commands about results: report, diff, gate; evaluate about two files of poses."""

import os
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from slambed.caller import will_be_callers
from slambed.commands.results_folders import experiment_folder, result_folders
from slambed.errors import ExitCode, SlambedError
from slambed.files.outputs import make_folder, writing
from slambed.spec.experiment_name import name_of
from slambed.spec.selection import SYNTAX
from slambed.terminal import RESULTS, JsonOption, ResultsOption, console, print_json

if TYPE_CHECKING:
    from slambed.report.tables import Table


def report(
    experiment: Annotated[
        str, typer.Argument(help="Experiment, or its results folder; 'all' of --results.")
    ] = "all",
    results: ResultsOption = RESULTS,
    figures: Annotated[bool, typer.Option(help="Draw figures too.")] = True,
    every: Annotated[bool, typer.Option("--all", help="Every figure, however long.")] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Compute every number again from the stored events.")
    ] = False,
    losses: Annotated[
        bool, typer.Option("--losses", help="Only show why track was lost; write no report.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Where to write the report, if not beside the runs. "
            "--losses: table to write, one loss per row (.csv or .md).",
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="--losses: one JSON document instead, for a script.")
    ] = False,
) -> None:
    """Rewrite tables, figures and the page of an experiment from its runs.

    --again also recomputes the numbers, for example after a change of a metric or of a ground
    truth. --losses sorts track losses by cause. The first cause that matches
    applies. lost again: tracking had resumed less than a second before;
    standstill: frames are missing right before the loss; gap behind an
    update: a map update removed newer keyframes at most half a second before; view change: none of
    these.
    """
    if output is not None and again:
        raise SlambedError("--again writes into the runs; leave out --output")
    if as_json and not losses:
        raise SlambedError("--json goes with --losses; a report's numbers are in its summary.csv")
    folders = (
        result_folders(results) if experiment == "all" else [experiment_folder(results, experiment)]
    )
    if not folders:
        raise SlambedError(f"no results in {results}; start with 'slambed run quickstart'")
    if losses:
        if experiment == "all":
            raise SlambedError("--losses is about one experiment; name it")
        if again or every or not figures:
            raise SlambedError(
                "--losses writes no report; leave out --again, --all and --no-figures"
            )
        from slambed.commands.report_losses import show_losses

        show_losses(folders[0], experiment, output, as_json)
        return
    for folder in folders:
        place = folder if output is None else output / (folder.name if len(folders) > 1 else "")
        _report(folder, place, figures, every, again, quiet=len(folders) > 1)


def _report(
    folder: Path, place: Path, figures: bool, every: bool, again: bool, quiet: bool
) -> None:
    """Writes the report of one experiment into `place`; with `quiet` it prints only the page's
    path."""
    from slambed.papers.experiment_tables import comparisons_for
    from slambed.report.experiment import ReportSummary, terminal_summary, write_report
    from slambed.report.load import load
    from slambed.report.plots import TIME_FOR_FIGURES_S

    if again:
        from slambed.report.recompute import recompute

        with writing(folder, "--results"):
            for line in recompute(folder).lines():
                typer.echo(line)
    found = load(folder)
    summary = ReportSummary.of(found, comparisons_for(found))
    limit_s = None if every else TIME_FOR_FIGURES_S
    if place != folder:
        make_folder(place, "--output")
    elif not os.access(place, os.W_OK):
        line = f"{place} is not ours to write to; give a folder of your own: --output FOLDER"
        raise SlambedError(line, ExitCode.ENVIRONMENT)
    will_be_callers(place)
    paths = write_report(folder, figures=figures, limit_s=limit_s, summary=summary, place=place)
    if quiet:
        typer.echo(f"{paths.html}")
    else:
        terminal_summary(folder, console(), summary, place)


def diff_command(
    a: Annotated[Path, typer.Argument(help="Results folder, the one before.")],
    b: Annotated[
        Path | None,
        typer.Argument(help="Results folder, the one after; none: --a and --b are parts of A."),
    ] = None,
    of_a: Annotated[
        list[str] | None, typer.Option("--a", help=f"Side A is only this: {SYNTAX}.")
    ] = None,
    of_b: Annotated[
        list[str] | None, typer.Option("--b", help="Side B is only this; as for --a.")
    ] = None,
    metrics: Annotated[
        list[str] | None, typer.Option("--metric", help="Only this; else the experiment's.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Table to write: .csv or .md.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Page to write, one file.")] = None,
    truth: Annotated[
        bool,
        typer.Option(
            "--truth",
            help="How far virtual runs are from live ones: A is live, B virtual, or A holds both.",
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Compare two results folders, or two systems, links, devices, ... of one.

    slambed diff FOLDER --a system=edgeslam --b system=orbslam2

    Cells are matched by everything that --a and --b do not select. Exits with 1 when a change was
    shown.
    """
    from slambed.regression.diff import (
        diff,
        diff_json,
        diff_table,
        left_out_lines,
        not_compared,
        write_diff,
    )
    from slambed.regression.diff_sides import Sides
    from slambed.report.load import load
    from slambed.report.tables import check_format

    if output is not None:
        check_format(output)
    before = load(a)
    after = None if b is None else load(b)
    if truth:
        if metrics or html is not None or as_json:
            raise SlambedError(
                "--truth is one table of its own; leave out --metric, --html and --json"
            )
        from slambed.report.truth import truth_table

        if of_a or of_b:
            raise SlambedError("--truth takes whole folders; leave out --a and --b")
        _show_table(truth_table(before, after or before), output)
        return
    sides = Sides.of(before, after, of_a or (), of_b or ())
    found = diff(sides, metrics)
    left_out = not_compared(found, sides, metrics)
    table = diff_table(found, sides)
    if as_json:
        print_json(diff_json(found, sides, left_out))
    else:
        console().print(table.rich())
    if output is not None:
        write_diff(table, sides, output)
        typer.echo(f"table: {output}", err=as_json)
    if html is not None:
        from slambed.regression.diff_page import write_diff_page

        write_diff_page(found, sides, html, left_out)
        typer.echo(f"page: {html}", err=as_json)
    shown = sum(change.shown for change in found)
    if not as_json:
        typer.echo(f"{shown} of {len(found)} comparisons show a change")
        for line in left_out_lines(left_out):
            typer.echo(line)
        if metrics is None:
            typer.echo("compared: the metrics of the experiment's report; others: --metric NAME")
    if shown:
        raise typer.Exit(ExitCode.NOT_ALL_GOOD)


def _show_table(table: "Table", output: Path | None) -> None:
    from slambed.report.tables import write_table

    console().print(table.rich())
    if output is not None:
        write_table(table, output)
        typer.echo(f"table: {output}")


def gate(
    experiments: Annotated[
        list[str] | None,
        typer.Argument(help="Experiments of tonight; without one, --publish shows the history."),
    ] = None,
    baseline: Annotated[
        Path | None, typer.Option(help="Results folder, history (.parquet) or .csv.")
    ] = None,
    results: ResultsOption = RESULTS,
    alpha: Annotated[
        float, typer.Option(min=1e-6, max=0.5, help="Chance of a false alarm in a night.")
    ] = 0.05,
    history: Annotated[
        Path | None, typer.Option(help="Parquet file to append tonight's runs to.")
    ] = None,
    first_night: Annotated[
        bool,
        typer.Option("--first-night", help="No baseline yet: only look for valid runs."),
    ] = False,
    publish: Annotated[
        Path | None, typer.Option(help="Write the history as a page over commits there.")
    ] = None,
    link_to: Annotated[
        str, typer.Option("--link-to", help="Address to which that page appends a commit's hash.")
    ] = "",
) -> None:
    """Exit with 1 when tonight's runs are significantly and relevantly worse, or when nothing was
    measured.

    --publish FOLDER also plots every metric over the commits of --history and marks the changes.
    """
    from slambed.campaign.manifest import git_state
    from slambed.regression.gate import append_history, judge, read_runs

    if publish is not None and history is None:
        raise SlambedError("--publish shows what --history has; give both")
    if not experiments and publish is None:
        raise SlambedError("name tonight's experiments, or --publish what a history has")
    if experiments and baseline is None and not first_night:
        raise SlambedError("nothing to compare with, no --baseline: give one or --first-night")
    screen = console()
    reasons = 0
    for name in experiments or []:
        tonight, problems = read_runs(results, name_of(name))
        before = tonight if baseline is None else read_runs(baseline, name_of(name))[0]
        found = judge(before, tonight, alpha / len(experiments or []))
        screen.print(f"{name}: {len(found.findings)} comparisons, {len(found.failures)} failures")
        if any(f.alarm or f.relevant for f in found.findings):
            screen.print(found.table().rich())
        for line in [*problems, *found.notes]:
            screen.print(f"note: {line}", highlight=False, markup=False, soft_wrap=True)
        for line in found.failures:
            screen.print(f"FAIL: {line}", highlight=False, markup=False, soft_wrap=True)
        reasons += len(found.failures)
        if history is not None and len(tonight):
            night = datetime.now(UTC).strftime("%Y-%m-%d")
            append_history(history, tonight, night, found.passed, git_state()[0] or "")
    if publish is not None and history is not None:
        from slambed.regression.trend_page import publish as write_page
        from slambed.regression.trends import read_history

        screen.print(
            f"page: {write_page(read_history(history), publish, link_to)}",
            highlight=False,
            soft_wrap=True,
        )
    if reasons:
        raise SlambedError(
            f"regression gate closed: {reasons} reasons above", ExitCode.NOT_ALL_GOOD
        )


def evaluate(
    estimate: Annotated[Path, typer.Argument(help="Trajectory: TUM, KITTI, or a ROS bag.")],
    truth: Annotated[Path, typer.Argument(help="Ground truth: TUM, KITTI, or a ROS bag.")],
    association: Annotated[str, typer.Option(help="nearest (as evo) or tum.")] = "nearest",
    max_difference_s: Annotated[
        float, typer.Option(min=0, help="Largest difference of two associated time stamps.")
    ] = 0.02,
    with_scale: Annotated[
        bool, typer.Option("--with-scale", help="Align with scale, Sim(3); the output names it.")
    ] = False,
    delta_s: Annotated[float, typer.Option(help="RPE: seconds between the poses of a pair.")] = 1.0,
    times: Annotated[
        Path | None, typer.Option(help="Times of KITTI's poses, one per line, in seconds.")
    ] = None,
    topic: Annotated[str | None, typer.Option(help="Topic of the estimate in a bag.")] = None,
    truth_topic: Annotated[
        str | None, typer.Option(help="Topic of the ground truth in a bag.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Compute ATE and RPE of a trajectory file against ground truth."""
    from slambed.data.path_file import check_comparable, read_path
    from slambed.metrics.accuracy import absolute_error, relative_error
    from slambed.metrics.kitti_error import kitti_error

    if not delta_s > 0:
        raise SlambedError(f"--delta-s {delta_s:g}: expected a time above 0 s")
    if association not in ("nearest", "tum"):
        raise SlambedError(f"unknown association '{association}'; known: nearest, tum")
    method: Literal["nearest", "tum"] = "tum" if association == "tum" else "nearest"
    own_file = read_path(estimate, topic=topic, times=times)
    true_file = read_path(truth, topic=truth_topic, times=times)
    if times is not None and "kitti" not in (own_file.kind, true_file.kind):
        raise SlambedError(
            f"--times is for KITTI's poses, which neither {estimate} nor {truth} has"
        )
    own, true = own_file.trajectory, true_file.trajectory
    rpe = per_length = None
    try:
        check_comparable(own_file, true_file)
        for note in (*own_file.notes, *true_file.notes):
            typer.echo(f"note: {note}", err=True)
        ate = absolute_error(own, true, max_difference_s, method, with_scale)
        own = own.scaled(ate.scale)  # 1 without --with-scale: the path that the ATE is of
        if own.has_orientation and true.has_orientation:
            rpe = relative_error(
                own, true, delta_s, max_difference_s=max_difference_s, method=method
            )
        if own_file.kind == true_file.kind == "kitti":
            per_length = kitti_error(own, true)
    except SlambedError as error:
        raise SlambedError(f"{estimate} against {truth}: {error}", error.code) from None
    if as_json:
        found = {"ate_m": asdict(ate), "rpe": asdict(rpe) if rpe is not None else None}
        print_json(found | ({"kitti": asdict(per_length)} if per_length is not None else {}))
        return
    typer.echo(
        f"ATE RMSE {ate.rmse:.6f} m ({ate.alignment}, {ate.pairs} pairs, mean {ate.mean:.6f}, "
        f"median {ate.median:.6f}, max {ate.maximum:.6f})"
    )
    if rpe is not None:
        typer.echo(
            f"RPE RMSE over {rpe.delta}: {rpe.translation_m.rmse:.6f} m, "
            f"{rpe.rotation_deg.rmse:.6f} deg ({rpe.translation_m.pairs} pairs)"
        )
    if per_length is not None:
        lengths = "10 to 80" if per_length.short else "100 to 800"
        typer.echo(
            f"KITTI's errors over {lengths} m: {per_length.translation_percent:.4f} %, "
            f"{per_length.rotation_deg_per_m:.6f} deg/m"
        )
