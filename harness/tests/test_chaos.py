# SPDX-License-Identifier: Apache-2.0
"""The short form of tools/chaos.py: a campaign of virtual runs meets a handful of faults, and after
the same command again it has the bytes of one that met none."""

from pathlib import Path

import pytest
from chaos_campaign import Torment
from chaos_place import Place
from virtual_parts import needs_programs

FAULTS = (
    *("kill -9 harness", "kill -9 worker", "kill -9 node", "kill -9 fork server", "SIGSTOP node"),
    *("disk full", "no inodes", "folder read-only"),
)


@needs_programs
def test_a_campaign_under_faults_ends_as_if_there_were_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    place = Place(tmp_path, "virtual", runs=2)
    outcome = place.play(Torment("virtual", 5, 8, 4, every_s=0.2, figures=False, only=FAULTS))
    assert outcome.problems == []
    assert outcome.struck, "no fault met anything"
