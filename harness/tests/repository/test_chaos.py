# SPDX-License-Identifier: Apache-2.0
"""The short form of tools/chaos.py: a campaign meets a few faults, and the same command then
finishes it. For virtual runs, every file then has the bytes of a campaign without faults."""

from pathlib import Path

import pytest
from chaos_campaign import NODES, OF_KIND, Torment
from chaos_faults import IN_DOCKER, MARKS
from chaos_instants import WITHIN_ENTRIES, Instants
from chaos_place import Place
from harness_parts import needs_root
from virtual_parts import needs_programs

from slambed.engines.helper import CAPABILITIES, container_role

FAULTS = (
    *("kill -9 harness", "kill -9 worker", "kill -9 node", "kill -9 fork server", "SIGSTOP node"),
    *("disk full", "no inodes", "folder read-only"),
)


def test_a_fast_host_meets_as_many_faults() -> None:
    """No time passes: only the ledger's entries set the time."""
    instants, struck = Instants("any", every_s=1e9), 0
    instants.call(0)
    instants.executes(0.0)
    for entries in range(1, 9):
        while instants.due(0.0, entries):
            instants.drawn(0.0, struck=True)
            struck += 1
    assert 8 / WITHIN_ENTRIES - 1 <= struck < 8
    instants.call(8)
    assert not instants.due(0.0, 8), "the next call has not come on yet"
    assert instants.due(0.0, 8 + WITHIN_ENTRIES)
    instants.drawn(0.0, struck=False)
    assert instants.due(0.0, 8 + WITHIN_ENTRIES), "it has met nothing"


def test_faults_of_docker_strike_every_container_of_a_run() -> None:
    struck = {fault.target for fault, _ in OF_KIND["docker"] if fault.act in IN_DOCKER}
    assert struck == {*NODES, *map(container_role, CAPABILITIES)}
    assert set(CAPABILITIES) <= set(MARKS)


@needs_programs
@pytest.mark.parametrize(
    ("jobs", "faults"), [(2, 2), pytest.param(8, 4, marks=pytest.mark.nightly)]
)
def test_a_campaign_under_faults_ends_as_if_there_were_none(
    jobs: int, faults: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    place = Place(tmp_path, "virtual", runs=faults // 2)
    asked = Torment("virtual", 5, jobs, faults, every_s=0.2, figures=False, only=FAULTS)
    outcome = place.play(asked)
    assert outcome.problems == []
    assert outcome.struck, "no fault met anything"


@pytest.mark.live
@pytest.mark.nightly
@needs_root
@needs_programs
def test_a_live_campaign_under_faults_is_finished_by_the_same_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    place = Place(tmp_path, "live")
    outcome = place.play(Torment("live", 3, 1, 3, every_s=2.0, figures=False))
    assert outcome.problems == []
    assert outcome.struck, "no fault met anything"
