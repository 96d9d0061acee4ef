# SPDX-License-Identifier: Apache-2.0
"""Whether results keep to the plan that was written before them (papers/<id>.plan.yaml)."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import pandas as pd

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
    own = _own(column, used)
    if plan is None:
        seen = written_in(own, f"plan.{paper.id}")
        found = [PlanLine(f"No plan was written before these runs (papers/{paper.id}.plan.yaml).")]
        if known := {name: count for name, count in seen.items() if name}:
            text = f"{_counted(known, own)} made under a plan that is gone: {', '.join(known)}."
            found = [PlanLine(text, bad=True)]
        return found
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
    found += _times(plan, own) + _seen(plan, own)
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
        # A run that several experiments have in common is in the column once, under one of them.
        runs = results.runs[results.runs["run_key"].isin(column.runs["run_key"])]
        fewest = int(runs.groupby("cell").size().min()) if len(runs) else 0
        if fewest < item.runs:
            there = f"{fewest} run{'' if fewest == 1 else 's'} in a cell"
            text = f"{results.name}: {there}, {item.runs} were planned."
            found.append(PlanLine(text, bad=True))
    return found + _devices(plan, column)


def _own(column: Column, used: list[Results]) -> pd.DataFrame:
    """The runs that stand behind numbers and orderings."""
    if "experiment_folder" not in column.runs:
        return column.runs.head(0)
    return column.runs[column.runs["experiment_folder"].isin({r.name for r in used})]


def written_in(runs: pd.DataFrame, key: str) -> "Counter[str]":
    """What was written into the runs as they were executed; empty where nothing was."""
    values = runs[key] if key in runs else [None] * len(runs)
    return Counter(value if isinstance(value, str) else "" for value in values)


def _counted(told: Mapping[str, int], runs: pd.DataFrame) -> str:
    count = sum(told.values())
    return f"{count} of {len(runs)} runs {'was' if count == 1 else 'were'}"


def _seen(plan: PaperPlan, runs: pd.DataFrame) -> list[PlanLine]:
    """Under which plan the runs were executed, by what they keep of it: a plan that was rewritten
    after a look at results, with its old date, has another digest."""
    found = []
    seen = written_in(runs, f"plan.{plan.paper}")
    if unknown := seen.pop("", 0):
        text = f"{unknown} of {len(runs)} runs do not say under which plan they were made."
        found.append(PlanLine(text, bad=True))
    if other := {name: count for name, count in seen.items() if name != plan.digest}:
        text = f"{_counted(other, runs)} made under another plan: {', '.join(sorted(other))}."
        found.append(PlanLine(text, bad=True))
    frozen = written_in(runs, f"plan_frozen.{plan.paper}")
    changed = {name: count for name, count in frozen.items() if name not in ("", plan.frozen)}
    if changed:
        text = f"{_counted(changed, runs)} made with another mapping than the plan's: "
        found.append(PlanLine(f"{text}{', '.join(sorted(changed))}.", bad=True))
    return found


def _times(plan: PaperPlan, own: pd.DataFrame) -> list[PlanLine]:
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
    things = f"{wrong} thing{'' if wrong == 1 else 's'}"
    return f"plan {plan.digest[:8]}" + (f" ({things} not as planned)" if wrong else " kept")
