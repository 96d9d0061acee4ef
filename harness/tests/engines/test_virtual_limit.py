# SPDX-License-Identifier: Apache-2.0
"""The time limit of a virtual run: exceeding the CPU time is an outcome, idling is an error."""

import contextlib
import json
import os
import re
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Event

import psutil
import pytest
from harness_parts import stand_in_sim, virtual_spec
from waiting import in_background, until

from slambed.engines.virtual import VirtualRun
from slambed.engines.written_bytes import KEPT_BYTES
from slambed.errors import ExitCode, PassingError
from slambed.spec.experiment import Playback
from slambed.spec.run_spec import LinkSpec


@pytest.fixture
def run_of(tmp_path: Path) -> Callable[[str], VirtualRun]:
    """A run with a limit of 2 s of CPU time and 1.5 s of idling."""

    def make(act: str) -> VirtualRun:
        (tmp_path / "raw").mkdir()
        spec, program = virtual_spec(params={"sim_act": act}), stand_in_sim(tmp_path)
        return VirtualRun(spec, tmp_path, 0.1, tmp_path / "raw", program, None, 0.0, 1.5)

    return make


def simulation() -> psutil.Process | None:
    """Returns the run's process; zombies of other tests have no command line."""
    for child in psutil.Process().children():
        with contextlib.suppress(psutil.ZombieProcess, psutil.NoSuchProcess):
            if "sim.json" in child.cmdline():
                return child
    return None


def test_a_run_that_computes_for_too_long_has_timed_out(
    run_of: Callable[[str], VirtualRun],
) -> None:
    # Independent of the CPU time that the host provides: idling is not tested here.
    result = replace(run_of("burn"), idle_limit_s=300.0).execute(threading.Event())
    assert result.outcome == "timed_out"
    assert result.reason == "slambed-sim had not finished after 2 s of CPU time"
    assert simulation() is None


def test_a_run_that_stands_still_is_a_failure_that_may_pass(
    run_of: Callable[[str], VirtualRun],
) -> None:
    with pytest.raises(PassingError, match=r"computed .* in 2 s: it waits, was") as raised:
        run_of("hang").execute(threading.Event())
    assert raised.value.code == ExitCode.ENVIRONMENT
    assert simulation() is None


def test_a_host_that_leaves_a_run_little_time_changes_no_outcome(
    run_of: Callable[[str], VirtualRun],
) -> None:
    """It is stopped for longer than its limit, and still gets its two seconds of CPU time."""
    run, spent = replace(run_of("burn"), idle_limit_s=300.0), []
    began_s = time.monotonic()

    def starve() -> None:
        found = until(simulation, "the simulation")
        assert found is not None
        os.kill(found.pid, signal.SIGSTOP)
        time.sleep(3.0)
        spent.append(sum(found.cpu_times()[:2]))
        os.kill(found.pid, signal.SIGCONT)

    with in_background(starve):
        result = run.execute(threading.Event())
    assert result.outcome == "timed_out"
    assert spent[0] < 2.0 and time.monotonic() - began_s > 3.0 + 2.0 - spent[0]


def test_a_run_that_writes_without_end_has_died_of_that(tmp_path: Path) -> None:
    (tmp_path / "raw").mkdir()
    spec = virtual_spec(params={"sim_act": "flood"}, max_run_mb=30)
    program = stand_in_sim(tmp_path)
    run = VirtualRun(spec, tmp_path, 0.1, tmp_path / "raw", program, None)
    result = run.execute(threading.Event())
    assert result.outcome == "died"
    reason = r"it wrote more than 30 MiB \(max_run_mb of the experiment\): .* log\.txt with \d+ MiB"
    assert re.fullmatch(reason, result.reason or ""), result.reason
    assert simulation() is None
    assert (tmp_path / "raw" / "log.txt").stat().st_size <= KEPT_BYTES


def test_the_limit_is_part_of_the_key_where_it_is_not_the_usual_one() -> None:
    """It decides the outcome of a run; a run without it keeps the key it had before."""
    usual, other = virtual_spec(), virtual_spec(max_run_mb=30)
    assert "max_run_mb" not in usual.meaning() and usual.run_key != other.run_key


def test_a_link_that_never_settles_goes_on_as_long_as_a_live_run_may_last(tmp_path: Path) -> None:
    wave = {"sine": {"mean_ms": 20, "amplitude_ms": 10, "period_s": 4}}
    link = LinkSpec(backend="virtual", profile="wave", content={"rtt_ms": wave})
    for mode, factor in (("realtime", 1), ("every_frame", 10)):
        spec = virtual_spec(link=link, playback=Playback(mode=mode))
        raw = tmp_path / mode
        raw.mkdir()
        VirtualRun(spec, tmp_path, 5.0, raw, stand_in_sim(tmp_path), None).execute(Event())
        delays = json.loads((raw / "sim.json").read_text())["link"]["up"]["delay_us"]
        assert (len(delays) - 1) * 0.01 == 5.0 * factor + 30.0
