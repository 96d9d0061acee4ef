# SPDX-License-Identifier: Apache-2.0
"""Checks that a plan fits its paper and its experiments."""

from collections.abc import Iterator

from slambed.errors import SlambedError
from slambed.papers.lint.checkout import Checkout
from slambed.papers.lint.problem import Problem
from slambed.papers.published.cells import cells_of
from slambed.papers.published.paper import Paper
from slambed.papers.published.paper_plan import PaperPlan, PlannedLater, PlannedRuns, frozen_digest


def plan_problems(plan: PaperPlan, paper: Paper, checkout: Checkout) -> Iterator[Problem]:
    """Yields all problems of a plan."""
    where = f"papers/{paper.id}/plan.yaml"
    today = frozen_digest(paper)
    if plan.frozen != today:
        message = f"frozen: papers/{paper.id}/paper.yaml is {today} now, not {plan.frozen}: "
        message += "what it compares was changed, so write a new plan with a new written_utc"
        yield Problem(where, message)
    for name in plan.fits:
        if name not in checkout.fits:
            yield Problem(where, f"fits: no catalog/devices/fits/{name}.yaml")
    for name, data in plan.data.items():
        if name not in paper.datasets:
            yield Problem(where, f"data: the paper has no sequence {name}")
        for dataset in (data.dataset, data.played):
            if dataset not in checkout.datasets:
                yield Problem(where, f"data, {name}: no dataset {dataset}")
    reproduced: set[str] = set()
    for item in plan.runs:
        try:
            experiment, _ = checkout.library.experiment(item.experiment)
        except SlambedError as error:
            yield Problem(where, f"runs: {error}")
            continue
        reproduced |= paper.sources(set(experiment.reproduces))
        if experiment.seed != item.seed:
            yield Problem(where, f"{item.experiment}: seed {experiment.seed}, not {item.seed}")
    yield from _contrasts(where, plan, paper, reproduced)


def _contrasts(
    where: str, plan: PaperPlan, paper: Paper, reproduced: set[str]
) -> Iterator[Problem]:
    contrasts = {item.id: item for item in paper.contrasts}
    cells = cells_of(paper)
    named: list[tuple[str, PlannedRuns | PlannedLater]]
    named = [(item.experiment, item) for item in plan.runs]
    named += [("later", item) for item in plan.later]
    for about, item in named:
        for name in (*item.decides, *item.power):
            if name not in contrasts:
                yield Problem(where, f"{about}: no contrast {name}")
    decided = {name for item in plan.runs for name in item.decides}
    waiting = {name for item in plan.later for name in item.decides}
    for name in sorted(decided & waiting):
        yield Problem(where, f"{name} is decided by an experiment, so not later")
    for name, contrast in contrasts.items():
        if name in waiting:
            continue
        if name not in decided:
            yield Problem(
                where, f"no experiment decides {name}, and it is not among those of later"
            )
            continue
        missing = {cells[i].source for i in contrast.ids() if i in cells} - reproduced
        if missing:
            yield Problem(where, f"{name}: no planned experiment reproduces {min(missing)}")
