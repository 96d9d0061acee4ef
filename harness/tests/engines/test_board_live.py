# SPDX-License-Identifier: Apache-2.0
"""Runs with the mobile node on a stand-in board (`stand_in_board`): its own Docker over real
ssh, a real network and its own clock. The edge is on this host."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from command_line import slambed_process
from harness_parts import is_valid_run, needs_root
from stand_in_board import CLOCK_AHEAD_S, StandInBoard
from test_campaign_end_to_end import image_is_built
from virtual_parts import make_sequence, needs_programs, write_experiment

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.engines.board.connection import BoardConnection
from slambed.engines.board.leftovers import clean_boards
from slambed.engines.host_lock import host_lock
from slambed.errors import ExitCode, SlambedError
from slambed.records.manifest import Manifest
from slambed.spec.board import RoleHost

pytestmark = [
    # A booting board, and campaigns on it with a timeout of PATIENCE_S.
    pytest.mark.timeout(900),
    pytest.mark.live,
    needs_root,
    needs_programs,
    pytest.mark.skipif(not image_is_built(), reason="needs the node image ('make images')"),
]
EXPERIMENT = """\
id: walk
title: A short walk with a board
systems:
  - {{system: orbslam2, label: alone}}
  - {{system: edgeslam, variant: static, label: offloaded, params: {{sync_period_s: 1.0}}}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{profiles: [none]}}
devices: {{mobile: raspberry_pi_4, edge: host}}
runs: {{default: {runs}}}
tolerances: {tolerances}
"""
PATIENCE_S = 300.0
TRUE_OFFSET_NS = CLOCK_AHEAD_S * 1_000_000_000


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StandInBoard]:
    found = StandInBoard(tmp_path_factory.mktemp("board"), "pi4")
    try:
        found.start()
        yield found
    finally:
        found.close()


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def command(
    tmp_path: Path, board: StandInBoard, engine: str, runs: int = 1, seconds: int = 4
) -> list[str]:
    """Command of a campaign without retries: the validity of runs on a busy machine is not
    tested."""
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", seconds), runs, EXPERIMENT)
    role = json.dumps({"mobile": board.role()})
    return [
        "run", str(path), "--set", f"roles={role}", "--engine", engine, "--wait",
        "--results", str(tmp_path / "results"), "--retries", "0", "--no-figures",
    ]  # fmt: skip


def left_on(board: StandInBoard) -> str:
    """Lists leftover containers and volumes of runs."""
    kept = board.over_ssh("docker", "ps", "--all", "--quiet", "--filter", "label=slambed").stdout
    volumes = board.over_ssh("docker", "volume", "ls", "--quiet", "--filter", "label=slambed")
    return kept + volumes.stdout


@pytest.mark.parametrize("engine", [pytest.param("docker", marks=pytest.mark.nightly), "local"])
def test_the_mobile_node_runs_on_the_board_and_its_edge_here(
    tmp_path: Path, cache: Path, board: StandInBoard, engine: str
) -> None:
    arguments = command(tmp_path, board, engine)
    code, out, err = slambed_process(*arguments)
    assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), err
    assert "devices.mobile (raspberry_pi_4) is not applied" in out
    assert "Mobile nodes on a real board" in out
    folder = ResultFolder(tmp_path / "results" / "walk")
    assert len(folder.run_keys()) == 2
    for key in folder.run_keys():
        run = folder.store.runs / key
        facts = Manifest.read(run / "manifest.json")
        assert facts is not None and facts.board is not None, out
        assert facts.host is not None and facts.host.name == facts.board.name == "pi4"
        assert (facts.board.address, facts.board.edge_address) == (board.address, board.here)
        summary = json.loads((run / "summary.json").read_text())
        assert summary["device_mobile"] == "pi4"
        if not is_valid_run(summary, attempts=1):
            continue
        assert facts.outcome == "completed", summary["outcome_reason"]
        clocks = facts.board.clocks
        assert clocks is not None and clocks.after is not None
        for expected in (clocks.before, clocks.after):
            assert abs(expected.offset_ns - TRUE_OFFSET_NS) <= expected.error_ns < 5_000_000
        assert summary["frames_tracked"] > 10
        assert summary["mobile_cpu_percent_mean"] > 0 and summary["mobile_mem_mb_peak"] > 1
        samples = pd.read_parquet(run / "samples.parquet").query("node == 'mobile'")
        # On the run clock, not on the clock of the board, which booted much earlier.
        assert samples["t_s"].min() > -10 and samples["t_s"].max() < 60
        assert np.all(np.diff(samples["cpu_s"]) >= 0)
        if summary["device_edge"] is None:
            continue
        assert facts.link is not None and facts.link.backend == "network"
        assert 0 < summary["rtt_measured_ms_mean"] < 100 and summary["rtt_error_ms_median"] is None
        assert samples["tcp_rtt_ms"].notna().any()
        events = (
            pd.read_parquet(run / "events.parquet")
            .query("type == 'message'")
            .dropna(subset=["sent_ns", "received_ns"])
        )
        error_ns = 1e6 * clocks.error_ms
        assert len(events) and (events["received_ns"] - events["sent_ns"] >= -error_ns).all()
    assert left_on(board) == ""
    assert not list((cache / "boards").glob("*"))
    again = slambed_process(*arguments)
    assert "2 there already" in again[1]
    # A result of the board does not count for this host.
    roles = next(word for word in arguments if word.startswith("roles="))
    here = ["roles=null" if word == roles else word for word in arguments]
    code, out, err = slambed_process(*here, "--dry-run")
    assert code == ExitCode.OK and "2 runs to execute" in out, err


def campaign_on(board: StandInBoard, arguments: list[str]) -> "subprocess.Popen[str]":
    """Starts a campaign and waits until its mobile node runs on the board."""
    process = subprocess.Popen(
        [sys.executable, "-c", "from slambed.commands.main import main; main()", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ.copy(),
    )
    running = ("docker", "ps", "--quiet", "--filter", "label=slambed.role=mobile")
    deadline = time.monotonic() + PATIENCE_S
    while not board.over_ssh(*running).stdout:
        assert process.poll() is None and time.monotonic() < deadline, process.communicate()[0]
        time.sleep(0.2)
    return process


def test_what_a_killed_campaign_left_on_a_board_is_removed(
    tmp_path: Path, cache: Path, board: StandInBoard
) -> None:
    process = campaign_on(board, command(tmp_path, board, "local", seconds=30))
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert left_on(board) != ""
    assert len(list((cache / "boards").glob("*.json"))) == 1
    reported: list[str] = []
    with host_lock("tests of boards", wait_s=PATIENCE_S):
        deadline = time.monotonic() + PATIENCE_S
        # Its ssh may need a moment to notice the lost connection.
        while left_on(board):
            assert time.monotonic() < deadline, reported
            clean_boards(reported.append)
    assert "board pi4: removed 1 containers, 1 volumes" in reported
    assert not list((cache / "boards").glob("*"))


@pytest.mark.nightly
def test_a_board_that_loses_power_costs_an_attempt_and_gets_its_runs_when_it_is_back(
    tmp_path: Path, cache: Path, board: StandInBoard
) -> None:
    process = campaign_on(board, command(tmp_path, board, "local", seconds=8))
    board.kill()
    folder = ResultFolder(tmp_path / "results" / "walk")
    ledger = Ledger(folder.path / "ledger.jsonl")
    deadline = time.monotonic() + PATIENCE_S
    try:
        while not any(entry["event"] == "run_failed" for entry in ledger.read()):
            assert process.poll() is None and time.monotonic() < deadline, process.communicate()[0]
            time.sleep(0.1)
    finally:
        board.start()
    out, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), out
    assert "board pi4 is gone" in out and "removed what a killed campaign left" in out
    entries = ledger.read()
    failed = [entry["error"] for entry in entries if entry["event"] == "run_failed"]
    assert failed[0].startswith("board pi4 is gone")
    finished = [entry["run_key"] for entry in entries if entry["event"] == "run_finished"]
    assert sorted(finished) == folder.run_keys() and len(finished) == 2
    assert left_on(board) == ""


def test_a_board_has_one_campaign_at_a_time(cache: Path, board: StandInBoard) -> None:
    role = RoleHost.model_validate(board.role())
    first = BoardConnection(role)
    try:
        with pytest.raises(SlambedError, match="board pi4: another live campaign runs there"):
            BoardConnection(role)
        assert first.compare_clocks().over == "udp"
    finally:
        first.close()


@contextlib.contextmanager
def firewall(board: StandInBoard, *words: str) -> Iterator[None]:
    """Drops some incoming packets."""
    rule = ("INPUT", *words, "-j", "DROP")
    assert board.over_ssh("/usr/sbin/iptables", "-A", *rule).returncode == 0
    try:
        yield
    finally:
        board.over_ssh("/usr/sbin/iptables", "-D", *rule)


def test_where_no_datagram_comes_through_clocks_are_compared_through_ssh(
    cache: Path, board: StandInBoard
) -> None:
    with firewall(board, "-p", "udp"):
        connection = BoardConnection(RoleHost.model_validate(board.role()))
        try:
            found = connection.compare_clocks()
        finally:
            connection.close()
    assert found.over == "ssh" and found.exchanges == 40
    assert abs(found.offset_ns - TRUE_OFFSET_NS) <= found.error_ns


def test_a_board_whose_rtt_nobody_can_measure_is_refused(
    tmp_path: Path, cache: Path, board: StandInBoard
) -> None:
    with firewall(board, "-p", "icmp"):
        code, _, err = slambed_process(*command(tmp_path, board, "local"))
    assert code == ExitCode.ENVIRONMENT
    assert f"board pi4: no ICMP echo comes back from {board.address}" in err, err


@pytest.mark.parametrize(
    ("machine", "docker", "expected"),
    [
        ("i686", True, "board odd is i686, for which there is no node image"),
        ("", False, "board odd has no Docker that answers: "),
    ],
)
def test_a_board_that_is_not_fit_is_one_line(
    tmp_path: Path, cache: Path, machine: str, docker: bool, expected: str
) -> None:
    odd = StandInBoard(tmp_path / "odd", "odd", machine, docker)
    try:
        odd.start()
        code, _, err = slambed_process(*command(tmp_path, odd, "local"))
    finally:
        odd.close()
    assert code == ExitCode.ENVIRONMENT and expected in err, err
    assert len([line for line in err.splitlines() if line.startswith("error: ")]) == 1
    assert not (tmp_path / "results" / "walk" / "runs").exists()


def test_experiment_files_may_name_the_board_themselves(
    tmp_path: Path, cache: Path, board: StandInBoard
) -> None:
    arguments = command(tmp_path, board, "local")
    path = Path(arguments[1])
    path.write_text(path.read_text() + yaml.safe_dump({"roles": {"mobile": board.role()}}))
    code, out, err = slambed_process("run", str(path), "--check")
    assert code == ExitCode.OK and "board pi4 is the device itself" in out, err
