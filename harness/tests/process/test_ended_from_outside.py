# SPDX-License-Identifier: Apache-2.0
"""A node killed or stopped from outside says nothing about the system: the run is invalid or
costs an attempt, and the campaign continues."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from harness_parts import IdleLink, needs_root, nodes_of_tests, run_spec
from test_engine_local import Bench
from waiting import in_background, until

from slambed.engines import launcher, local
from slambed.errors import KilledError, PassingError, environment_error
from slambed.process.endings import ended_from_outside, signal_of


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with nodes_of_tests():
        yield Bench(tmp_path)


@pytest.mark.parametrize(
    ("code", "number", "outside"),
    [
        (0, None, False),
        (3, None, False),
        (-9, 9, True),
        (137, 9, True),
        (143, 15, True),
        (-11, 11, False),
        (139, 11, False),
        (255, None, False),
    ],
)
def test_what_a_code_says_of_an_end(code: int, number: int | None, outside: bool) -> None:
    assert (signal_of(code), ended_from_outside(code)) == (number, outside)


@needs_root
@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (signal.SIGKILL, "was killed from outside (signal 9, SIGKILL)"),
        (signal.SIGTERM, "was asked to stop from outside"),
    ],
)
def test_a_mobile_ended_from_outside_is_no_result(
    bench: Bench, number: signal.Signals, expected: str
) -> None:
    def end() -> None:
        until((bench.folder / "raw" / "mobile" / "events.jsonl").exists, "the first events")
        assert bench.live is not None
        os.kill(bench.live._nodes["mobile"].pid, number)

    playback = run_spec().playback.model_copy(update={"end_s": 1.5})
    with in_background(end):
        result = bench.run(run_spec(playback=playback))
    assert (result.outcome, result.reason) == ("died", f"mobile node: {expected}")
    assert result.invalid_reasons == [f"the mobile node {expected}"]


@needs_root
def test_a_node_killed_at_the_start_barrier_costs_an_attempt(bench: Bench) -> None:
    def kill_the_edge(*_: Any) -> IdleLink:
        assert bench.live is not None
        node = bench.live._nodes["edge"]
        os.kill(node.pid, signal.SIGKILL)
        until(lambda: node.exit_code() is not None, "the end of the edge")
        raise environment_error("no such namespace")

    bench.open_link = kill_the_edge  # type: ignore[method-assign]
    with pytest.raises(KilledError, match="the edge node was killed at its start barrier"):
        bench.run(run_spec(edge=True))


BARRIERS = {
    # Replacement of the launcher -> the error and its message.
    "import time; time.sleep(60)": (PassingError, "did not reach the start barrier within 1 s"),
    "import os; os.kill(os.getpid(), 9)": (KilledError, "it was killed .signal 9, SIGKILL"),
}


@needs_root
@pytest.mark.parametrize("code", BARRIERS)
def test_who_does_not_reach_the_start_barrier(
    bench: Bench, code: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Slowness and kills are temporary; only a kernel's refusal is final (tests of engine
    local)."""
    program = bench.folder / "launcher.py"
    program.write_text(code)
    monkeypatch.setattr(launcher, "__file__", str(program))
    monkeypatch.setattr(local, "BARRIER_TIMEOUT_S", 1.0)
    kind, line = BARRIERS[code]
    with pytest.raises(kind, match=line):
        bench.run(run_spec())
