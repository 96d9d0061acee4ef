# SPDX-License-Identifier: Apache-2.0
"""`slambed infer`."""

from typing import Annotated

import typer

from slambed.commands.shared_options import JobsOption, interrupted
from slambed.errors import ExitCode, SlambedError
from slambed.terminal import RESULTS, ResultsOption, console


def infer(
    plan: Annotated[
        str, typer.Argument(help="Name in papers/*/inference/, or path of a YAML file.")
    ],
    quick: Annotated[bool, typer.Option("--quick", help="The plan's quick form.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show how many runs it takes, and how long.")
    ] = False,
    results: ResultsOption = RESULTS,
    jobs: JobsOption = None,
) -> None:
    """Fit a paper's unknown parameters to some of its numbers, and predict others.

    Virtual runs sample points of the plan's unknowns. Points whose likelihood of the printed counts
    is close to the best are kept and predict the numbers held out. The page reports the fit,
    profiles, predictions, attribution and failures. Finished runs are reused, so the same command
    continues after an interrupt.
    """
    from slambed.campaign.options import Options
    from slambed.infer.campaign import StoppedError
    from slambed.infer.inference import infer as run_inference
    from slambed.infer.inference import prepare, preview
    from slambed.infer.page import headline, write_page
    from slambed.spec.device import VIRTUAL

    screen = console()
    options = Options(engine=VIRTUAL, results=results, jobs=jobs)
    session = prepare(plan, quick, options, screen)
    for line in preview(session):
        typer.echo(line)
    if dry_run:
        return
    try:
        outcome = run_inference(session)
    except StoppedError:
        raise interrupted() from None
    path = write_page(outcome, session.folder)
    for line in headline(outcome):
        typer.echo(line)
    typer.echo(path)
    if outcome.fit.unpaid or outcome.predicting < outcome.kept:
        message = f"{outcome.predicting} of {outcome.kept} kept points predict"
        raise SlambedError(
            f"{message}: the budget is spent, raise budget_runs", ExitCode.NOT_ALL_GOOD
        )
    if outcome.failures:
        message = f"{len(outcome.failures)} runs have no result: {outcome.failures[0]}"
        raise SlambedError(f"{message}; the same command tries again", ExitCode.NOT_ALL_GOOD)
