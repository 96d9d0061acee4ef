# SPDX-License-Identifier: Apache-2.0
"""Executes one inference, from its plan to the content of its page."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pandas as pd
from rich.console import Console

from slambed.campaign.options import Options
from slambed.campaign.progress import duration
from slambed.errors import SlambedError
from slambed.infer.campaign import Campaign
from slambed.infer.design import Point, printed_point, rounds_of, shown, spread
from slambed.infer.inference_plan import QUICK, Form, Inference, find_plan, read_its_paper
from slambed.infer.mixture import Counts, predict_mean, predict_share, weights_of
from slambed.infer.registered import Registration, register, registered_lines
from slambed.infer.rows import Rows
from slambed.infer.search import Evaluated, FitResult, search
from slambed.infer.slots import Places, find_places
from slambed.infer.success import ComparedCell, CriterionResult, judge
from slambed.papers.measured import Measured
from slambed.papers.registered import PlanLine
from slambed.papers.verdicts.model import Share

RESULTS = "inference"
"""Folder in `results/` for the pages."""


@dataclass(frozen=True)
class Back:
    """The best point with one item set back to its printed value."""

    item: str
    best: str
    printed: str
    evaluated: Evaluated


@dataclass
class Outcome:
    """Everything that the page reports."""

    plan: Inference
    quick: bool
    registration: Registration
    places: Places
    fit: FitResult
    fitted: list[ComparedCell]
    held_out: list[ComparedCell]
    back: list[Back]
    printed: Evaluated
    """The point where every item has its printed value."""
    success: list[CriterionResult]
    kept: int
    """Kept points, of which `predicting` were run for the predictions."""
    predicting: int
    lines: list[PlanLine]
    unfitted: list[str]
    stand_ins: list[str]
    """Datasets that were played instead of the paper's sequence."""
    spent: int
    failures: list[str] = field(default_factory=list)
    """Runs without a result."""


@dataclass
class Session:
    """A plan that was read, checked and resolved to experiments and paper; nothing is executed
    yet."""

    plan: Inference
    quick: bool
    registration: Registration
    places: Places
    rows: Rows
    campaign: Campaign
    points: list[Point]
    rounds: list[int]
    """Runs of every fitted cell in each round."""

    @property
    def form(self) -> Form:
        """Returns the chosen form of the plan: points, runs and budget."""
        return self.plan.form(self.quick)

    @property
    def folder(self) -> Path:
        return self.campaign.folder


def prepare(name: str, quick: bool, options: Options, console: Console) -> Session:
    """Prepares a session. Raises SlambedError for any error in the plan before anything is
    executed."""
    plan, source = find_plan(name)
    paper, paper_file = read_its_paper(plan, source)
    places = find_places(plan, source, paper, console)
    rows = Rows(plan, source, places)
    rows.check()
    registration = register(plan, source, paper_file, places)
    called = plan.id + (QUICK if quick else "")
    options = replace(options, plans=registration.entry)
    folder = options.results / RESULTS / called
    campaign = Campaign(rows, called, folder, options, console)
    form = plan.form(quick)
    points = spread(plan.open, form.points, plan.seed)
    session = Session(plan, quick, registration, places, rows, campaign, points, rounds_of(form))
    least = _fewest(session)
    if sum(least) > form.budget_runs:
        which = "quick" if quick else "full"
        raise source.complaint(
            f"one kept point takes {sum(least)} runs at least, the budget is {form.budget_runs}",
            (which, "budget_runs"),
            "raise it, or take fewer points or runs",
        )
    return session


def _fewest(session: Session) -> tuple[int, int, int]:
    """Returns the runs of the first round, of one point's further rounds, and of its
    predictions."""
    plan, form, campaign = session.plan, session.form, session.campaign
    first = len(campaign.cells_of(session.points, plan.fit)) * form.first_runs
    one = session.points[:1]
    more = len(campaign.cells_of(one, plan.fit)) * (form.final_runs - form.first_runs)
    return first, more, len(campaign.cells_of(one, plan.held_out)) * form.predict_runs


def preview(session: Session) -> list[str]:
    """Returns what would be executed, and how long it takes."""
    plan, form, campaign = session.plan, session.form, session.campaign
    registration = session.registration
    where = (
        f"committed in {registration.commit[:10]}"
        if registration.commit
        else (f"NOT REGISTERED: {registration.why}")
    )
    lines = [f"{plan.id}: plan {registration.digest}, {where}"]
    lines += [
        f"  open: {name} ({described(plan, name)}): {i.says}" for name, i in plan.open.items()
    ]
    lines += [
        f"  no fitted cell depends on {name}: it is not fitted" for name in session.rows.unfitted()
    ]
    lines.append(f"  fitted: {len(plan.fit)} cells; predicted: {len(plan.held_out)}")
    stand_ins = sorted({p.dataset for p in session.places.places.values() if p.stand_in})
    lines += [f"  played instead of the paper's sequence: {name}" for name in stand_ins]
    first, more, predicted = _fewest(session)
    low = first + more + predicted
    lines.append(
        f"  {len(session.points)} points, rounds of {_list(session.rounds)} runs of each cell"
    )
    lines.append(f"  first round: {first} runs; each point to its last one: {more} more")
    lines.append(f"  prediction: {predicted} runs for each point that is kept")
    back = len(campaign.cells_of(session.points[:1], plan.fit)) * form.final_runs
    lines.append(f"  attribution: up to {back} runs for each item")
    high = min(form.budget_runs, low + (len(session.points) - 1) * (more + predicted))
    high += (len(plan.open) + 1) * back
    run_s = campaign.seconds_per_run()
    took = f"about {duration(low * run_s)} to {duration(high * run_s)}"
    lines.append(f"{low} to {high} runs, {took}; of fit and prediction {form.budget_runs} at most")
    return lines


def _list(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))


def described(plan: Inference, name: str) -> str:
    """Returns text such as `params.x 0 to 5; as printed 0`."""
    item = plan.open[name]
    if item.range is not None:
        what = f"{item.set} {item.range[0]:g} to {item.range[1]:g}"
    else:
        what = " | ".join(shown(value) for value in item.choices)
        what = f"{item.set}: {what}" if item.set else what
    return f"{what}; as printed {shown(item.printed)}"


def infer(session: Session) -> Outcome:
    """Executes missing runs, fits, predicts and judges. Raises StoppedError on an interrupt; the
    same call then continues."""
    plan, form, campaign = session.plan, session.form, session.campaign
    places = session.places.places
    printed = {c: s for c in plan.fit if isinstance(s := places[c].printed, Share)}

    def evaluate(points: Sequence[Point], runs: int) -> Mapping[Point, Counts]:
        return campaign.counts("fit", points, plan.fit, runs)

    def allowed(points: Sequence[Point], runs: int) -> int:
        """Returns how many points the budget covers after reserving one point's predictions."""
        spare = form.budget_runs - len(campaign.asked) - _fewest(session)[2]
        return _reached(points, spare, lambda own: campaign.further(own, plan.fit, runs))

    fit = search(session.points, session.rounds, printed, plan.within_log, evaluate, allowed)
    kept = fit.kept
    affordable = _affordable(session, [e.point for e in kept])
    measured: dict[Point, dict[str, Measured]] = {}
    if affordable:
        measured = campaign.measure("predict", affordable, plan.held_out, form.predict_runs)
    fitted = [
        ComparedCell(
            c, s, predict_share([e.counts[c] for e in kept], fit.weights, s), kept[0].counts[c]
        )
        for c, s in printed.items()
    ]
    held_out = [_predicted(session, c, kept[: len(affordable)], measured) for c in plan.held_out]
    back, at_printed = _back(session, fit)
    runs = _all_runs(campaign)
    return Outcome(
        plan=plan,
        quick=session.quick,
        registration=session.registration,
        places=session.places,
        fit=fit,
        fitted=fitted,
        held_out=held_out,
        back=back,
        printed=at_printed,
        success=[judge(c, fitted, held_out) for c in plan.success],
        kept=len(kept),
        predicting=len(affordable),
        lines=registered_lines(session.registration, runs),
        unfitted=session.rows.unfitted(),
        stand_ins=sorted(campaign.stand_ins),
        spent=len(campaign.asked),
        failures=[line for v in campaign.verdicts for line in v.given_up.values()],
    )


def _affordable(session: Session, points: list[Point]) -> list[Point]:
    """Returns the likeliest points whose predictions fit the budget."""
    form, campaign = session.form, session.campaign
    spare = form.budget_runs - len(campaign.asked)
    cells, runs = session.plan.held_out, form.predict_runs
    return points[: _reached(points, spare, lambda own: campaign.further(own, cells, runs))]


def _reached(points: Sequence[Point], spare: int, cost: Callable[[Sequence[Point]], int]) -> int:
    """Returns how many of these points the spare budget covers."""
    count = len(points)
    while count and cost(points[:count]) > spare:
        count -= 1
    return count


def _predicted(
    session: Session,
    cell: str,
    kept: list[Evaluated],
    measured: Mapping[Point, Mapping[str, Measured]],
) -> ComparedCell:
    printed = session.places.places[cell].printed
    own = [measured[e.point][cell] for e in kept]
    if not own or not all(m.there for m in own):
        return ComparedCell(cell, printed, None, None)
    weights = weights_of([e.log_likelihood for e in kept])
    if isinstance(printed, Share):
        prediction = predict_share([m.share for m in own], weights, printed)
        return ComparedCell(cell, printed, prediction, own[0].ours)
    prediction_of_mean = predict_mean([m.mean for m in own], weights, printed)
    return ComparedCell(cell, printed, prediction_of_mean, own[0].ours)


def _back(session: Session, fit: FitResult) -> tuple[list[Back], Evaluated]:
    """Evaluates the best point with each item as printed, and with all items as printed, to
    attribute the fit to items. They get as many runs as the best point has, because likelihoods of
    other numbers of runs are no comparison; it has fewer than planned where the budget ended."""
    plan, runs = session.plan, fit.best.runs
    best = fit.best.point
    everything = printed_point(plan.open)
    points = {
        name: best.at(name, item.printed)
        for name, item in plan.open.items()
        if best.named[name] != item.printed
    }
    wanted = list(dict.fromkeys([everything, *points.values()]))
    counts = session.campaign.counts("back", wanted, plan.fit, runs)
    own = FitResult(fit.printed, fit.within_log)
    own.put(counts, runs)
    found = [
        Back(n, shown(best.named[n]), shown(plan.open[n].printed), own.points[p])
        for n, p in points.items()
    ]
    return found, own.points[everything]


def _all_runs(campaign: Campaign) -> pd.DataFrame:
    """Returns every run that was used, once. Raises SlambedError if there is none."""
    if not campaign.runs:
        raise SlambedError("no run was made")
    return pd.concat(campaign.runs, ignore_index=True).drop_duplicates("run_key")
