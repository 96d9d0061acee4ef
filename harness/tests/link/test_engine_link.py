# SPDX-License-Identifier: Apache-2.0
"""Two local nodes connected by the real relay; skipped without the relay."""

import threading
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from harness_parts import is_valid, is_valid_run, needs_root, nodes_of_tests, run_spec, stand_in
from virtual_parts import Quiet

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.live_executor import LiveExecutor
from slambed.campaign.runner import Runner
from slambed.engines.live_run import LiveRun
from slambed.engines.local import LocalEngine
from slambed.errors import SlambedError
from slambed.link.helper_link import HelperLinkOpener
from slambed.link.named_profile import backend_for, read_profile
from slambed.link.relay import RelayShaper
from slambed.link.run_link import RunLink, open_for_run
from slambed.native import find_program
from slambed.spec.experiment import Playback
from slambed.spec.run_spec import LinkSpec

RAMP = {"name": "up", "rtt_ms": {"ramp": {"from_ms": 10, "to_ms": 30, "rise_s": 2}}}


def relay_is_built() -> bool:
    try:
        find_program("slambed-relay")
    except SlambedError:
        return False
    return Path("/dev/net/tun").exists()


pytestmark = [
    needs_root,
    pytest.mark.skipif(not relay_is_built(), reason="needs slambed-relay ('make build') and TUN"),
]


def test_a_run_records_what_its_link_delivered(tmp_path: Path) -> None:
    profile = read_profile(RAMP, "here")
    link = LinkSpec(
        backend=backend_for("relay", profile), profile=profile.name, content=profile.content
    )
    spec = run_spec(edge=True, link=link, profile="up", playback=Playback(fps=10.0, end_s=2.0))
    raw, sequence = tmp_path / "raw", tmp_path / "sequence"
    raw.mkdir()
    sequence.mkdir()
    engine = LocalEngine(stand_in(tmp_path))
    live = LiveRun(spec, engine, sequence, 2.0, raw, open_for_run, threading.Event())
    with nodes_of_tests():
        result = live.execute()
    assert result.link is not None and result.link.backend == "relay"
    if not is_valid(result.invalid_reasons):
        return
    assert result.outcome == "completed"
    log = pd.read_parquet(raw / "link" / "link.parquet")
    probes = log[(log["series"] == "probe_rtt_ms") & (log["t_s"].between(0, 2))]
    assert len(probes) > 20
    # The kernel of the nodes sees the rising latency; its accuracy is tested elsewhere.
    assert probes["value"].median() > 12
    assert result.link.proof.asked_ms_mean == pytest.approx(20, abs=2)


def test_a_relay_killed_in_mid_run_is_an_outcome_and_the_campaign_goes_on(tmp_path: Path) -> None:
    profile = read_profile(RAMP, "here")
    link = LinkSpec(backend="relay", profile=profile.name, content=profile.content)
    plan: dict[str, Any] = {"edge": True, "link": link, "profile": "up"}
    todo = [
        run_spec(**plan, repetition=n, seed=n, playback=Playback(fps=10.0, end_s=2.0))
        for n in range(2)
    ]
    killed: list[int] = []

    def open_and_kill_the_first(*asked: Any) -> RunLink:
        opened = open_for_run(*asked)
        shaper = opened._session._shaper
        assert isinstance(shaper, RelayShaper)
        if not killed:
            killed.append(shaper._process.pid)
            threading.Timer(2.0, shaper._process.kill).start()
        return opened

    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    (tmp_path / "sequence").mkdir()
    executor = LiveExecutor(
        LocalEngine(stand_in(tmp_path)),
        open_and_kill_the_first,
        {"room": (tmp_path / "sequence", 2.0)},
    )
    with nodes_of_tests():
        runner = Runner(folder, Ledger(folder.path / "ledger.jsonl"), executor, retries=0)
        verdict = runner.run(todo, Quiet())
    assert (verdict.done, verdict.interrupted) == (2, False)
    first, second = (folder.summary(spec.run_key) for spec in todo)
    manifest = folder.manifest(todo[0].run_key)
    assert first is not None and second is not None and manifest is not None
    assert first["valid"] is False
    assert "the link ended in the middle of the run" in first["invalid_reason"]
    assert "the link ended in the middle of the run" in manifest.invalid_reasons
    assert "signal 9" in manifest.link.died
    # The mobile node's result is available: it played to its end.
    assert first["frames_total"] == 20
    if is_valid_run(second, attempts=1):
        assert second["outcome"] == "completed" and second["frames_total"] == 20


KILLED_ONCE = """#!/bin/sh
if [ -e {flag} ]; then exec {relay} "$@"; fi
touch {flag}
{before}
kill -9 $$
"""
READY = '{"ready": true, "pid": 1, "real_time": false}'
AT_SET_UP = {"at once": "", "after it was ready": f"echo '{READY}'; sleep 0.1"}


@pytest.mark.parametrize("before", AT_SET_UP.values(), ids=AT_SET_UP)
@pytest.mark.parametrize("helper", [False, True], ids=["itself", "helper"])
def test_a_relay_killed_at_set_up_costs_an_attempt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str, helper: bool
) -> None:
    """Also if a helper holds the link, whose report is unchanged. A relay that was ready removes
    its devices."""
    relay, programs = find_program("slambed-relay"), tmp_path / "bin"
    programs.mkdir()
    script = programs / "slambed-relay"
    script.write_text(KILLED_ONCE.format(flag=tmp_path / "flag", relay=relay, before=before))
    script.chmod(0o755)
    monkeypatch.setenv("SLAMBED_BIN", str(programs))
    profile = read_profile(RAMP, "here")
    link = LinkSpec(backend="relay", profile=profile.name, content=profile.content)
    spec = run_spec(edge=True, link=link, profile="up")
    engine = LocalEngine(stand_in(tmp_path))
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    (tmp_path / "sequence").mkdir()
    opener = HelperLinkOpener(engine) if helper else open_for_run
    executor = LiveExecutor(engine, opener, {"room": (tmp_path / "sequence", 0.5)})
    ledger = Ledger(folder.path / "ledger.jsonl")
    with nodes_of_tests():
        runner = Runner(folder, ledger, executor, retries=0, pauses_s=(0.01,))
        verdict = runner.run([spec], Quiet())
    assert (verdict.done, verdict.given_up) == (1, {})
    (failed,) = (entry for entry in ledger.read() if entry["event"] == "run_failed")
    assert "slambed-relay ended" in failed["error"] and "signal 9" in failed["error"]
    summary = folder.summary(spec.run_key)
    assert summary is not None
    if is_valid_run(summary, attempts=1):
        assert summary["outcome"] == "completed"
