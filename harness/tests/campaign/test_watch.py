# SPDX-License-Identifier: Apache-2.0
"""`slambed watch` reports on a running campaign without disturbing it."""

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import refused, slambed
from results_factory import RawRun, write_raw
from rich.console import Console
from virtual_parts import make_sequence, needs_programs, write_experiment
from waiting import until

from slambed.campaign.campaign_state import InHand
from slambed.campaign.ledger import Ledger
from slambed.campaign.run_in_hand import RECENT_S, Recent, RunFollower
from slambed.commands.watch_view import Sparkline, spark
from slambed.errors import ExitCode
from slambed.metrics.events import read_jsonl


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A campaign of this process with a run in progress: the files of a live campaign."""
    folder = tmp_path / "results"
    experiment = folder / "mine"
    experiment.mkdir(parents=True)
    (experiment / "experiment.json").write_text(json.dumps({"experiment": {"title": "My own"}}))
    ledger = Ledger(experiment / "ledger.jsonl")
    ledger.append("campaign_started", runs=5, todo=["k1", "k2", "k3"])
    ledger.append("run_started", run_key="k1", cell="sys/room/ramp", repetition=0)
    ledger.append("run_finished", run_key="k1", cell="sys/room/ramp", valid=True)
    ledger.append("run_started", run_key="k2", cell="sys/room/ramp", repetition=1)
    raw = RawRun(lost_at_s=((6.0, 7.5),))
    write_raw(folder / ".work" / f"{os.getpid()}-abcd" / "k2", raw)
    return folder


def raw_of(results: Path) -> Path:
    (found,) = (results / ".work").glob("*/k2")
    return found


def test_frames_state_losses_rtt_and_cpu_are_what_the_files_say(results: Path) -> None:
    raw = raw_of(results)
    found = RunFollower(InHand("k2", "x", 0.0), raw, 120).look(5.0)
    events, _ = read_jsonl(raw / "mobile" / "events.jsonl")
    frames = [e for e in events if e["type"] in ("frame_tracked", "frame_dropped")]
    tracked = [e for e in frames if e.get("state") == "ok"]
    assert (found.frames_played, found.frames_tracked) == (len(frames), len(tracked))
    assert 0 < len(tracked) < len(frames) < 120 + 1
    assert (found.track_losses, found.state, found.elapsed_s) == (1, "ok", 5.0)
    samples, _ = read_jsonl(raw / "samples.jsonl")
    last_s = samples[-1]["t_s"]
    for node in ("mobile", "edge"):
        own = [s["cpu_percent"] for s in samples if s["node"] == node and s["t_s"] > last_s - 1.0]
        assert found.nodes[node].cpu_percent == pytest.approx(sum(own) / len(own))
    assert found.nodes["mobile"].memory_mb == samples[-1]["memory_mb"]
    assert found.t_s == pytest.approx(max(last_s, events[-1]["t_ns"] / 1e9))


def test_what_comes_is_added_to_what_was_there(results: Path) -> None:
    path = raw_of(results) / "mobile" / "events.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    whole = RunFollower(InHand("k2", "x", 0.0), raw_of(results), None).look(0.0)
    path.write_bytes(b"".join(lines[: len(lines) // 2]) + lines[len(lines) // 2][:9])
    follower = RunFollower(InHand("k2", "x", 0.0), raw_of(results), None)
    half = follower.look(0.0)
    assert 0 < half.frames_played < whole.frames_played
    path.write_bytes(b"".join(lines))
    assert follower.look(0.0) == whole


def test_the_newest_rtt_and_node_state_are_reported(tmp_path: Path) -> None:
    (tmp_path / "mobile").mkdir()
    events = [
        {"t_ns": 1, "type": "state_changed", "from": "start", "to": "OS"},
        {"t_ns": 2, "type": "rtt_sample", "rtt_ms": 10.0},
        {"t_ns": 3, "type": "rtt_sample", "rtt_ms": 44.5},
        {"t_ns": 4, "type": "state_changed", "from": "OS", "to": "MES"},
    ]
    text = "".join(json.dumps(event) + "\n" for event in events)
    (tmp_path / "mobile" / "events.jsonl").write_text(text)
    found = RunFollower(InHand("k", "x", 0.0), tmp_path, None).look(0.0)
    assert (found.rtt_ms, found.node_state, found.state) == (44.5, "MES", None)


def test_one_look_shows_queue_and_run(results: Path) -> None:
    code, out, err = slambed("watch", "--once", "--results", str(results), COLUMNS="100")
    assert (code, err) == (ExitCode.OK, "")
    assert "mine: My own" in out
    assert "1 of 3 runs done, 1 in hand, 1 left, 2 were there before, about" in out
    assert "sys/room/ramp #2 (k2)" in out and "1 track losses" in out
    assert re.search(r"mobile +CPU \d+ % of a core, \d+ MiB", out) and "edge" in out


def test_curves_of_the_last_seconds_are_beside_the_numbers(results: Path) -> None:
    samples, _ = read_jsonl(raw_of(results) / "samples.jsonl")
    found = RunFollower(InHand("k2", "x", 0.0), raw_of(results), None).look(0.0)
    last_second = int(samples[-1]["t_s"])
    for node in ("mobile", "edge"):
        own = [
            s["cpu_percent"] for s in samples if (s["node"], s["t_s"] // 1) == (node, last_second)
        ]
        assert found.recent[node][-1] == pytest.approx(sum(own) / len(own))
        # From the second before the run began until its last one.
        assert len(found.recent[node]) == last_second + 2
    assert set(found.recent) == {"mobile", "edge", "track_ms"}
    _, out, _ = slambed("watch", "--once", "--results", str(results), COLUMNS="100")
    curves = re.findall(r"([\u2581-\u2588]{10,}) 0 to (\d+) (ms|%)", out)
    assert [unit for _, _, unit in curves] == ["ms", "%", "%"]
    assert all("\u2588" in curve for curve, _, _ in curves)
    file = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    Console(file=file, width=40).print(Sparkline([1.0, 2.0, None, 4.0], "ms"))
    file.seek(0)
    assert file.read() == "-= # 0 to 4 ms\n"


def test_a_curve_has_a_gap_where_nothing_was_measured() -> None:
    recent = Recent()
    for t_s, value in ((1.2, 10.0), (1.9, 30.0), (3.5, 40.0)):
        recent.add(t_s, value)
    assert recent.values() == [20.0, None, 40.0]
    assert spark(recent.values(), 40.0, "0123456789") == "4 9"
    for second in range(4, 100):
        recent.add(second, 1.0)
    assert recent.values() == [1.0] * RECENT_S


def test_a_narrow_terminal_shows_the_same(results: Path) -> None:
    _, out, _ = slambed("watch", "--once", "--results", str(results), COLUMNS="40")
    assert max(map(len, out.splitlines())) <= 40
    assert "1 track losses" in " ".join(out.split()) and "CPU" in out


def test_json_has_the_same_numbers(results: Path) -> None:
    _, out, _ = slambed("watch", "--once", "--json", "--results", str(results))
    (campaign,) = json.loads(out)["campaigns"]
    assert campaign["state"]["valid"] == 1 and campaign["state"]["pid"] == os.getpid()
    (run,) = campaign["playing"]
    assert run["run_key"] == "k2" and run["track_losses"] == 1
    assert set(run["nodes"]) == {"mobile", "edge"}


def test_nothing_is_written_and_no_lock_is_needed(results: Path) -> None:
    def there() -> list[tuple[str, int]]:
        return sorted((str(p), p.stat().st_mtime_ns) for p in results.rglob("*"))

    before = there()
    assert slambed("watch", "--once", "--results", str(results))[0] == ExitCode.OK
    assert there() == before


def test_a_run_without_files_yet_is_reported_as_begun(results: Path) -> None:
    for path in raw_of(results).rglob("*.jsonl"):
        path.unlink()
    _, out, _ = slambed("watch", "--once", "--results", str(results))
    assert "sys/room/ramp #2 (k2)" in out and "so far" in out and "frames" not in out


def test_where_nothing_runs_one_line_says_so(results: Path, tmp_path: Path) -> None:
    Ledger(results / "mine" / "ledger.jsonl").append("campaign_ended", interrupted=False)
    place = ("--results", str(results))
    assert slambed("watch", *place) == (ExitCode.OK, f"nothing runs in {results}\n", "")
    code, out, _ = slambed("watch", "mine", *place)
    expected = "nothing runs; the last campaign of mine: ended; 1 of 3 runs done, 2 left"
    assert code == ExitCode.OK and out.startswith(expected) and len(out.splitlines()) == 1
    assert json.loads(slambed("watch", "--once", "--json", *place)[1]) == {"campaigns": []}
    assert "no campaign of 'other'" in refused(ExitCode.BAD_INPUT, "watch", "other", *place)
    nowhere = str(tmp_path / "nowhere")
    assert "no such folder" in refused(ExitCode.BAD_INPUT, "watch", "--results", nowhere)
    assert "--once" in refused(ExitCode.BAD_INPUT, "watch", "--json", *place)


@needs_programs
def test_a_real_campaign_is_followed_to_its_end(tmp_path: Path) -> None:
    sequence = make_sequence(tmp_path / "walk")
    path = write_experiment(tmp_path, sequence, runs=2)
    results = tmp_path / "results"
    command = [sys.executable, "-c", "from slambed.commands.main import main; main()"]
    place = ["--results", str(results)]
    run = [*command, "run", str(path), "--no-figures", "--jobs", "1", *place]
    with subprocess.Popen(run, stdout=subprocess.PIPE, text=True) as campaign:
        ledger = results / "walk" / "ledger.jsonl"
        until(lambda: ledger.is_file() or campaign.poll() is not None, "the ledger or the end")
        assert ledger.is_file()
        watched = subprocess.run(
            [*command, "watch", "walk", *place], capture_output=True, text=True, check=False
        )
        campaign.communicate()
        assert campaign.returncode == ExitCode.OK
    assert (watched.returncode, watched.stderr) == (0, "")
    *lines, last = watched.stdout.splitlines()
    assert last in (
        "walk: ended; 4 of 4 runs done, 0 left",
        "nothing runs; the last campaign of walk: ended; 4 of 4 runs done, 0 left",
    )
    assert all(re.match(r"walk: \d of 4 runs done", line) for line in lines)
