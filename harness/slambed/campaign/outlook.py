# SPDX-License-Identifier: Apache-2.0
"""What is left of an experiment before its campaign, and how long it will take."""

from datetime import datetime
from pathlib import Path

from slambed.campaign.ledger import Ledger
from slambed.campaign.options import Options
from slambed.campaign.order import in_part
from slambed.campaign.overall import Outlook
from slambed.campaign.plan import check, planned_runs, repetitions
from slambed.campaign.plan_as_it_is import plan_as_it_is
from slambed.campaign.run_estimate import assumed_run_s, expected_run_s
from slambed.campaign.store import RunStore
from slambed.errors import SlambedError
from slambed.spec.device import VIRTUAL
from slambed.spec.library import Library

FEWEST_MEASURED = 3
"""Runs in a ledger from which their mean duration is used."""


def outlook(name: str, options: Options) -> Outlook:
    """Looks ahead without making or starting anything. Raises SlambedError for a mistake in the
    experiment's files, and for a dataset that is not on this machine."""
    library = Library()
    experiment, source = library.experiment(name, options.settings)
    asked = options.engine or experiment.engine
    check(experiment, source, library, asked)
    count = repetitions(experiment, options.runs)
    measured = mean_run_s(options.results / experiment.id / "ledger.jsonl")
    try:
        plan = plan_as_it_is(experiment, source, library, asked, count)
    except SlambedError:
        runs = planned_runs(experiment, source, library) // experiment.runs.default * count
        assumed = assumed_run_s(experiment.playback, asked == VIRTUAL)
        return Outlook(runs, runs, measured or assumed, is_counted=False)
    store = RunStore(options.results)
    specs = [spec for spec in plan.specs if in_part(spec.run_key, options.part)]
    missing = sum(store.state(spec.run_key) != "valid" for spec in specs)
    return Outlook(len(specs), missing, measured or expected_run_s(plan))


def mean_run_s(ledger: Path) -> float | None:
    """Returns the mean duration in s of the runs that a ledger saw start and finish; None with
    fewer than three."""
    began: dict[str, float] = {}
    times: list[float] = []
    for entry in Ledger(ledger).read():
        key, event = str(entry.get("run_key")), entry["event"]
        try:
            at_s = _seconds(str(entry["time_utc"]))
        except (KeyError, ValueError):
            continue
        if event == "run_started":
            began[key] = at_s
        elif event == "run_finished" and key in began:
            times.append(at_s - began.pop(key))
    return sum(times) / len(times) if len(times) >= FEWEST_MEASURED else None


def _seconds(time_utc: str) -> float:
    return datetime.fromisoformat(time_utc).timestamp()
