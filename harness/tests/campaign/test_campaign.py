# SPDX-License-Identifier: Apache-2.0
"""Campaigns of live nodes: committed one by one, on a full disk, interrupted during a run."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from harness_parts import IdleLink, needs_root, nodes_of_tests, run_spec, specs, stand_in

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.live_executor import LiveExecutor
from slambed.campaign.progress import duration
from slambed.campaign.runner import Runner, stop_on_signal
from slambed.engines.host_lock import host_lock
from slambed.engines.local import LocalEngine
from slambed.errors import ExitCode, SlambedError
from slambed.spec.run_spec import RunSpec


class Quiet:
    """A reporter that remembers."""

    def __init__(self) -> None:
        self.verdicts: list[str] = []

    def run_started(self, spec: RunSpec) -> None: ...

    def run_ended(self, spec: RunSpec, verdict: str) -> None:
        self.verdicts.append(verdict)

    def run_failed(self, spec: RunSpec, why: str, last: bool) -> None:
        self.verdicts.append(why)


def test_a_second_campaign_is_reported_who_runs(tmp_path: Path) -> None:
    lock = tmp_path / "lock"
    with host_lock("slambed run one", lock):
        holder = rf"slambed run one \(process {os.getpid()}\)"
        with pytest.raises(SlambedError, match=holder) as caught, host_lock("two", lock):
            pass
        assert caught.value.code == ExitCode.ENVIRONMENT
    with host_lock("slambed run two", lock):
        pass


def test_durations_read_well() -> None:
    assert [duration(s) for s in (12.4, 200, 3900)] == ["12 s", "3 min 20 s", "1 h 05 min"]


def runner(tmp_path: Path) -> Runner:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    (tmp_path / "sequence").mkdir(exist_ok=True)
    return Runner(
        folder,
        Ledger(folder.path / "ledger.jsonl"),
        LiveExecutor(
            LocalEngine(stand_in(tmp_path)),
            lambda *_: IdleLink(),
            {"room": (tmp_path / "sequence", 0.5)},
        ),
    )


@needs_root
def test_runs_are_committed_one_by_one_with_their_manifest(tmp_path: Path) -> None:
    campaign, reporter = runner(tmp_path), Quiet()
    good, bad = run_spec(), run_spec(params={"mobile_act": "die"})
    with nodes_of_tests():
        verdict = campaign.run([good, bad], reporter)
    assert (verdict.done, verdict.valid, verdict.not_completed, verdict.interrupted) == (
        2,
        2,
        1,
        False,
    )
    assert "5/5 frames tracked" in reporter.verdicts[0]
    assert "died: mobile node: signal 11" in reporter.verdicts[1]
    logs = Path(reporter.verdicts[1].partition("logs: ")[2])
    assert (logs / "mobile" / "log.txt").is_file() and "logs" not in reporter.verdicts[0]
    manifest = campaign.folder.manifest(good.run_key)
    assert manifest is not None
    for key in (
        "commit", "dirty", "tree", "image_id", "sequence_checksum", "kernel", "cpu_model", "cores",
        "seed", "started_utc", "limits", "throttling", "versions", "spec", "command",
    ):  # fmt: skip
        assert key in manifest.model_fields_set, key
    written = json.loads((campaign.folder.runs / good.run_key / "manifest.json").read_text())
    assert RunSpec.model_validate(written["spec"]) == good
    events = [entry["event"] for entry in campaign.ledger.read()]
    assert events == ["run_started", "run_finished"] * 2


@needs_root
def test_a_node_that_refuses_its_input_is_a_result(tmp_path: Path) -> None:
    campaign = runner(tmp_path)
    refused = run_spec(params={"mobile_act": "refuse"})
    with nodes_of_tests():
        verdict = campaign.run([refused, run_spec()], Quiet())
    assert (verdict.done, verdict.valid, verdict.not_completed) == (2, 2, 1)
    summary = campaign.folder.summary(refused.run_key) or {}
    assert (summary["outcome"], summary["coverage"], summary["lost"]) == ("refused", 0.0, None)
    assert "bad parameter" in summary["outcome_reason"]


@dataclass
class Greedy:
    """An executor whose runs fill the disk."""

    jobs: int

    def execute(
        self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1
    ) -> dict[str, Any]:
        with (raw / "events.jsonl").open("wb") as out:
            while True:
                out.write(bytes(65536))

    def close(self) -> None: ...


@needs_root
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_full_disk_ends_the_campaign_in_one_line(tmp_path: Path, jobs: int) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1200k", "tmpfs", str(disk)]
    subprocess.run(mount, check=True)
    try:
        folder = ResultFolder(disk / "tiny")
        folder.create()
        campaign = Runner(folder, Ledger(folder.path / "ledger.jsonl"), Greedy(jobs))
        with pytest.raises(SlambedError, match=r"no space left on the disk of .*tiny") as caught:
            campaign.run(specs(), Quiet())
        assert caught.value.code == ExitCode.ENVIRONMENT
        assert folder.run_keys() == []
        folder.close()
    finally:
        subprocess.run(["umount", str(disk)], check=True)


CAMPAIGN = """
import sys
from pathlib import Path
sys.path[:0] = {tests!r}
import test_campaign as t
from slambed.engines.reaper import mark_children, reap
with t.host_lock("tests of interrupts", wait_s=120), mark_children():
    print("reaped", reap(), flush=True)
    campaign = t.runner(Path({folder!r}))
    todo = [s for s in t.specs() if campaign.folder.state(s.run_key) != "valid"]
    print("todo", len(todo), flush=True)
    verdict = campaign.run(todo, t.Quiet())
    print("interrupted" if verdict.interrupted else "complete", flush=True)
"""


def start_campaign(tmp_path: Path) -> subprocess.Popen[str]:
    code = CAMPAIGN.format(tests=sys.path, folder=str(tmp_path))
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def wait_for_runs(tmp_path: Path, count: int) -> None:
    """Waits until `count` runs exist and the next one has begun to play."""
    folder = ResultFolder(tmp_path / "tiny")
    deadline = time.monotonic() + 330
    while time.monotonic() < deadline:
        playing = list((tmp_path / ".work").glob("*/*/start.json"))
        if len(folder.run_keys()) >= count and playing:
            return
        time.sleep(0.01)
    raise AssertionError("the campaign does not come on")


@needs_root
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGHUP, signal.SIGKILL])
def test_an_interrupted_campaign_goes_on_where_it_was(tmp_path: Path, how: signal.Signals) -> None:
    first = start_campaign(tmp_path)
    wait_for_runs(tmp_path, 1)
    first.send_signal(how)
    reported, _ = first.communicate(timeout=20)
    assert ("interrupted" in reported) == (how != signal.SIGKILL)
    folder = ResultFolder(tmp_path / "tiny")
    done = {key: (folder.runs / key).stat().st_ino for key in folder.run_keys()}
    assert 1 <= len(done) < 4
    second = start_campaign(tmp_path)
    reported, _ = second.communicate(timeout=360)
    assert f"todo {4 - len(done)}" in reported and "complete" in reported
    assert sorted(folder.run_keys()) == sorted(s.run_key for s in specs())
    # Existing runs were not touched.
    assert all((folder.runs / key).stat().st_ino == inode for key, inode in done.items())
    if how == signal.SIGKILL:
        assert "control groups" in reported
    entries = Ledger(folder.path / "ledger.jsonl").read()
    assert sum(entry["event"] == "run_finished" for entry in entries) == 4
    assert not processes_of(tmp_path)


def processes_of(folder: Path) -> list[str]:
    """Returns the processes with the folder in their command line, which includes every node."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = path.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if f"{folder}/" in line and "--role" in line:
            found.append(line)
    return found


def test_a_campaign_in_a_thread_hears_no_signals_and_runs() -> None:
    """Python delivers them to the main thread only, and refuses handlers of others."""
    before = signal.getsignal(signal.SIGINT)

    def stopped() -> bool:
        with stop_on_signal() as stop:
            assert signal.getsignal(signal.SIGINT) is before
            return stop.is_set()

    with ThreadPoolExecutor(1) as threads:
        assert threads.submit(stopped).result() is False


def test_an_interrupt_is_answered_at_once(capfd: pytest.CaptureFixture[str]) -> None:
    with stop_on_signal() as stop:
        os.kill(os.getpid(), signal.SIGINT)
        assert stop.wait(1)
        assert capfd.readouterr().err.strip().startswith("stopping: ending the runs under way")
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1)
