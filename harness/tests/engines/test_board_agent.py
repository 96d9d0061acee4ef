# SPDX-License-Identifier: Apache-2.0
"""The board's agent, executed here with the system's Python and without our packages."""

import json
import os
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from unittest.mock import Mock

import pytest

from slambed.engines.board.agent_source import LEAST_PYTHON, agent_source
from slambed.engines.board.connection import BoardConnection
from slambed.engines.board.engine import BoardEngine
from slambed.engines.board.messages import Sampled, Seen, Watching
from slambed.errors import ExitCode, SlambedError
from slambed.spec.board import RoleHost


def test_a_board_that_cannot_be_cleaned_costs_no_results(monkeypatch: pytest.MonkeyPatch) -> None:
    """The campaign has ended; the next one finds the record of the board."""
    told: list[str] = []
    connection = Mock()
    board = BoardEngine.__new__(BoardEngine)
    board._connection, board._notify, board._role = connection, told.append, Mock()

    def refuse(*_: object) -> str:
        raise SlambedError("cannot remove what runs left on board pi", ExitCode.ENVIRONMENT)

    monkeypatch.setattr("slambed.engines.board.engine.remove_left", refuse)
    board.close()
    assert told == [
        "not cleaned, the next campaign does it: cannot remove what runs left on board pi"
    ]
    assert connection.close.called and board._connection is None


def agent(*requests: object, pause_s: float = 0.0) -> list[dict[str, object]]:
    """Returns its answers, from a Python without our packages."""
    process = subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", agent_source()],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd="/",
        env={"PATH": os.environ["PATH"]},
    )
    assert process.stdin is not None and process.stdout is not None
    answers = []
    for request in requests:
        process.stdin.write(json.dumps(request).encode() + b"\n")
        process.stdin.flush()
        answers.append(json.loads(process.stdout.readline()))
        time.sleep(pause_s)
    process.stdin.close()
    assert process.wait(10) == 0
    process.stdout.close()
    return answers


def test_it_needs_nothing_but_python_and_reports_what_the_machine_is() -> None:
    before = time.monotonic_ns()
    seen, clock = agent({"request": "look"}, {"request": "clock"})
    found = Seen.model_validate(seen)
    assert found.architecture == os.uname().machine and found.kernel == os.uname().release
    assert found.cpus == sorted(os.sched_getaffinity(0)) and found.model
    assert before < int(str(clock["received_ns"])) <= int(str(clock["answered_ns"]))
    assert int(str(clock["answered_ns"])) < time.monotonic_ns()


def test_it_samples_a_process_until_it_is_asked_to_stop() -> None:
    asked = ({"request": "watch", "pid": os.getpid(), "ports": [47000]}, {"request": "start"})
    watching, _, reported = agent(*asked, {"request": "stop"}, pause_s=0.5)
    assert Watching.model_validate(watching).granted.period_ms > 0
    samples = Sampled.model_validate(reported).samples
    # A late sample is caught up with, so no sooner than every 0.1 s on average.
    assert len(samples) >= 2
    assert samples[-1].at_ns - samples[0].at_ns >= 0.09e9 * (len(samples) - 2)
    assert all(b.at_ns > a.at_ns and b.cpu_s >= a.cpu_s for a, b in pairwise(samples))
    assert all(sample.memory_mb >= 0 and sample.tcp_rtt_ms is None for sample in samples)


def test_what_it_cannot_do_is_an_answer_and_not_its_end() -> None:
    gone, seen = agent({"request": "watch", "pid": 2**22 + 1, "ports": []}, {"request": "look"})
    assert gone["reply"] == "failure" and "is gone" in str(gone["error"])
    assert seen["reply"] == "seen"


def test_a_python_that_is_too_old_is_reported() -> None:
    source = agent_source().replace(str(LEAST_PYTHON), "(4, 0)", 1)
    done = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("error: Python 3.10 is needed there")


@pytest.mark.parametrize(
    ("role", "expected"),
    [
        (RoleHost(host="127.0.0.1", name="pi4", ssh=["-p", "1", "-F", "none"]), "refused"),
        (RoleHost(host="nowhere.invalid", name="pi4", ssh=["-F", "none"]), "resolve"),
    ],
)
def test_a_board_that_is_not_there_is_one_line(
    role: RoleHost, expected: str, tmp_path: Path
) -> None:
    with pytest.raises(SlambedError) as raised:
        BoardConnection(role)
    line = str(raised.value)
    assert line.startswith("board pi4 does not answer: ") and expected in line and "\n" not in line
    assert raised.value.code == ExitCode.ENVIRONMENT
