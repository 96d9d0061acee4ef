# SPDX-License-Identifier: Apache-2.0
"""Commands about published numbers: papers compare, kept, run, list, counts, lint, plan, power,
rates."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer.core import TyperGroup

from slambed.commands.shared_options import (
    ClusterJobsOption,
    EngineOption,
    SchedulerOption,
    SlurmOption,
    check_cluster,
    check_engine,
    interrupted,
)
from slambed.errors import ExitCode, SlambedError
from slambed.terminal import RESULTS, JsonOption, ResultsOption, print_json

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from slambed.papers.published import Paper
    from slambed.report.load import Results

PAGES = "papers"
COMPARE = "slambed papers compare"
KEPT = "slambed papers kept"
ABOUT = "Published numbers beside ours; alone it is `papers compare` of all."
app = typer.Typer(help=ABOUT)
PaperNames = Annotated[list[str] | None, typer.Argument(help="Names in papers/; all if none.")]


@app.callback(invoke_without_command=True)
def papers(context: typer.Context, results: ResultsOption = RESULTS) -> None:
    if context.invoked_subcommand is None:
        write_pages(None, results, results / PAGES, every=False)
    elif results != RESULTS:
        verb = context.invoked_subcommand
        group = context.command
        command = group.get_command(context, verb) if isinstance(group, TyperGroup) else None
        takes = {parameter.name for parameter in command.params} if command is not None else set()
        for option in ("results", "out"):
            if option in takes:
                line = f"give --{option} after the command: slambed papers {verb} --{option} ..."
                raise SlambedError(line)
        raise SlambedError(f"slambed papers {verb} reads no results: leave --results out")


@app.command()
def compare(
    names: PaperNames = None,
    results: ResultsOption = RESULTS,
    out: Annotated[Path | None, typer.Option(help="Where pages go: <results>/papers.")] = None,
    every: Annotated[bool, typer.Option("--all", help="List every number here too.")] = False,
) -> None:
    """Compare every published number with ours, and write one page per paper."""
    write_pages(names or None, results, out or results / PAGES, every)


@app.command()
def kept(
    names: PaperNames = None,
    out: Annotated[Path, typer.Option(help="Where the pages and the extracted runs go.")] = RESULTS
    / PAGES
    / "kept",
) -> None:
    """Write the pages of the packed runs, papers/NAME/runs.tar.xz, without running anything.

    Without a name also the comparison of all systems on the same sequences, papers/all_systems.
    """
    from slambed.files.outputs import make_folder
    from slambed.papers.kept import ALL_SYSTEMS_FOLDER, KEPT_FILE, kept_file, read_kept
    from slambed.papers.published import read_papers

    chosen = [paper for paper in read_papers(names or None) if paper.kind == "paper"]
    if not chosen:
        raise SlambedError(f"{', '.join(names or [])}: no paper, so no runs are kept")
    make_folder(out, "--out")
    runs = {
        paper.id: read_kept(archive, out / "runs" / paper.id)
        for paper in chosen
        if (archive := kept_file(paper.id)) is not None
    }
    compared = kept_file(ALL_SYSTEMS_FOLDER) if not names else None
    write_all(
        chosen,
        lambda paper: runs.get(paper, []),
        out,
        every=False,
        made_by=KEPT,
        besides=(
            [] if compared is None else read_kept(compared, out / "runs" / ALL_SYSTEMS_FOLDER)
        ),
    )
    for paper in chosen:
        if paper.id not in runs:
            typer.echo(
                f"{paper.id}: no runs are kept here, papers/{paper.id}/{KEPT_FILE} is missing; the "
                "repository of slambed has it, an installed wheel has not"
            )


@app.command()
def run(
    name: Annotated[str, typer.Argument(help="A name in papers/, or 'all'.")] = "all",
    results: ResultsOption = RESULTS,
    runs: Annotated[
        str | None,
        typer.Option(
            help="Runs per combination: a number, 'paper', or 'plan' (papers/NAME/plan.yaml)."
        ),
    ] = None,
    engine: EngineOption = None,
    jobs: ClusterJobsOption = None,
    budget: Annotated[
        str | None, typer.Option(help="Start no run after this time: 2h, 90min, 1h30min.")
    ] = None,
    part: Annotated[
        str | None, typer.Option(help="Only part I/N of the runs, with N machines at work.")
    ] = None,
    scheduler: SchedulerOption = None,
    slurm: SlurmOption = False,
    reuse_only: Annotated[
        bool, typer.Option("--reuse-only", help="Only write the page, from runs that are there.")
    ] = False,
) -> None:
    """Run or reuse every experiment of a paper, main claims first, and write one page about it."""
    from slambed.campaign.options import Options
    from slambed.campaign.order import part_of
    from slambed.campaign.overall import budget_s
    from slambed.papers.published import read_papers

    check_engine(engine)
    check_cluster(scheduler, slurm)
    if reuse_only:
        given = {
            "--runs": runs,
            "--engine": engine,
            "--jobs": jobs,
            "--budget": budget,
            "--part": part,
            "--scheduler": scheduler,
            "--slurm": slurm or None,
        }
        if ignored := [option for option, value in given.items() if value is not None]:
            raise SlambedError(f"--reuse-only executes nothing; leave out {', '.join(ignored)}")
    chosen = read_papers(None if name == "all" else [name])
    pages = [paper.id for paper in chosen]
    seconds = None if budget is None else budget_s(budget)
    share = None if part is None else part_of(part)
    if reuse_only:
        write_pages(pages, results, results / PAGES, every=False)
        return
    from slambed.commands.papers_run import play, raise_unless_done
    from slambed.files.outputs import make_folder

    make_folder(results, "--results")
    options = Options(
        runs, engine, results, jobs=jobs, scheduler=scheduler, slurm=slurm, part=share
    )
    played = play(chosen, options, seconds)
    if played.interrupted:
        raise interrupted(played.left_words)
    write_pages(pages, results, results / PAGES, every=False)
    raise_unless_done(played)


@app.command()
def counts(
    names: PaperNames = None,
    results: ResultsOption = RESULTS,
    packed: Annotated[
        bool,
        typer.Option("--packed", help="With the packed runs, papers/NAME/runs.tar.xz, instead."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Count the printed numbers: judged, shown beside ours, and without one of ours by reason."""
    import tempfile

    from slambed.commands.results_folders import result_folders
    from slambed.papers.compare import compare_paper
    from slambed.papers.kept import kept_file, read_kept
    from slambed.papers.lookup import pool_of
    from slambed.papers.published import read_papers
    from slambed.papers.reasons import count_json, count_table
    from slambed.report.load import load
    from slambed.terminal import console

    chosen = [paper for paper in read_papers(names or None) if paper.kind == "paper"]
    if packed:
        if results != RESULTS:
            raise SlambedError("--packed counts the packed runs alone; leave out --results")
        if missing := [paper.id for paper in chosen if kept_file(paper.id) is None]:
            raise SlambedError(f"{', '.join(missing)}: no packed runs; leave --packed out")
        with tempfile.TemporaryDirectory(prefix="slambed-packed.") as place:
            pages = [
                compare_paper(paper, pool_of(read_kept(archive, Path(place) / paper.id)))
                for paper in chosen
                if (archive := kept_file(paper.id)) is not None
            ]
    else:
        if not results.is_dir():
            raise SlambedError(f"no such folder: {results}; give the right --results")
        pool = pool_of([load(folder) for folder in result_folders(results)])
        pages = [compare_paper(paper, pool) for paper in chosen]
    if as_json:
        print_json(count_json(pages))
    else:
        console().print(count_table(pages).rich())


@app.command()
def lint(
    names: PaperNames = None,
    as_json: JsonOption = False,
) -> None:
    """Check that every published number is mapped or has a reason why not, and that all names
    exist."""
    from slambed.papers.lint.checkout import Checkout
    from slambed.papers.lint.lint import lint as look
    from slambed.papers.published.cells import cells_of, table_cells
    from slambed.papers.published.reading import read_papers
    from slambed.spec.library import Library

    papers = [paper for paper in read_papers(names or None) if paper.kind == "paper"]
    problems = look(papers, Checkout(Library()))
    if as_json:
        print_json({"papers": [paper.id for paper in papers], "problems": list(map(str, problems))})
        raise typer.Exit(ExitCode.NOT_ALL_GOOD if problems else ExitCode.OK)
    for problem in problems:
        typer.echo(f"{problem}")
    if problems:
        raise SlambedError(f"{len(problems)} problems in papers/, see above", ExitCode.NOT_ALL_GOOD)
    for paper in papers:
        claims = [cell for cell in cells_of(paper).values() if cell.claim is not None]
        judged = sum(cell.comparability.judged for cell in (*table_cells(paper).values(), *claims))
        typer.echo(
            f"{paper.id}: {len(table_cells(paper))} cells and {len(claims)} claims are mapped or "
            f"say why not ({judged} to be judged), {len(paper.contrasts)} orderings"
        )


@app.command()
def plan(name: Annotated[str, typer.Argument(help="Name in papers/.")]) -> None:
    """Show what a paper's campaign will decide, as registered before its runs."""
    from slambed.papers.published.paper_plan import read_plan
    from slambed.papers.published.reading import read_papers

    paper = read_papers([name])[0]
    found = read_plan(paper.id)
    if found is None:
        raise SlambedError(f"no plan for '{paper.id}', write papers/{paper.id}/plan.yaml")
    says = {item.id: item.says for item in paper.contrasts}
    typer.echo(
        f"{paper.id}: plan {found.digest} of {found.written_utc:%Y-%m-%d %H:%M} UTC, "
        f"engine {found.engine}, mapping {found.frozen}"
    )
    for item in found.data.items():
        kind = "played instead" if item[1].stand_in else "the paper's sequence"
        typer.echo(f"  {item[0]}: {item[1].played} ({kind}; {item[1].why})")
    for runs in found.runs:
        typer.echo(f"  {runs.experiment}: {runs.runs} runs per combination, seed {runs.seed}")
        for decided in runs.decides:
            power = f" (power {runs.power[decided]:g})" if decided in runs.power else ""
            typer.echo(f"    {decided}{power}: {says.get(decided, '?')}")
    for later in found.later:
        typer.echo(f"  later, {later.runs} runs per combination: {later.waits_for}")
        for decided in later.decides:
            power = f" (power {later.power[decided]:g})" if decided in later.power else ""
            typer.echo(f"    {decided}{power}: {says.get(decided, '?')}")
    for limit in found.limits:
        typer.echo(f"  limit: {limit}")


@app.command("list")
def list_(as_json: JsonOption = False) -> None:
    """List the papers that results are compared with."""
    from slambed.papers.compare import plain_list
    from slambed.papers.published.reading import read_papers

    if as_json:
        print_json(
            [
                {"id": paper.id, "kind": paper.kind, **paper.paper.model_dump(mode="json")}
                for paper in read_papers()
            ]
        )
        return
    for paper in read_papers():
        typer.echo(plain_list(paper))
    typer.echo("one of them beside our results: 'slambed papers compare NAME'")


@app.command()
def rates() -> None:
    """Show the error rates of the verdict rules, as in docs/explanation/verdicts.md."""
    from slambed.papers.verdicts.rates import rates_markdown

    typer.echo(rates_markdown())


@app.command()
def power(
    name: Annotated[str, typer.Argument(help="Name in papers/.")],
    results: Annotated[
        Path, typer.Option(help="Where earlier runs say how long one takes.")
    ] = Path("results"),
    jobs: Annotated[
        int, typer.Option("--jobs", min=1, help="Processes that the estimate assumes.")
    ] = 2,
) -> None:
    """Show what a paper's campaign can decide, and what it costs, before it runs."""
    from slambed.papers.paper_runs import sizes_of
    from slambed.papers.power import costs, number_powers, ordering_powers
    from slambed.papers.published.paper_plan import read_plan
    from slambed.papers.published.reading import read_papers
    from slambed.terminal import console

    paper = read_papers([name])[0]
    if paper.kind == "peer":
        raise SlambedError(f"'{name}' is no paper but a program beside ours, nothing to decide")
    screen = console()
    screen.print(ordering_powers(paper).rich())
    screen.print(number_powers(paper).rich())
    sizes = sizes_of(paper)
    if sizes:
        screen.print(costs(paper, sizes, read_plan(paper.id), results, jobs).rich())
    else:
        screen.print(f"no experiment reproduces anything of {name} yet")


def write_pages(names: list[str] | None, results: Path, out: Path, every: bool) -> None:
    """Writes one page per paper and an overview, and prints a summary of each."""
    from slambed.commands.results_folders import result_folders
    from slambed.files.outputs import make_folder
    from slambed.papers.published import read_papers
    from slambed.report.load import load

    chosen = read_papers(names)
    if not results.is_dir():
        raise SlambedError(f"no such folder: {results}; give the right --results")
    make_folder(out, "--results" if out == results / PAGES else "--out")
    experiments = [load(folder) for folder in result_folders(results)]
    write_all(chosen, lambda paper: experiments, out, every)


def write_all(
    papers: "list[Paper]",
    runs_of: "Callable[[str], list[Results]]",
    out: Path,
    every: bool,
    made_by: str = COMPARE,
    besides: "Sequence[Results]" = (),
) -> None:
    """Writes one page per paper, from the experiments that `runs_of` returns for its id, and with
    several papers an overview. besides: experiments of no paper, for the comparison of systems."""
    from slambed.papers.compare import comparison_table
    from slambed.papers.cross_page import ALL_SYSTEMS, write_cross_page
    from slambed.papers.paper_page import write_overview, write_paper_page
    from slambed.terminal import console

    screen = console()
    pages = []
    pooled: dict[str, Results] = {}
    for item in papers:
        experiments = runs_of(item.id)
        pooled |= {results.name: results for results in experiments}
        page = write_paper_page(item, experiments, out, len(papers) > 1, made_by)
        for line in page.lines:
            screen.print(line, highlight=False, soft_wrap=True)
        verdicts = page.verdicts
        for column in verdicts.columns if verdicts is not None and every else []:
            assert verdicts is not None
            screen.print(comparison_table(verdicts, column, list(column.rows)).rich())
        screen.print(f"page: {page.html}", highlight=False, soft_wrap=True)
        pages += [verdicts] if verdicts is not None else []
    if len(pages) > 1:
        experiments = list(pooled.values())
        every_system = [r for r in [*besides, *experiments] if r.name == ALL_SYSTEMS]
        compared = [write_cross_page(results, out) for results in every_system]
        systems = next((page.name for page in compared if page is not None), "")
        if systems:
            screen.print(f"all systems: {out / systems}", highlight=False, soft_wrap=True)
        overview = write_overview(pages, experiments, out, systems)
        screen.print(f"all papers: {overview}", highlight=False, soft_wrap=True)
