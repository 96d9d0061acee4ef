# SPDX-License-Identifier: Apache-2.0
"""Live campaigns (engine local, a stand-in node) with failures of their environment."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from harness_parts import IdleLink, needs_root, nodes_of_tests, run_spec, stand_in
from virtual_parts import Quiet
from waiting import in_background

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.live_executor import LiveExecutor
from slambed.campaign.runner import Runner
from slambed.engines.local import LocalEngine
from slambed.engines.sidecar_client import MODULE
from slambed.spec.run_spec import RunSpec

pytestmark = needs_root


@pytest.fixture
def campaign(tmp_path: Path) -> Iterator[Runner]:
    (tmp_path / "sequence").mkdir()
    folder = ResultFolder(tmp_path / "results" / "tiny")
    folder.create()
    engine = LocalEngine(stand_in(tmp_path))
    played = {"room": (tmp_path / "sequence", 0.5)}
    with nodes_of_tests():
        yield Runner(
            folder,
            Ledger(folder.path / "ledger.jsonl"),
            LiveExecutor(engine, lambda *_: IdleLink(), played),
            pauses_s=(0.1, 0.2),
        )
    folder.close()


def runs(count: int) -> list[RunSpec]:
    return [run_spec(seed=n, repetition=n) for n in range(count)]


def kill_samplers(over: threading.Event, may: Callable[[], bool]) -> None:
    """Kills samplers like the kernel's OOM killer."""
    while not over.wait(0.02):
        for child in psutil.Process().children():
            with contextlib.suppress(psutil.NoSuchProcess):  # nor a zombie
                if MODULE in child.cmdline() and may():
                    child.kill()


def events_of(campaign: Runner, spec: RunSpec) -> list[str]:
    return [e["event"] for e in campaign.ledger.read() if e.get("run_key") == spec.run_key]


def run_with_killer(campaign: Runner, todo: list[RunSpec], may: Callable[[], bool]) -> None:
    over = threading.Event()
    with in_background(lambda: kill_samplers(over, may), over):
        campaign.run(todo, Quiet())


def test_a_sampler_that_is_killed_costs_its_run_an_attempt(campaign: Runner) -> None:
    todo, killed = runs(3), []

    def once() -> bool:
        killed.append(1)
        return len(killed) == 1

    run_with_killer(campaign, todo, once)
    assert campaign.folder.run_keys() == sorted(spec.run_key for spec in todo)
    failed = [e for e in campaign.ledger.read() if e["event"] == "run_failed"]
    assert len(failed) == 1 and failed[0]["error"].startswith("the sampler ended")
    assert events_of(campaign, todo[0])[:2] == ["run_started", "run_failed"]
    assert events_of(campaign, todo[0])[-1] == "run_finished"


def test_a_run_that_always_loses_its_sampler_is_given_up_and_the_others_go_on(
    campaign: Runner,
) -> None:
    todo = runs(3)
    unlucky = todo[1].run_key

    def in_hand() -> bool:
        started = [e for e in campaign.ledger.read() if e["event"] == "run_started"]
        return bool(started) and started[-1]["run_key"] == unlucky

    run_with_killer(campaign, todo, in_hand)
    verdict = campaign.run([], Quiet())
    assert verdict.done == 2 and list(verdict.given_up) == [unlucky]
    assert verdict.given_up[unlucky].startswith("the sampler ended")
    assert events_of(campaign, todo[1]) == ["run_started", "run_failed"] * 3
    assert campaign.folder.state(unlucky) == "missing"
