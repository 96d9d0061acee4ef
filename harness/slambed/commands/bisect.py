# SPDX-License-Identifier: Apache-2.0
"""`slambed bisect`."""

from pathlib import Path
from typing import Annotated

import typer

from slambed.errors import ExitCode, SlambedError
from slambed.spec.selection import CELL, Selection
from slambed.terminal import console

LEAST_RUNS = 2
"""Fewest pairs that a test can work with."""


def bisect(
    experiment: Annotated[str, typer.Argument(help="Name in experiments/, or path of a file.")],
    good: Annotated[str, typer.Option(help="Commit, tag, or results folder of one commit.")],
    bad: Annotated[str, typer.Option(help="The same, where the regression gate failed.")] = "HEAD",
    metric: Annotated[
        list[str] | None,
        typer.Option(help="Only this; else all that the regression gate looks at."),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(help="Only this combination; * is any text.")
    ] = None,
    runs: Annotated[
        int | None,
        typer.Option(min=LEAST_RUNS, help="Runs per combination; else the experiment's."),
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="KEY=VALUE instead of the file's.")
    ] = None,
    alpha: Annotated[
        float, typer.Option(min=1e-6, max=0.5, help="Chance of a false alarm at a commit.")
    ] = 0.05,
    results: Annotated[Path, typer.Option(help="Folder of all results.")] = Path("results"),
) -> None:
    """Find the first commit that fails the regression gate, with virtual runs of equal seeds.

    Commits are checked out in the results folder, built where their sources differ, and measured by
    their own harness. Measurements are kept. Exits with 1 when skipped commits leave the answer
    open.
    """
    from slambed.campaign.plan import check, repetitions
    from slambed.files.outputs import make_folder
    from slambed.native import build_folder, repository_root
    from slambed.regression.bisect import bisect as first_bad
    from slambed.regression.candidates import Repository, Workshop
    from slambed.spec.device import VIRTUAL
    from slambed.spec.library import Library

    for text in only or []:
        if Selection.of(text).keys != {CELL}:
            raise SlambedError(
                f"--only {text}: bisect takes the name of a combination (* matches any text), "
                "because older commits do not know KEY=VALUE"
            )
    library = Library()
    found, source = library.experiment(experiment, settings)
    check(found, source, library, VIRTUAL)
    count = repetitions(found, runs)
    if count < LEAST_RUNS:
        raise SlambedError(
            f"{found.id} makes {count} run per combination, too few to compare; add --runs 10"
        )
    repository = Repository(repository_root())
    first, last = repository.commit(good), repository.commit(bad)
    candidates = repository.after(first, last)
    place = results.resolve() / "bisect" / found.id
    make_folder(place, "--results")

    def notify(line: str) -> None:
        console().print(line, highlight=False, markup=False, soft_wrap=True)

    workshop = Workshop(
        repository,
        place,
        source.path.resolve(),
        count,
        settings or [],
        only or [],
        build_folder() / "bin",
        notify,
    )
    notify(f"{found.id}: {len(candidates)} commits after {first.short} up to {last.short}")
    with workshop.opened():
        answer = first_bad(first, candidates, workshop, metric or [], alpha, notify)
    if not answer.first:
        notify("no change for the worse between the two: nothing to look for")
        return
    for line in answer.why:
        notify(f"worse: {line}")
    if len(answer.first) > 1:
        for commit in answer.first:
            notify(f"first bad commit, or one of these: {commit}")
        raise SlambedError(
            f"skipped commits leave open which of {len(answer.first)} it is",
            ExitCode.NOT_ALL_GOOD,
        )
    notify(f"first bad commit: {answer.first[0]}")
