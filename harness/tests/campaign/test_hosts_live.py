# SPDX-License-Identifier: Apache-2.0
"""Live runs on stand-in hosts (`stand_in_host`), over real ssh, with real nodes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from command_line import slambed_process
from harness_parts import is_valid_run, needs_root, nodes_of_tests
from stand_in_host import StandInHost
from virtual_parts import make_sequence, needs_programs, write_experiment

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.errors import ExitCode
from slambed.records.manifest import Manifest

# Campaigns on other machines with a timeout of PATIENCE_S.
pytestmark = [pytest.mark.live, pytest.mark.timeout(900), needs_root, needs_programs]
RUNS = 4
EXPERIMENT = """\
id: walk
title: A short walk on other machines
systems: [{{system: orbslam2, label: alone}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
devices: {{mobile: host}}
runs: {{default: {runs}}}
tolerances: {tolerances}
"""
PATIENCE_S = 300.0
ENDS_S = 30.0
"""Timeout for the end of a campaign that waits for a host."""


@pytest.fixture
def hosts(tmp_path: Path) -> Iterator[list[StandInHost]]:
    # Each stand-in has its own lock; that of this machine keeps other campaigns away.
    with nodes_of_tests():
        found = [StandInHost(name, tmp_path / "hosts") for name in ("a", "b")]
        try:
            for host in found:
                host.start()
            yield found
        finally:
            for host in found:
                host.close()


def arguments(tmp_path: Path, hosts: list[StandInHost]) -> list[str]:
    """Arguments of a campaign without retries: the validity of runs on a busy host is not
    tested."""
    file = tmp_path / "hosts.yaml"
    environment = {"SLAMBED_CACHE": str(tmp_path / "cache")}
    entries = [host.entry(environment=environment, labels=["loopback"]) for host in hosts]
    file.write_text(yaml.safe_dump({"hosts": entries}))
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 2), RUNS, EXPERIMENT)
    return [
        "run", str(path), "--hosts", str(file), "--results", str(tmp_path / "results"),
        "--retries", "0", "--no-figures",
    ]  # fmt: skip


@pytest.mark.nightly
def test_a_host_that_loses_power_costs_one_attempt_and_nothing_is_made_twice(
    tmp_path: Path, hosts: list[StandInHost]
) -> None:
    command = arguments(tmp_path, hosts)
    folder = ResultFolder(tmp_path / "results" / "walk")
    ledger = Ledger(folder.path / "ledger.jsonl")
    campaign = subprocess.Popen(
        [sys.executable, "-c", "from slambed.commands.main import main; main()", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"SLAMBED_CACHE": str(tmp_path / "cache")},
    )
    deadline = time.monotonic() + PATIENCE_S
    while not any(e["event"] == "run_started" and e["host"] == "b" for e in ledger.read()):
        assert campaign.poll() is None and time.monotonic() < deadline, campaign.communicate()[0]
        time.sleep(0.05)
    time.sleep(1.0)  # its nodes are running
    hosts[1].kill()
    out, _ = campaign.communicate(timeout=PATIENCE_S)
    assert campaign.returncode in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), out
    assert "host b is gone" in out

    entries = ledger.read()
    finished = [e["run_key"] for e in entries if e["event"] == "run_finished"]
    assert sorted(finished) == folder.run_keys() and len(finished) == RUNS
    failed = [e for e in entries if e["event"] == "run_failed"]
    assert [e["host"] for e in failed] == ["b"]
    for key in folder.run_keys():
        facts = Manifest.read(folder.store.runs / key / "manifest.json")
        assert facts is not None and facts.host is not None
        assert (facts.host.name, facts.host.labels) == ("a", ["loopback"])
        if not is_valid_run(folder.store.summary(key), attempts=1):
            continue
        assert facts.outcome == "completed", facts.outcome_reason
        assert (folder.runs / key / "trajectory.txt").is_file()
        assert (folder.runs / key / "events.parquet").is_file()
    assert ",host," in (folder.path / "summary.csv").read_text().splitlines()[0]
    # The hosts' cgroups have no leftovers of the runs before and after its death.
    left = [path for group in hosts[0]._groups for path in group.rglob("*") if path.is_dir()]
    assert not [path for path in left if path.name != "slambed"]

    # A repeated call with the remaining host has nothing to do.
    code, again, err = slambed_process(*command, "--on", "a", SLAMBED_CACHE=str(tmp_path / "cache"))
    assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), err
    if code == ExitCode.OK:
        assert f"{RUNS} there already" in again, err


def test_a_host_that_another_campaign_has_is_refused_in_a_line(
    tmp_path: Path, hosts: list[StandInHost]
) -> None:
    command = arguments(tmp_path, hosts)
    lock = "import fcntl, time; f = open('/run/lock/slambed.lock', 'w'); fcntl.flock(f, 2); "
    entry = hosts[0].entry()
    ssh = ["ssh", *entry["ssh"], str(entry["address"])]  # type: ignore[misc]
    other = subprocess.Popen(
        [*ssh, f'python3 -c "{lock} print(1, flush=True); time.sleep(600)"'],
        stdout=subprocess.PIPE,
    )
    try:
        assert other.stdout is not None and other.stdout.readline() == b"1\n"
        code, _, err = slambed_process(*command, SLAMBED_CACHE=str(tmp_path / "cache"))
        # A dry run takes no host.
        dry, out, reported = slambed_process(
            *command, "--dry-run", SLAMBED_CACHE=str(tmp_path / "cache")
        )
        assert dry == ExitCode.OK and f"{RUNS} runs to execute" in out, reported
        with subprocess.Popen(
            [
                sys.executable,
                "-c",
                "from slambed.commands.main import main; main()",
                *command,
                "--wait",
            ],
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"SLAMBED_CACHE": str(tmp_path / "cache")},
            # Default SIGINT, as from a terminal, even if the tests were started in the background.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        ) as waiting:
            try:
                assert waiting.stdout is not None
                line = next(line for line in waiting.stdout if "waiting" in line)
                waiting.send_signal(signal.SIGINT)
                assert waiting.wait(ENDS_S) != 0
            finally:
                waiting.kill()
        assert line.startswith("host a: waiting: another live campaign runs on this host")
    finally:
        other.kill()
        other.wait()
    assert code == ExitCode.ENVIRONMENT, err
    (line,) = (line for line in err.splitlines() if line.startswith("error: "))
    assert "host a: another live campaign runs on this host" in line
    assert not (tmp_path / "results" / "walk").exists()


def test_a_machine_that_is_not_there_is_reported(tmp_path: Path, hosts: list[StandInHost]) -> None:
    command = arguments(tmp_path, hosts)
    file = tmp_path / "hosts.yaml"
    for host, word in ((hosts[1], "refused"), (hosts[0], "no slambed in /nowhere")):
        if host is hosts[1]:
            host.kill()
            entry = host.entry()
        else:
            entry = host.entry(slambed="/nowhere")
        file.write_text(yaml.safe_dump({"hosts": [entry]}))
        code, _, err = slambed_process(*command)
        assert code == ExitCode.ENVIRONMENT and word in err, err
        assert err.startswith(f"error: host {host.name}: ") and err.count("\n") == 1
