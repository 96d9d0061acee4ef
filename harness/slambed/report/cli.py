# SPDX-License-Identifier: Apache-2.0
"""Commands about results: report, losses, plots, compare, truth, paper, gate, bisect, view,
evaluate, diff.

The main command mounts them with `add_commands`.
"""

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

import typer

from slambed.campaign.runner import Verdict
from slambed.errors import ExitCode, SlambedError
from slambed.outputs import PICTURES, make_folder, writing
from slambed.report.bisect_cli import bisect
from slambed.terminal import console

ResultsOption = Annotated[Path, typer.Option("--results", help="Folder of all results.")]
RESULTS = Path("results")

app = typer.Typer(help="Reports, comparisons and gates.", no_args_is_help=True)


def add_commands(main: typer.Typer) -> None:
    """Adds the commands of this module to the main command."""
    for command in (report, losses, plots, compare, truth, paper, gate, bisect, view, evaluate):
        main.command()(command)
    main.command("diff")(diff_command)


def experiment_folder(results: Path, experiment: str) -> Path:
    """`results/<name>` for a name, a YAML file or the folder itself."""
    given = Path(experiment)
    if (given / "runs").is_dir():
        return given
    folder = results / given.stem
    if not folder.is_dir():
        raise SlambedError(f"no results in {folder}; start with 'slambed run {experiment}'")
    return folder


@app.command()
def report(
    experiment: Annotated[str, typer.Argument(help="Experiment, or its results folder.")],
    results: ResultsOption = RESULTS,
    figures: Annotated[bool, typer.Option(help="Draw figures too.")] = True,
    again: Annotated[
        bool, typer.Option("--again", help="Compute every number again from the stored events.")
    ] = False,
) -> None:
    """Write tables, figures and the page of an experiment again from its runs.

    With --again the numbers too: after a change of a metric, or of a dataset's ground truth.
    """
    from slambed.report.experiment import Told, terminal_summary, write_report
    from slambed.report.load import load

    folder = experiment_folder(results, experiment)
    if again:
        from slambed.report.again import recompute

        with writing(folder, "--results"):
            for line in recompute(folder).lines():
                typer.echo(line)
    told = Told.of(load(folder))
    write_report(folder, figures=figures, told=told)
    terminal_summary(folder, console(), told)


@app.command()
def losses(
    experiment: Annotated[str, typer.Argument(help="Experiment, or its results folder.")],
    results: ResultsOption = RESULTS,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Every loss, one a row: .csv or .md.")
    ] = None,
) -> None:
    """Sort the losses of an experiment by cause: the first of each run, and all of them.

    relocalisation failed: found again less than a second before; standstill: frames are missing
    right before it; gap behind an update: an update took newer keyframes away at most half a
    second before; view change: none of these.
    """
    from slambed.report.load import load
    from slambed.report.losses import all_by_cause, by_cause, every_loss, lost_runs

    if output is not None and output.suffix not in (".csv", ".md"):
        raise SlambedError(f"unknown table format {output}; known: .csv, .md")
    found = load(experiment_folder(results, experiment))
    runs = lost_runs(found)
    if not runs:
        raise SlambedError(f"no run of {experiment} counts; 'slambed status {experiment}' says why")
    for table in (by_cause(runs), all_by_cause(runs)):
        console().print(table.rich())
    typer.echo("'slambed explain RUN --around loss' shows the first of a run")
    for problem in found.problems:
        typer.echo(f"note: {problem}")
    if output is not None:
        table = every_loss(runs)
        with writing(output):
            output.write_text(table.markdown() if output.suffix == ".md" else table.csv())
        typer.echo(f"every loss: {output}")


@app.command()
def plots(
    experiment: Annotated[str, typer.Argument(help="Experiment, or 'all'.")] = "all",
    results: ResultsOption = RESULTS,
    every: Annotated[bool, typer.Option("--all", help="Every figure, however long.")] = False,
) -> None:
    """Draw figures and reports again without running anything."""
    from slambed.report.experiment import write_report
    from slambed.report.plots import TIME_FOR_FIGURES_S

    folders = _folders(results) if experiment == "all" else [experiment_folder(results, experiment)]
    if not folders:
        raise SlambedError(f"no results in {results}; start with 'slambed run quickstart'")
    for folder in folders:
        paths = write_report(folder, limit_s=None if every else TIME_FOR_FIGURES_S)
        typer.echo(f"{paths.html}")


@app.command()
def compare(
    papers: Annotated[
        list[str] | None, typer.Argument(help="Names in papers/; all if none.")
    ] = None,
    results: ResultsOption = RESULTS,
    out: Annotated[Path | None, typer.Option(help="Where pages go: <results>/papers.")] = None,
    every: Annotated[bool, typer.Option("--all", help="List every number here too.")] = False,
) -> None:
    """Put every published number beside ours, and write one page per paper."""
    _write_pages(papers or None, results, out or results / "papers", every)


@app.command()
def truth(
    live: Annotated[Path, typer.Argument(help="Results folder of live runs.")],
    virtual: Annotated[Path, typer.Argument(help="The same experiment with --engine virtual.")],
    output: Annotated[Path | None, typer.Option("-o", help="Table to write: .csv or .md.")] = None,
) -> None:
    """Put virtual runs beside live runs of the same cells: how far the model is from the truth."""
    from slambed.report.load import load
    from slambed.report.truth import truth_table

    table = truth_table(load(live), load(virtual))
    console().print(table.rich())
    if output is not None:
        with writing(output):
            output.write_text(table.markdown() if output.suffix == ".md" else table.csv())
        typer.echo(f"table: {output}")


@app.command("diff")
def diff_command(
    a: Annotated[Path, typer.Argument(help="Results folder, the one before.")],
    b: Annotated[Path, typer.Argument(help="Results folder, the one after.")],
    metrics: Annotated[
        list[str] | None, typer.Option("--metric", help="Only this; else the experiment's.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Table to write: .csv or .md.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Page to write, one file.")] = None,
) -> None:
    """Compare two results folders: other commits, engines, hosts or systems.

    Ends with 1 where a change was shown.
    """
    from slambed.report.diff import diff, diff_table
    from slambed.report.load import load

    if output is not None and output.suffix not in (".csv", ".md"):
        raise SlambedError(f"unknown table format {output}; known: .csv, .md")
    before, after = load(a), load(b)
    found = diff(before, after, metrics)
    table = diff_table(found, str(a), str(b))
    console().print(table.rich())
    if output is not None:
        with writing(output):
            output.write_text(table.markdown() if output.suffix == ".md" else table.csv())
        typer.echo(f"table: {output}")
    if html is not None:
        from slambed.report.diff_page import write_diff_page

        write_diff_page(found, before, after, html)
        typer.echo(f"page: {html}")
    shown = sum(change.shown for change in found)
    typer.echo(f"{shown} of {len(found)} comparisons show a change")
    if shown:
        raise typer.Exit(ExitCode.NOT_ALL_GOOD)


@app.command()
def paper(
    name: Annotated[str, typer.Argument(help="A name in papers/, or 'all'.")] = "all",
    results: ResultsOption = RESULTS,
    runs: Annotated[str | None, typer.Option(help="Runs per cell: a number, 'paper'.")] = None,
    engine: Annotated[str | None, typer.Option(help="docker, local, virtual or auto.")] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Virtual runs at a time; all CPUs if not given.")
    ] = None,
    reuse_only: Annotated[bool, typer.Option("--reuse-only", help="Run nothing.")] = False,
) -> None:
    """Run or reuse every experiment of a paper and write one page about it."""
    from slambed.report.papers import read_papers
    from slambed.report.run import raise_unless_good

    chosen = read_papers(None if name == "all" else [name])
    verdicts: list[Verdict] = []
    if not reuse_only:
        from slambed.campaign.run import Options
        from slambed.report.paper_runs import experiments_of
        from slambed.report.run import run_and_report

        for experiment in experiments_of(chosen):
            options = Options(runs, engine, results, jobs=jobs)
            verdicts.append(run_and_report(experiment, options, console()))
            if verdicts[-1].interrupted:
                raise SlambedError(
                    "interrupted; finished runs are kept, the same command goes on",
                    ExitCode.NOT_ALL_GOOD,
                )
    _write_pages([p.id for p in chosen], results, results / "papers", False)
    raise_unless_good(verdicts, "EXPERIMENT")


def _write_pages(names: list[str] | None, results: Path, out: Path, every: bool) -> None:
    from slambed.report.compare import comparison_table
    from slambed.report.load import load
    from slambed.report.paper_page import write_overview, write_paper_page
    from slambed.report.papers import read_papers

    papers = read_papers(names)
    if not results.is_dir():
        raise SlambedError(f"no such folder: {results}; give the right --results")
    make_folder(out, "--results" if out == results / "papers" else "--out")
    screen = console()
    experiments = [load(folder) for folder in _folders(results)]
    pages = []
    for item in papers:
        page = write_paper_page(item, experiments, out, overview=len(papers) > 1)
        for line in page.lines:
            screen.print(line, highlight=False, soft_wrap=True)
        verdicts = page.verdicts
        for column in verdicts.columns if verdicts is not None and every else []:
            assert verdicts is not None
            screen.print(comparison_table(verdicts, column, list(column.rows)).rich())
        screen.print(f"page: {page.html}", highlight=False, soft_wrap=True)
        pages += [verdicts] if verdicts is not None else []
    if len(pages) > 1:
        overview = write_overview(pages, experiments, out)
        screen.print(f"all papers: {overview}", highlight=False, soft_wrap=True)


def _folders(results: Path) -> list[Path]:
    return sorted(path.parent for path in results.glob("*/runs") if path.is_dir())


@app.command()
def gate(
    experiments: Annotated[list[str], typer.Argument(help="Experiments of tonight.")],
    baseline: Annotated[
        Path | None, typer.Option(help="Results folder, history (.parquet) or .csv.")
    ] = None,
    results: ResultsOption = RESULTS,
    alpha: Annotated[float, typer.Option(help="Chance of a false alarm in a night.")] = 0.05,
    history: Annotated[Path | None, typer.Option(help="Append tonight's runs here.")] = None,
    first_night: Annotated[
        bool,
        typer.Option("--first-night", help="No baseline yet: only look for runs to be trusted."),
    ] = False,
) -> None:
    """Fail when tonight is significantly and relevantly worse, or when nothing was measured."""
    from slambed.report.gate import append_history, judge, read_runs

    if baseline is None and not first_night:
        raise SlambedError("nothing to compare with, no --baseline: give one or --first-night")
    screen = console()
    reasons = 0
    for name in experiments:
        tonight, problems = read_runs(results, Path(name).stem)
        before = tonight if baseline is None else read_runs(baseline, Path(name).stem)[0]
        found = judge(before, tonight, alpha / len(experiments))
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
            append_history(history, tonight, night, found.passed)
    if reasons:
        raise SlambedError(f"gate closed: {reasons} reasons above", ExitCode.NOT_ALL_GOOD)


@app.command()
def view(
    run: Annotated[str, typer.Argument(help="Run key (or its beginning), or a run folder.")],
    results: ResultsOption = RESULTS,
    out: Annotated[Path, typer.Option(help="Folder for the files.")] = PICTURES,
    rerun: Annotated[bool, typer.Option("--rerun", help="Write a Rerun recording too.")] = False,
    sequence: Annotated[Path | None, typer.Option(help="Prepared sequence, for images.")] = None,
) -> None:
    """Look inside a run: its path over the true one as PNG, a Rerun recording where installed."""
    from slambed.campaign.find_run import find_run
    from slambed.report.view import view_of, write_png, write_rerun

    found = view_of(find_run(run, results))
    make_folder(out, "--out")
    typer.echo(f"{write_png(found, out)}")
    if rerun:
        typer.echo(f"{write_rerun(found, out / f'{found.run_key}.rrd', sequence)}")


@app.command()
def evaluate(
    estimate: Annotated[Path, typer.Argument(help="Trajectory in TUM format.")],
    truth: Annotated[Path, typer.Argument(help="Ground truth in TUM format.")],
    association: Annotated[str, typer.Option(help="nearest (as evo) or tum.")] = "nearest",
    max_difference_s: Annotated[float, typer.Option(help="Of two time stamps.")] = 0.02,
    with_scale: Annotated[bool, typer.Option("--with-scale", help="Sim(3); is marked.")] = False,
) -> None:
    """ATE and RPE of two trajectory files."""
    from slambed.data.trajectory import read_tum
    from slambed.metrics.accuracy import absolute_error, relative_error

    if association not in ("nearest", "tum"):
        raise SlambedError(f"unknown association '{association}'; known: nearest, tum")
    method: Literal["nearest", "tum"] = "tum" if association == "tum" else "nearest"
    own, true = read_tum(estimate), read_tum(truth)
    ate = absolute_error(own, true, max_difference_s, method, with_scale)
    typer.echo(
        f"ATE RMSE {ate.rmse:.6f} m ({ate.alignment}, {ate.pairs} pairs, mean {ate.mean:.6f}, "
        f"median {ate.median:.6f}, max {ate.maximum:.6f})"
    )
    rpe = relative_error(own, true, 1.0, max_difference_s=max_difference_s, method=method)
    typer.echo(
        f"RPE RMSE over {rpe.delta}: {rpe.translation_m.rmse:.6f} m, "
        f"{rpe.rotation_deg.rmse:.6f} deg ({rpe.translation_m.pairs} pairs)"
    )
