# SPDX-License-Identifier: Apache-2.0
"""Whether results keep to the plan that was written before them (papers/<id>.plan.yaml)."""

from dataclasses import dataclass
from datetime import UTC, datetime

from slambed.report.compare import Column
from slambed.report.load import Results
from slambed.report.papers import Paper
from slambed.report.papers.plan import PaperPlan, frozen_digest


@dataclass(frozen=True)
class PlanLine:
    """One sentence; `bad` where a result does not keep to its plan."""

    text: str
    bad: bool = False


def plan_lines(
    paper: Paper, plan: PaperPlan | None, column: Column, used: list[Results]
) -> list[PlanLine]:
    """What is to be known of the plan of these runs, which are those of `used`."""
    if plan is None:
        return [PlanLine(f"No plan was written before these runs (papers/{paper.id}.plan.yaml).")]
    written = f"{plan.written_utc.astimezone(UTC):%Y-%m-%d %H:%M} UTC"
    found = [PlanLine(f"Plan {plan.digest} of {written}, mapping and margins {plan.frozen}.")]
    if (today := frozen_digest(paper)) != plan.frozen:
        told = f"The paper's contrasts, margins or mapping were changed after the plan: {today} now"
        found.append(PlanLine(f"{told}, {plan.frozen} planned.", bad=True))
    if not column.engine:
        return found
    if column.engine != plan.engine:
        found.append(
            PlanLine(f"The plan is for {plan.engine} runs, not {column.engine} ones.", True)
        )
    found += _times(plan, column, {r.name for r in used})
    planned = {item.experiment: item for item in plan.runs}
    for results in used:
        item = planned.get(results.name)
        if item is None:
            found.append(PlanLine(f"Experiment {results.name} is not in the plan.", bad=True))
            continue
        seed = results.spec.get("seed")
        if seed is not None and seed != item.seed:
            text = f"{results.name}: seed {seed}, {item.seed} was planned."
            found.append(PlanLine(text, bad=True))
        runs = column.runs[column.runs["experiment_folder"] == results.name]
        fewest = int(runs.groupby("cell").size().min()) if len(runs) else 0
        if fewest < item.runs:
            text = f"{results.name}: {fewest} runs in a cell, {item.runs} were planned."
            found.append(PlanLine(text, bad=True))
    return found + _devices(plan, column)


def _times(plan: PaperPlan, column: Column, names: set[str]) -> list[PlanLine]:
    own = column.runs[column.runs["experiment_folder"].isin(names)]
    if "started_utc" not in own or not len(own):
        return []
    times = [_time(value) for value in own["started_utc"]]
    early = sum(time is not None and plan.made_before(time) for time in times)
    unknown = sum(time is None for time in times)
    found = []
    if early:
        text = f"{early} of {len(times)} runs were made before the plan was written."
        found.append(PlanLine(text, bad=True))
    if unknown:
        text = f"{unknown} of {len(times)} runs do not say when they were made."
        found.append(PlanLine(text, bad=True))
    return found


def _time(value: object) -> datetime | None:
    if not isinstance(value, str):
        return None
    try:
        found = datetime.fromisoformat(value.replace("Z", "+00:00"))
    except ValueError:
        return None
    return found if found.tzinfo is not None else found.replace(tzinfo=UTC)


def _devices(plan: PaperPlan, column: Column) -> list[PlanLine]:
    found = []
    for role, name in plan.devices.items():
        key = f"device_{role}"
        used = set(column.runs[key].dropna().astype(str)) if key in column.runs else set()
        if other := sorted(used - {name}):
            text = f"The {role} was {', '.join(other)} in some runs, {name} was planned."
            found.append(PlanLine(text, bad=True))
    return found


def plan_words(lines: list[PlanLine], plan: PaperPlan | None, ran: bool = True) -> str:
    """For one line of text: the plan's digest and how many things are not as planned."""
    if plan is None:
        return "no plan"
    wrong = sum(line.bad for line in lines)
    if not ran and not wrong:
        return f"plan {plan.digest[:8]}"
    return f"plan {plan.digest[:8]}" + (f" ({wrong} things not as planned)" if wrong else " kept")
