# SPDX-License-Identifier: Apache-2.0
"""Ledger, order, result folder, and campaigns that are interrupted in the middle."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from command_line import refused, slambed
from data_samples import write_prepared
from harness_parts import IdleLink, needs_root, nodes_of_tests, run_spec, stand_in, write_library

from slambed.campaign import plan as planning
from slambed.campaign.datasets import prepare_sequence
from slambed.campaign.executors import LiveExecutor
from slambed.campaign.folder import ResultFolder
from slambed.campaign.further import further_repetitions
from slambed.campaign.ledger import Ledger
from slambed.campaign.order import interleaved
from slambed.campaign.plan import Plan, make_plan, repetitions
from slambed.campaign.progress import duration
from slambed.campaign.runner import Runner, stop_on_signal
from slambed.campaign.status import status_of
from slambed.data import places
from slambed.data.recipe import Playback as DatasetPlayback
from slambed.engines.host_lock import host_lock
from slambed.engines.local import LocalEngine
from slambed.errors import ExitCode, SlambedError
from slambed.spec.experiment import Playback
from slambed.spec.library import Library
from slambed.spec.matrix import RunSpec


def specs(cells: int = 2, runs: int = 2, **changes: Any) -> list[RunSpec]:
    return [
        run_spec(cell=f"c{cell}", params={"x": cell}, repetition=r, seed=r, **changes)
        for cell in range(cells)
        for r in range(runs)
    ]


class Quiet:
    """A reporter that remembers."""

    def __init__(self) -> None:
        self.verdicts: list[str] = []

    def run_started(self, spec: RunSpec) -> None: ...

    def run_ended(self, spec: RunSpec, verdict: str) -> None:
        self.verdicts.append(verdict)

    def run_failed(self, spec: RunSpec, why: str, last: bool) -> None:
        self.verdicts.append(why)


def finished(folder: ResultFolder, spec: RunSpec, trusted: bool = True) -> None:
    raw = folder.new_raw(spec.run_key)
    (raw / "manifest.json").write_text(json.dumps({"spec": spec.model_dump(mode="json")}))
    (raw / "summary.json").write_text(json.dumps({"trusted": trusted, "distrust": "why"}))
    folder.commit(spec.run_key, raw)


def test_order_interleaves_and_repeats_itself() -> None:
    wanted = specs(cells=5, runs=3)
    first = interleaved(wanted, seed=1)
    assert [s.repetition for s in first] == [0] * 5 + [1] * 5 + [2] * 5
    assert interleaved(list(reversed(wanted)), seed=1) != first[::-1]
    assert interleaved(wanted, seed=1) == first
    assert interleaved(wanted, seed=2) != first
    assert [s.cell for s in first[:5]] != [s.cell for s in first[5:10]]


def test_order_of_the_first_repetitions_does_not_depend_on_later_ones() -> None:
    wanted = specs(cells=5, runs=3)
    fewer = [spec for spec in wanted if spec.repetition < 2]
    assert interleaved(wanted, 1)[:10] == interleaved(fewer, 1)


def test_ledger_survives_a_torn_line(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path / "ledger.jsonl")
    assert ledger.read() == []
    ledger.append("run_started", run_key="a")
    with ledger.path.open("a") as out:
        out.write('{"event": "run_fini')
    ledger.append("run_started", run_key="a")
    assert [entry["event"] for entry in ledger.read()] == ["run_started"] * 2
    assert ledger.attempts("a") == 2


def test_a_run_folder_is_whole_or_missing(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    spec = run_spec()
    key = spec.run_key
    assert folder.state(key) == "missing"
    raw = folder.new_raw(key)
    (raw / "manifest.json").write_text("{}")
    (raw / "summary.json").write_text('{"trusted": true}')
    (raw / "mobile").mkdir()
    (raw / "mobile" / "trajectory.txt").write_text("0 0 0 0 0 0 0 1\n")
    (raw / "mobile" / "log.txt").write_text("hello\n")
    (raw / "events.parquet").write_bytes(b"x")
    assert folder.state(key) == "missing"
    folder.commit(key, raw)
    assert folder.state(key) == "trusted"
    place = folder.runs / key
    found = sorted(p.relative_to(place).as_posix() for p in place.rglob("*") if p.is_file())
    assert found == [
        "events.parquet",
        "manifest.json",
        "nodes/mobile/log.txt",
        "summary.json",
        "trajectory.txt",
    ]
    folder.close()
    assert list((tmp_path / ".work").iterdir()) == [tmp_path / ".work" / ".lock"]
    (place / "summary.json").write_text('{"trusted": tr')
    assert folder.state(key) == "missing"


def test_a_new_attempt_replaces_an_untrusted_one_which_is_kept(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    spec = run_spec()
    for number in (1, 2):
        finished(folder, spec, trusted=False)
        assert folder.state(spec.run_key) == "untrusted"
        assert folder.store.attempts_of(spec.run_key) == number
    finished(folder, spec, trusted=True)
    assert folder.state(spec.run_key) == "trusted"
    assert folder.store.attempts_of(spec.run_key) == 3
    kept = tmp_path / "attempts" / spec.run_key
    assert sorted(path.name for path in kept.iterdir()) == ["1", "2"]
    inode = (folder.store.runs / spec.run_key).stat().st_ino
    finished(folder, spec, trusted=False)  # a campaign beside that one was slower
    assert (folder.store.runs / spec.run_key).stat().st_ino == inode
    assert folder.run_keys() == [spec.run_key]


def test_a_view_is_left_and_entered_without_moving_a_run(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    wanted, other_sources = specs(cells=1, runs=2), run_spec(cell="c0", software="older")
    for spec in (*wanted, other_sources):
        finished(folder, spec)
    inodes = {key: (folder.store.runs / key).stat().st_ino for key in folder.run_keys()}
    folder.show([other_sources.run_key])
    assert folder.run_keys() == [other_sources.run_key]
    folder.show(spec.run_key for spec in wanted)
    assert folder.run_keys() == sorted(spec.run_key for spec in wanted)
    assert {key: (folder.store.runs / key).stat().st_ino for key in inodes} == inodes


def test_further_repetitions_of_the_same_cell_are_found_by_their_keys(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    made = specs(cells=2, runs=4)
    for spec in made[:4]:  # all of c0
        finished(folder, spec)
    finished(folder, run_spec(cell="c1", params={"x": 1}, repetition=3, seed=3))
    planned = [spec for spec in made if spec.repetition < 2]
    assert further_repetitions(folder.store, planned) == made[2:4]


def test_runs_of_the_older_layout_get_their_place_in_the_store(tmp_path: Path) -> None:
    for place, key in (("runs", "a" * 16), ("stale", "b" * 16)):
        run = tmp_path / "tiny" / place / key
        run.mkdir(parents=True)
        for name in ("manifest.json", "summary.json"):
            (run / name).write_text('{"trusted": true}')
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    assert folder.store.keys() == ["a" * 16, "b" * 16]
    assert folder.run_keys() == ["a" * 16]


def test_a_campaign_leaves_the_work_of_a_living_one_and_removes_that_of_a_dead_one(
    tmp_path: Path,
) -> None:
    alive, later = ResultFolder(tmp_path / "one"), ResultFolder(tmp_path / "two")
    alive.create()
    raw = alive.new_raw("0" * 16)
    dead = tmp_path / ".work" / "4711-dead"
    dead.mkdir()
    (dead / ".lock").touch()
    later.create()
    assert raw.is_dir() and not dead.exists()
    for folder in (alive, later):
        folder.close()


def test_status_tells_missing_and_untrusted_runs(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    wanted = specs(cells=1, runs=3)
    finished(folder, wanted[0])
    finished(folder, wanted[1], trusted=False)
    (folder.runs / "foreign").mkdir()
    runs = [{"run_key": s.run_key, **s.model_dump(mode="json")} for s in wanted]
    folder.write_json("experiment.json", {"runs": runs, "software": "test", "file": {}})
    found = status_of(tmp_path, "tiny", None, {"test"})
    cell = found.cells[0]
    assert (cell.trusted, len(cell.untrusted), cell.missing) == (1, 1, 1)
    assert "why" in cell.untrusted[0]
    assert not found.complete
    assert any("foreign: not a run of this experiment" in line for line in found.notes)
    newer = status_of(tmp_path, "tiny", None, {"newer"})
    assert any("sources have changed" in line for line in newer.notes)


def test_what_no_plan_names_can_be_freed(tmp_path: Path) -> None:
    folder = ResultFolder(tmp_path / "tiny")
    folder.create()
    wanted, left = specs(cells=1, runs=2), run_spec(cell="c0", software="older")
    for spec in (*wanted, left):
        finished(folder, spec)
    runs = [{"run_key": s.run_key, **s.model_dump(mode="json")} for s in wanted]
    folder.write_json("experiment.json", {"runs": runs})
    folder.close()
    place = ("--results", str(tmp_path))
    code, out, _ = slambed("results", "size", *place)
    assert code == ExitCode.OK and "tiny: 2 runs" in out and "in no plan: 1 runs" in out
    code, out, _ = slambed("results", "prune", *place)
    assert code == ExitCode.OK and "would remove 1 runs" in out and len(folder.store.keys()) == 3
    code, out, _ = slambed("results", "prune", "--yes", *place)
    assert code == ExitCode.OK and folder.store.keys() == sorted(s.run_key for s in wanted)
    (folder.path / "experiment.json").write_text("{")
    assert "is not whole" in refused(ExitCode.BAD_INPUT, "results", "prune", "--yes", *place)


def test_status_of_nothing_says_how_to_begin(tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="slambed run tiny"):
        status_of(tmp_path, "tiny", None, set())


def test_a_second_campaign_is_told_who_runs(tmp_path: Path) -> None:
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


def plan_with(datasets: list[str], root: Path, **changes: Any) -> Plan:
    text = json.dumps(
        {"id": "tiny", "title": "Tiny", "systems": [{"system": "solo"}], "datasets": datasets,
         "devices": {"mobile": "small"}, **changes}
    )  # fmt: skip
    write_library(root, text)
    library = Library(root)
    experiment, source = library.experiment("tiny")
    return make_plan(experiment, source, library, [], "local", "test", 2)


def test_a_dataset_that_is_not_here_ends_the_experiment_or_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(places, "search_path", lambda: [tmp_path / "nothing"])
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    here = str(write_prepared(tmp_path / "here").path)
    with pytest.raises(SlambedError, match=r"'kitti_07_left' not found.*line"):
        plan_with(["kitti_07_left", here], tmp_path)
    plan = plan_with(["kitti_07_left", here], tmp_path, missing_datasets="skip")
    assert {spec.dataset for spec in plan.specs} == {"tiny"}
    assert len(plan.specs) == 2
    assert len(plan.left_out) == 1 and "SLAMBED_DATA" in plan.left_out[0]
    with pytest.raises(SlambedError, match="no dataset of"):
        plan_with(["kitti_07_left"], tmp_path, missing_datasets="skip")
    # A name that nobody knows is a mistake, not missing data.
    with pytest.raises(SlambedError, match="not known"):
        plan_with(["kiti_07", here], tmp_path, missing_datasets="skip")


def test_a_dataset_has_playback_for_what_an_experiment_leaves_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    sequence = prepare_sequence(str(write_prepared(tmp_path / "here").path))
    own = replace(sequence, defaults=DatasetPlayback(fps=5.0, start_s=0.1))
    assert sequence.playback(Playback(fps=10.0)) == Playback(fps=10.0)
    assert own.playback(Playback(end_s=0.3)) == Playback(fps=5.0, start_s=0.1, end_s=0.3)
    assert own.playback(Playback(fps=10.0)).fps == 10.0
    assert own.played_s(Playback()) == pytest.approx(sequence.played_s(Playback()) - 0.1)
    with pytest.raises(SlambedError, match="does not go with the experiment's"):
        own.playback(Playback(end_s=0.05))
    # What a run means has what its dataset said.
    monkeypatch.setattr(planning, "prepare_sequence", lambda name: own)
    assert {s.playback.fps for s in plan_with(["here"], tmp_path).specs} == {5.0}


def test_a_fault_after_the_end_of_a_sequence_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLAMBED_CACHE", str(tmp_path / "cache"))
    here = str(write_prepared(tmp_path / "here").path)
    helped: dict[str, Any] = {
        "systems": [{"system": "pair"}],
        "devices": {"mobile": "small", "edge": "big"},
        "link": {"backend": "relay", "profiles": [0]},
    }
    plan = plan_with([here], tmp_path, **helped, faults=[{"at_s": 0.2, "edge": "kill"}])
    assert plan.specs[0].faults
    with pytest.raises(SlambedError, match=r"kill at 0.3 s: playback is over at 0.3 s"):
        plan_with([here], tmp_path, **helped, faults=[{"at_s": 0.3, "edge": "kill"}])


@pytest.mark.parametrize(("asked", "count"), [(None, 2), ("default", 2), ("paper", 100), ("5", 5)])
def test_repetitions(tmp_path: Path, asked: str | None, count: int) -> None:
    write_library(tmp_path)
    experiment, _ = Library(tmp_path).experiment("tiny")
    assert repetitions(experiment, asked) == count
    for bad in ("0", "-1", "many"):
        with pytest.raises(SlambedError, match="--runs"):
            repetitions(experiment, bad)


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
    assert (verdict.done, verdict.trusted, verdict.not_completed, verdict.interrupted) == (
        2,
        2,
        1,
        False,
    )
    assert "5/5 frames tracked" in reporter.verdicts[0]
    assert "died: mobile node: signal 11" in reporter.verdicts[1]
    manifest = campaign.folder.read(good.run_key, "manifest.json")
    assert manifest is not None
    for key in (
        "commit", "dirty", "image_id", "sequence_checksum", "kernel", "cpu_model", "cores",
        "seed", "started_utc", "limits", "throttling", "versions", "spec", "command",
    ):  # fmt: skip
        assert key in manifest, key
    assert RunSpec.model_validate(manifest["spec"]) == good
    events = [entry["event"] for entry in campaign.ledger.read()]
    assert events == ["run_started", "run_finished"] * 2


@needs_root
def test_a_node_that_refuses_its_input_is_a_result(tmp_path: Path) -> None:
    campaign = runner(tmp_path)
    refused = run_spec(params={"mobile_act": "refuse"})
    with nodes_of_tests():
        verdict = campaign.run([refused, run_spec()], Quiet())
    assert (verdict.done, verdict.trusted, verdict.not_completed) == (2, 2, 1)
    summary = campaign.folder.read(refused.run_key, "summary.json") or {}
    assert (summary["outcome"], summary["coverage"], summary["lost"]) == ("refused", 0.0, None)
    assert "bad parameter" in summary["outcome_reason"]


@dataclass
class Greedy:
    """An executor whose runs write until nothing fits any more."""

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
sys.path.insert(0, {tests!r})
import test_campaign as t
from slambed.engines.reaper import mark_children, reap
mark_children()
with t.host_lock("tests of interrupts", wait_s=300):
    print("reaped", reap(), flush=True)
    campaign = t.runner(Path({folder!r}))
    todo = [s for s in t.specs() if campaign.folder.state(s.run_key) != "trusted"]
    print("todo", len(todo), flush=True)
    verdict = campaign.run(todo, t.Quiet())
    print("interrupted" if verdict.interrupted else "complete", flush=True)
"""


def start_campaign(tmp_path: Path) -> subprocess.Popen[str]:
    code = CAMPAIGN.format(tests=str(Path(__file__).parent), folder=str(tmp_path))
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def wait_for_runs(tmp_path: Path, count: int) -> None:
    """Until `count` runs are there and the next one has begun to play."""
    folder = ResultFolder(tmp_path / "tiny")
    deadline = time.monotonic() + 330
    while time.monotonic() < deadline:
        playing = list((tmp_path / ".work").glob("*/*/start.json"))
        if len(folder.run_keys()) >= count and playing:
            return
        time.sleep(0.01)
    raise AssertionError("the campaign does not come on")


@needs_root
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_campaign_goes_on_where_it_was(tmp_path: Path, how: signal.Signals) -> None:
    first = start_campaign(tmp_path)
    wait_for_runs(tmp_path, 1)
    first.send_signal(how)
    told, _ = first.communicate(timeout=20)
    assert ("interrupted" in told) == (how == signal.SIGINT)
    folder = ResultFolder(tmp_path / "tiny")
    done = {key: (folder.runs / key).stat().st_ino for key in folder.run_keys()}
    assert 1 <= len(done) < 4
    second = start_campaign(tmp_path)
    told, _ = second.communicate(timeout=360)
    assert f"todo {4 - len(done)}" in told and "complete" in told
    assert sorted(folder.run_keys()) == sorted(s.run_key for s in specs())
    # What was there was not touched.
    assert all((folder.runs / key).stat().st_ino == inode for key, inode in done.items())
    if how == signal.SIGKILL:
        assert "control groups" in told
    entries = Ledger(folder.path / "ledger.jsonl").read()
    assert sum(entry["event"] == "run_finished" for entry in entries) == 4
    assert not processes_of(tmp_path)


def processes_of(folder: Path) -> list[str]:
    """Command lines that mention the folder (every node's does)."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = path.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if f"{folder}/" in line and "--role" in line:
            found.append(line)
    return found


def test_an_interrupt_is_answered_at_once(capfd: pytest.CaptureFixture[str]) -> None:
    with stop_on_signal() as stop:
        os.kill(os.getpid(), signal.SIGINT)
        assert stop.wait(1)
        assert capfd.readouterr().err.strip().startswith("stopping: ending the runs under way")
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1)
