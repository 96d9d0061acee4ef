# SPDX-License-Identifier: Apache-2.0
"""`--force` and `--keep-going`: repeated runs, and failures that do not end the campaign."""

import json
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from harness_parts import run_spec
from virtual_parts import Quiet

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.run_plan import chosen, preview
from slambed.campaign.runner import Runner
from slambed.errors import SlambedError
from slambed.metrics.summary import Summary
from slambed.spec.run_spec import RunSpec


@dataclass
class Scripted:
    """Ends each run with the next entry of its list: an error, or whether it is valid."""

    script: dict[int, list[SlambedError | bool]] = field(default_factory=dict)
    jobs: int = 1
    executed: int = 0

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        steps = self.script.get(spec.seed, [])
        step = steps.pop(0) if steps else True
        if isinstance(step, SlambedError):
            raise step
        self.executed += 1
        summary = Summary(valid=step, outcome="completed", number=self.executed)
        for name in ("manifest.json", "summary.json"):
            (raw / name).write_text(json.dumps(summary))
        return summary

    def close(self) -> None: ...


def campaign(tmp_path: Path, executor: Scripted, **options: Any) -> Runner:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    return Runner(folder, Ledger(folder.path / "ledger.jsonl"), executor, **options)


def number(runner: Runner, spec: RunSpec) -> object:
    return (runner.folder.summary(spec.run_key) or {}).get("number")


def test_a_forced_run_takes_the_place_of_a_valid_one_which_is_kept(tmp_path: Path) -> None:
    spec, executor = run_spec(), Scripted()
    campaign(tmp_path, executor).run([spec], Quiet())
    again = campaign(tmp_path, executor, forced=frozenset({spec.run_key}))
    again.run([spec], Quiet())
    assert number(again, spec) == 2
    assert again.folder.store.attempts_of(spec.run_key) == 2
    kept = tmp_path / "attempts" / spec.run_key / "1" / "summary.json"
    assert json.loads(kept.read_text())["number"] == 1


def test_a_forced_run_that_is_invalid_takes_no_place(tmp_path: Path) -> None:
    spec, executor = run_spec(), Scripted({1: [True, False, False]})
    campaign(tmp_path, executor).run([spec], Quiet())
    forced = frozenset({spec.run_key})
    again = campaign(tmp_path, executor, forced=forced, retries=1)
    again.run([spec], Quiet())
    assert executor.executed == 3 and number(again, spec) == 1


def test_without_force_a_valid_run_stays(tmp_path: Path) -> None:
    spec, executor = run_spec(), Scripted()
    campaign(tmp_path, executor).run([spec], Quiet())
    again = campaign(tmp_path, executor)
    again.run([spec], Quiet())
    assert number(again, spec) == 1


def test_keep_going_executes_what_it_can_although_everything_fails_at_first(
    tmp_path: Path,
) -> None:
    todo = [run_spec(seed=n, repetition=n) for n in range(9)]
    broken: list[SlambedError | bool] = [SlambedError("no such device")]
    script = {n: list(broken) for n in range(8)}
    with pytest.raises(SlambedError, match="no such device"):
        campaign(tmp_path / "a", Scripted(dict(script))).run(todo, Quiet())
    script = {n: list(broken) for n in range(8)}
    going = campaign(tmp_path / "b", Scripted(script), keep_going=True)
    verdict = going.run(todo, Quiet())
    assert (verdict.done, len(verdict.given_up)) == (1, 8)
    assert going.folder.run_keys() == [todo[8].run_key]


def test_the_preview_counts_forced_runs_as_missing(tmp_path: Path) -> None:
    spec, executor = run_spec(), Scripted()
    runner = campaign(tmp_path, executor)
    runner.run([spec], Quiet())
    store, kept = runner.folder.store, ("valid",)
    assert preview([spec], store, kept, 1.0, 1)[0] == "solo: 1 of 1 runs there"
    forced = frozenset({spec.run_key})
    assert preview([spec], store, kept, 1.0, 1, forced)[0] == "solo: 0 of 1 runs there"
    with pytest.raises(SlambedError, match="--force pair is no combination"):
        chosen([spec], ["pair"], "--force")
