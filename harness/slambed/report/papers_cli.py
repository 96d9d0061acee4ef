# SPDX-License-Identifier: Apache-2.0
"""Commands about published numbers: papers list, lint, plan, power, rates."""

from pathlib import Path
from typing import Annotated

import typer

from slambed.errors import ExitCode, SlambedError

app = typer.Typer(help="Published numbers.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Published numbers."""


@app.command()
def lint(
    names: Annotated[
        list[str] | None, typer.Argument(help="Names in papers/; all if none.")
    ] = None,
) -> None:
    """Check that every published number is mapped, or says why not, and that all names exist."""
    from slambed.report.papers.cells import cells_of, table_cells
    from slambed.report.papers.checkout import Checkout
    from slambed.report.papers.lint import lint as look
    from slambed.report.papers.reading import read_papers
    from slambed.spec.library import Library

    papers = [paper for paper in read_papers(names or None) if paper.kind == "paper"]
    problems = look(papers, Checkout(Library()))
    for problem in problems:
        typer.echo(f"{problem}")
    if problems:
        raise SlambedError(f"{len(problems)} problems in papers/, see above", ExitCode.NOT_ALL_GOOD)
    for paper in papers:
        claims = [cell for cell in cells_of(paper).values() if cell.claim is not None]
        judged = sum(cell.standing.judged for cell in (*table_cells(paper).values(), *claims))
        typer.echo(
            f"{paper.id}: {len(table_cells(paper))} cells and {len(claims)} claims are mapped or "
            f"say why not ({judged} to be judged), {len(paper.contrasts)} orderings"
        )


@app.command()
def plan(name: Annotated[str, typer.Argument(help="Name in papers/.")]) -> None:
    """Show what a campaign about a paper will decide, as written before it is run."""
    from slambed.report.papers.plan import read_plan
    from slambed.report.papers.reading import read_papers

    paper = read_papers([name])[0]
    found = read_plan(paper.id)
    if found is None:
        raise SlambedError(f"no plan for '{paper.id}', write papers/{paper.id}.plan.yaml")
    says = {item.id: item.says for item in paper.contrasts}
    typer.echo(f"{paper.id}: plan {found.digest} of {found.written_utc:%Y-%m-%d %H:%M} UTC, "
               f"engine {found.engine}, mapping {found.frozen}")  # fmt: skip
    for item in found.data.items():
        kind = "stand-in" if item[1].stand_in else "the paper's sequence"
        typer.echo(f"  {item[0]}: {item[1].played} ({kind}; {item[1].why})")
    for runs in found.runs:
        typer.echo(f"  {runs.experiment}: {runs.runs} runs per cell, seed {runs.seed}")
        for decided in runs.decides:
            power = f" (power {runs.power[decided]:g})" if decided in runs.power else ""
            typer.echo(f"    {decided}{power}: {says.get(decided, '?')}")
    for later in found.later:
        typer.echo(f"  later, {later.runs} runs per cell: {later.waits_for}")
        for decided in later.decides:
            power = f" (power {later.power[decided]:g})" if decided in later.power else ""
            typer.echo(f"    {decided}{power}: {says.get(decided, '?')}")
    for limit in found.limits:
        typer.echo(f"  limit: {limit}")


@app.command("list")
def list_() -> None:
    """List the papers that results are put beside."""
    from slambed.report.compare import plain_list
    from slambed.report.papers.reading import read_papers

    for paper in read_papers():
        typer.echo(plain_list(paper))


@app.command()
def rates() -> None:
    """Tell how often the rules of verdicts err, as in docs/metrics.md."""
    from slambed.report.verdicts.rates import rates_markdown

    typer.echo(rates_markdown())


@app.command()
def power(
    name: Annotated[str, typer.Argument(help="Name in papers/.")],
    results: Annotated[
        Path, typer.Option(help="Where earlier runs say how long one takes.")
    ] = Path("results"),
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Virtual runs side by side.")] = 2,
) -> None:
    """Tell before a campaign what it can decide about a paper, and what it costs."""
    from slambed.report.paper_runs import sizes_of
    from slambed.report.papers.plan import read_plan
    from slambed.report.papers.reading import read_papers
    from slambed.report.power import costs, number_powers, ordering_powers
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
