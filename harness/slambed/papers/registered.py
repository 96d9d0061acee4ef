# SPDX-License-Identifier: Apache-2.0
"""Checks results against the plan that was written before them (papers/<id>/plan.yaml)."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import pandas as pd

from slambed.papers.compare import Column
from slambed.papers.published import Paper
from slambed.papers.published.paper_plan import PaperPlan, PlannedLater, frozen_digest
from slambed.report.load import Results


@dataclass(frozen=True)
class PlanLine:
    """One sentence; `bad` where a result deviates from its plan."""

    text: str
    bad: bool = False


def plan_lines(
    paper: Paper,
    plan: PaperPlan | None,
    column: Column,
    experiments: list[Results],
) -> list[PlanLine]:
    """Returns sentences about the plan of the runs in `column`; `experiments` are all that were
    loaded."""
    behind = cells_behind(column)
    planned = {item.experiment: item for item in plan.runs} if plan is not None else {}
    names = experiments_behind(column)
    # A run that several experiments share is in the column once, under one of them.
    used = [
        r
        for r in experiments
        if r.name in names or (r.name in planned and r.runs["run_key"].isin(behind).any())
    ]
    own = _own(column, used)
    if plan is None:
        seen = written_in(own, f"plan.{paper.id}")
        found = [PlanLine(f"No plan was written before these runs (papers/{paper.id}/plan.yaml).")]
        if known := {name: count for name, count in seen.items() if name}:
            text = f"{_counted(known, own)} made under a plan that is gone: {', '.join(known)}."
            found = [PlanLine(text, bad=True)]
        return found
    written = f"{plan.written_utc.astimezone(UTC):%Y-%m-%d %H:%M} UTC"
    found = [PlanLine(f"Plan {plan.digest} of {written}, mapping and margins {plan.frozen}.")]
    if (today := frozen_digest(paper)) != plan.frozen:
        message = (
            f"The paper's contrasts, margins or mapping were changed after the plan: {today} now"
        )
        found.append(PlanLine(f"{message}, {plan.frozen} planned.", bad=True))
    if not column.engine:
        return found
    later = _planned_later(plan, column)
    if column.engine != plan.engine and names - set(later):
        found.append(
            PlanLine(f"The plan is for {plan.engine} runs, not {column.engine} ones.", True)
        )
    found += _made(plan, own)
    for results in used:
        item = planned.get(results.name)
        if item is None and results.name in later:
            found += _later_lines(results, later[results.name], behind)
            continue
        if item is None:
            found.append(PlanLine(f"Experiment {results.name} is not in the plan.", bad=True))
            continue
        seed = results.spec.get("seed")
        if seed is not None and seed != item.seed:
            text = f"{results.name}: seed {seed}, {item.seed} was planned."
            found.append(PlanLine(text, bad=True))
        # Cells without a published number, such as another codec's, decide nothing and are not
        # counted.
        fewest = _fewest(results, behind)
        short = results.expected is not None and results.expected > len(results.runs)
        there = f"{len(results.runs)} of {results.expected} runs of it are there"
        if fewest < item.runs:
            text = _too_few(results, fewest, item.runs)
            found.append(PlanLine(f"{text} ({there})." if short else f"{text}.", bad=True))
        elif short:
            # Whole combinations may be missing, of which no run is behind any number.
            found.append(PlanLine(f"{results.name}: {there}.", bad=True))
    played = {r.name for r in experiments if (r.valid_runs["engine"] == column.engine).any()}
    for name, item in planned.items():
        if column.engine != plan.engine or name in {results.name for results in used}:
            continue
        text = f"nothing played, {item.runs} runs per combination were planned"
        if name in played:
            text = "played, but no number could be taken from its runs"
        found.append(PlanLine(f"{name}: {text}.", bad=True))
    return found + _devices(plan, column.runs)


def _planned_later(plan: PaperPlan, column: Column) -> dict[str, PlannedLater]:
    """Returns the experiments whose runs `later` waits for, where other orderings do not use
    them."""
    items = {contrast: item for item in plan.later for contrast in item.decides}
    found: dict[str, PlannedLater] = {}
    others: set[str] = set()
    for ordering in column.orderings:
        names = {name for chain in ordering.chains for _, m in chain for name, _ in m.keys}
        if (item := items.get(ordering.contrast.id)) is None:
            others |= names
        else:
            found |= dict.fromkeys(sorted(names), item)
    return {name: item for name, item in found.items() if name not in others}


def _later_lines(results: Results, item: PlannedLater, behind: set[str]) -> list[PlanLine]:
    found = [PlanLine(f"{results.name} is what the plan waited for: {item.waits_for}.")]
    if (fewest := _fewest(results, behind)) < item.runs:
        found.append(PlanLine(f"{_too_few(results, fewest, item.runs)}.", bad=True))
    return found


def _fewest(results: Results, behind: set[str]) -> int:
    """Returns the runs of the combination with the fewest, among those that are used."""
    runs = results.runs[results.runs["run_key"].isin(behind)]
    return int(runs.groupby("cell").size().min()) if len(runs) else 0


def _too_few(results: Results, fewest: int, planned: int) -> str:
    there = f"{fewest} run{'' if fewest == 1 else 's'} of a combination"
    return f"{results.name}: {there}, {planned} were planned"


def experiments_behind(column: Column) -> set[str]:
    """Returns the experiments that numbers and orderings take their runs from."""
    return {name for name, _ in _keys(column)}


def _keys(column: Column) -> set[tuple[str, str]]:
    cells = (m for o in column.orderings for chain in o.chains for _, m in chain)
    return {
        key for m in (*(row.measured for row in column.rows.values()), *cells) for key in m.keys
    }


def _own(column: Column, used: list[Results]) -> pd.DataFrame:
    """Returns the runs behind numbers and orderings."""
    if "experiment_folder" not in column.runs:
        return column.runs.head(0)
    return column.runs[column.runs["experiment_folder"].isin({r.name for r in used})]


def _counted(reported: Mapping[str, int], runs: pd.DataFrame) -> str:
    count = sum(reported.values())
    return f"{count} of {len(runs)} runs {'was' if count == 1 else 'were'}"


def cells_behind(column: Column) -> set[str]:
    """Returns the run keys of all cells that a number or an ordering uses, including runs that a
    number leaves out, such as lost ones."""
    used = {key for _, key in _keys(column)}
    runs = column.runs
    if "experiment_folder" not in runs:
        return used
    cells = runs["experiment_folder"].astype(str) + "\n" + runs["cell"].astype(str)
    return set(runs["run_key"][cells.isin(set(cells[runs["run_key"].isin(used)]))])


def _made(plan: PaperPlan, runs: pd.DataFrame) -> list[PlanLine]:
    """Returns when and under which plan the runs were executed, from their manifests. A plan that
    was rewritten after the results, with its old date, has another digest. Runs with the same
    deviation share one sentence."""
    times = [_time(value) for value in runs["started_utc"]] if "started_utc" in runs else []
    early = [time is not None and plan.made_before(time) for time in times] or [False] * len(runs)
    plans, mappings = (_written(runs, f"{k}.{plan.paper}") for k in ("plan", "plan_frozen"))
    stories = Counter(zip(early, plans, mappings, strict=True))
    found = [
        PlanLine(f"{count} of {len(runs)} runs {reported}.", bad=True)
        for (before, digest, frozen), count in stories.items()
        if (reported := _story(plan, before, digest, frozen, count))
    ]
    if unknown := sum(time is None for time in times):
        text = f"{unknown} of {len(times)} runs do not say when they were made."
        found.append(PlanLine(text, bad=True))
    return found


def _story(plan: PaperPlan, before: bool, digest: str, frozen: str, count: int) -> str:
    """Returns how these runs deviate from the plan; empty if they do not."""
    parts = ["before the plan was written"] if before else []
    if digest and digest != plan.digest:
        parts.append(f"under another plan ({digest})")
    if frozen and frozen != plan.frozen:
        parts.append(f"with another mapping than the plan's ({frozen})")
    message = f"{'was' if count == 1 else 'were'} made {' and '.join(parts)}" if parts else ""
    if not digest:
        do = "does" if count == 1 else "do"
        unknown = f"{do} not say under which plan {'it was' if count == 1 else 'they were'} made"
        message = f"{message}, and {unknown}" if message else unknown
    if before and digest and digest != plan.digest:
        message += ": the plan was written anew after them"
        if plan.replaces is not None and plan.replaces.plan == digest:
            message += f". {plan.replaces.why.rstrip('.')}"
    return message


def written_in(runs: pd.DataFrame, key: str) -> "Counter[str]":
    """Counts the values of a manifest key over the runs; empty for runs without it."""
    return Counter(_written(runs, key))


def _written(runs: pd.DataFrame, key: str) -> list[str]:
    """Returns the value of a manifest key of each run; empty for runs without it."""
    values = runs[key] if key in runs else [None] * len(runs)
    return [value if isinstance(value, str) else "" for value in values]


def _time(value: object) -> datetime | None:
    if not isinstance(value, str):
        return None
    try:
        found = datetime.fromisoformat(value.replace("Z", "+00:00"))
    except ValueError:
        return None
    return found if found.tzinfo is not None else found.replace(tzinfo=UTC)


def _devices(plan: PaperPlan, runs: pd.DataFrame) -> list[PlanLine]:
    found = []
    for role, name in plan.devices.items():
        key = f"device_{role}"
        used = runs[key].dropna().astype(str) if key in runs else pd.Series(dtype=str)
        other = used[used != name]
        if not len(other):
            continue
        names = sorted(set(other))
        more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
        where = ", ".join(sorted(set(runs.loc[other.index, "experiment_folder"].astype(str))))
        text = (
            f"The {role} was {', '.join(names[:NAMED])}{more} in {len(other)} of {len(runs)} runs"
        )
        found.append(PlanLine(f"{text} ({where}), {name} was planned.", bad=True))
    return found


NAMED = 3
"""How many devices are named; the others are counted."""


def plan_words(lines: list[PlanLine], plan: PaperPlan | None, ran: bool = True) -> str:
    """Returns the plan's digest and the number of deviations, for one line of text."""
    if plan is None:
        return "no plan"
    wrong = sum(line.bad for line in lines)
    if not ran and not wrong:
        return f"plan {plan.digest[:8]}"
    things = f"{wrong} thing{'' if wrong == 1 else 's'}"
    return f"plan {plan.digest[:8]}" + (f" ({things} not as planned)" if wrong else " kept")
