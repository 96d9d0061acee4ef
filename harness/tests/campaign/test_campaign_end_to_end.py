# SPDX-License-Identifier: Apache-2.0
"""End to end with the real programs: a YAML file, two nodes, a link, a result."""

import json
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from command_line import refused, slambed
from harness_parts import TOLERANCES, is_valid_run, needs_root
from virtual_parts import make_sequence

from slambed.engines.docker_image import connect, find_image
from slambed.engines.reaper import OWNER_VARIABLE, start_time
from slambed.errors import ExitCode, SlambedError
from slambed.metrics.catalog import SUMMARY_KEYS
from slambed.native import find_program

EXPERIMENT = """\
id: short
title: A short walk through a synthetic room
systems:
  - {{system: orbslam2, label: alone, profiles: [rtt_20]}}
  - {{system: edgeslam, label: offloaded}}
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link: {{backend: relay, profiles: [rtt_20]}}
devices: {{mobile: raspberry_pi_4, edge: edge_i7_6700t}}
runs: {{default: 1}}
tolerances: {tolerances}
"""
ALONE = "  - {system: orbslam2, label: alone, profiles: [rtt_20]}\n"
OFFLOADED = "  - {system: edgeslam, label: offloaded}\n"


def programs_are_built() -> bool:
    try:
        for name in ("slambed-node", "slambed-relay", "slambed-synth"):
            find_program(name)
    except SlambedError:
        return False
    return Path("/dev/net/tun").exists()


def image_is_built() -> bool:
    try:
        client = connect()
    except SlambedError:
        return False
    found = find_image(client) is not None
    client.close()
    return found


pytestmark = [
    needs_root,
    pytest.mark.skipif(not programs_are_built(), reason="needs the programs ('make build')"),
]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequence(tmp_path_factory.mktemp("synthetic") / "walk")


def experiment(sequence: Path, **tolerances: float) -> str:
    return EXPERIMENT.format(sequence=sequence, tolerances=json.dumps(TOLERANCES | tolerances))


def write_experiment(folder: Path, sequence: Path) -> Path:
    path = folder / "short.yaml"
    path.write_text(experiment(sequence))
    return path


def run_it(folder: Path, sequence: Path, engine: str, *options: str) -> list[dict[str, Any]]:
    path = write_experiment(folder, sequence)
    arguments = ["run", str(path), "--engine", engine, "--results", str(folder / "results")]
    arguments += ["--wait", *options]
    code, out, err = slambed(*arguments)
    assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), out + err
    results = folder / "results" / "short"
    table = pd.read_csv(results / "summary.csv")
    assert len(table) == 2
    summaries = []
    for run in sorted((results / "runs").iterdir()):
        names = {p.relative_to(run).as_posix() for p in run.rglob("*") if p.is_file()}
        summaries.append(json.loads((run / "summary.json").read_text()))
        if not is_valid_run(summaries[-1]):
            continue
        assert {
            "manifest.json",
            "trajectory.txt",
            "trajectory_live.txt",
            "events.parquet",
            "samples.parquet",
            "nodes/run.json",
            "nodes/mobile/node.json",
        } <= names
    assert (code == ExitCode.OK) == all(summary["valid"] for summary in summaries), out + err
    # A repeated call has nothing to do.
    _, out, _ = slambed(*arguments, "--retries", "0")
    assert "2 there already" in out
    return sorted(summaries, key=lambda summary: str(summary["system"]))


def explain_them(results: Path, folder: Path) -> None:
    """A live run has the same kind of timeline as a virtual one (test_explain.py)."""
    for run in (results / "runs").iterdir():
        picture = folder / f"{run.name}.png"
        code, out, err = slambed("explain", str(run), "-o", str(picture))
        assert code == ExitCode.OK, err
        if not is_valid_run(json.loads((run / "summary.json").read_text())):
            continue
        frames = (pd.read_parquet(run / "events.parquet")["type"] == "frame_tracked").sum()
        assert frames > 0 and out.startswith("40 frames in ")
        assert "mobile tracking: busy" in out
        assert picture.read_bytes().startswith(b"\x89PNG")


def check_figures(summaries: list[dict[str, Any]]) -> None:
    offloaded, alone = summaries
    for summary in summaries:
        assert set(SUMMARY_KEYS) <= set(summary)
        if not is_valid_run(summary):
            continue
        assert summary["outcome"] == "completed", summary["outcome_reason"]
        assert summary["frames_total"] == 40
        assert summary["frames_tracked"] > 0
        assert summary["mobile_cpu_percent_mean"] > 0
        assert summary["mobile_mem_mb_peak"] > 1
    assert alone["edge_cpu_percent_mean"] is None and alone["bytes_up"] is None
    if not offloaded["valid"]:
        return
    assert offloaded["edge_cpu_percent_mean"] > 0
    assert offloaded["bytes_up"] > 0
    assert offloaded["rtt_asked_ms_mean"] == pytest.approx(20, abs=0.5)
    assert offloaded["rtt_measured_ms_mean"] > 19


@pytest.fixture(scope="module")
def local_results(tmp_path_factory: pytest.TempPathFactory, sequence: Path) -> Path:
    """Checked results of the local engine."""
    folder = tmp_path_factory.mktemp("local")
    check_figures(run_it(folder, sequence, "local"))
    explain_them(folder / "results" / "short", folder)
    return folder


def test_the_local_engine_makes_a_whole_result(local_results: Path) -> None:
    """The fixture checks the result; later tests build on it."""
    assert (local_results / "results" / "short" / "report" / "index.html").is_file()


@pytest.mark.skipif(not image_is_built(), reason="needs the node image ('make images')")
def test_the_docker_engine_makes_the_same(tmp_path: Path, sequence: Path) -> None:
    """Figures and timelines are drawn from the same tables, so they are skipped."""
    check_figures(run_it(tmp_path, sequence, "docker", "--no-figures"))


def test_live_then_virtual_then_live_executes_nothing_twice(
    tmp_path: Path, local_results: Path, sequence: Path
) -> None:
    path, results = local_results / "short.yaml", local_results / "results"
    common = ("run", str(path), "--results", str(results), "--wait", "--retries", "0")
    common = (*common, "--no-figures", "--engine")
    inodes = {run.name: run.stat().st_ino for run in (results / "runs").iterdir()}
    attempts = len(list((results / "attempts").glob("*/*")))
    for engine, there in (("virtual", 0), ("local", 2), ("virtual", 2)):
        code, out, err = slambed(*common, engine)
        assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), err
        assert f"2 runs, {there} there already" in out
        assert ("links by " in out) == (engine == "local"), out
        now = {run.name: run.stat().st_ino for run in (results / "runs").iterdir()}
        assert now.items() >= inodes.items()
        inodes = now
    assert len(inodes) == 4 and len(list((results / "attempts").glob("*/*"))) == attempts
    table = pd.read_csv(results / "short" / "summary.csv")
    assert sorted(table["engine"]) == ["local", "local", "virtual", "virtual"]
    assert set(table["cell"].str.extract(r"\((\w+)\)$")[0]) == {"local", "virtual"}
    # Another experiment shares a cell with this one: its runs already exist under another name.
    twin = tmp_path / "twin.yaml"
    only = experiment(sequence).replace("id: short", "id: twin")
    twin.write_text(only.replace("label: alone", "label: single"))
    code, out, err = slambed("run", str(twin), "--results", str(results), "--engine", "virtual")
    assert code == ExitCode.OK and "2 runs, 2 there already" in out, err
    reported = pd.read_csv(results / "twin" / "summary.csv")
    assert (
        set(reported["experiment"]) == {"twin"} and reported["cell"].str.startswith("single").any()
    )


def test_a_run_that_no_link_satisfies_is_tried_as_often_as_retries_say(
    tmp_path: Path, sequence: Path
) -> None:
    # Real RTTs are never within 100 ns of the profile.
    text = experiment(sequence, rtt_error_ms_median=0.0001)
    text = text.replace(ALONE, "").replace("fps: 10}", "fps: 10, end_s: 1}")
    path, results = tmp_path / "short.yaml", tmp_path / "results"
    path.write_text(text)

    def run(retries: int) -> tuple[list[dict[str, Any]], str]:
        """Returns the ledger entries of this campaign, and the output of the command."""
        ledger = results / "short" / "ledger.jsonl"
        before = len(ledger.read_text().splitlines()) if ledger.is_file() else 0
        command = ("run", str(path), "--engine", "local", "--results", str(results), "--wait")
        code, out, err = slambed(*command, "--no-figures", "--retries", str(retries))
        assert code == ExitCode.NOT_ALL_GOOD or retries == 0, out + err
        reported = [json.loads(line) for line in ledger.read_text().splitlines()[before:]]
        return [entry for entry in reported if entry["event"] == "run_finished"], out + err

    finished, output = run(2)
    assert len(finished) == 3 and "1 of 1 runs are invalid" in output
    for entry in finished:
        assert entry["valid"] is False and "RTT error" in entry["invalid_reason"]
    (key,) = {entry["run_key"] for entry in finished}
    assert numbers_of_attempts(results, key) == [1, 2, 3]
    assert json.loads((results / "runs" / key / "summary.json").read_text())["attempts"] == 3
    (shown,) = pd.read_csv(results / "short" / "summary.csv")["attempts"]
    assert shown == 3
    # Without retries the existing run is taken; a later campaign continues with the next attempt.
    finished, output = run(0)
    assert finished == [] and "1 runs, 1 there already" in output
    finished, _ = run(1)
    assert len(finished) == 1 and numbers_of_attempts(results, key) == [1, 2, 3, 4]


def numbers_of_attempts(results: Path, key: str) -> list[int]:
    """Returns the attempt numbers of the manifests: each attempt is stored with all its files."""
    folders = [results / "runs" / key, *(results / "attempts" / key).iterdir()]
    for folder in folders:
        assert (folder / "events.parquet").is_file() and (folder / "nodes" / "link").is_dir()
    return sorted(json.loads((f / "manifest.json").read_text())["attempt"] for f in folders)


def test_a_damaged_sequence_is_refused(tmp_path: Path, sequence: Path) -> None:
    damaged = tmp_path / "damaged"
    shutil.copytree(sequence, damaged)
    with (damaged / "frames.bin").open("r+b") as frames:
        frames.seek(100)
        frames.write(b"\xff\x00\xff")
    path = write_experiment(tmp_path, damaged)
    line = refused(
        ExitCode.BAD_INPUT, "run", str(path), "--wait", "--engine", "local", cwd=tmp_path
    )
    assert "frame 0 does not fit its CRC" in line and "short.yaml line" in line


def test_a_missing_dataset_is_refused(tmp_path: Path) -> None:
    path = write_experiment(tmp_path, Path("nowhere"))
    line = refused(
        ExitCode.BAD_INPUT, "run", str(path), "--wait", "--engine", "local", cwd=tmp_path
    )
    assert "dataset 'nowhere' is not known" in line


def test_without_docker_auto_says_so_and_takes_local(tmp_path: Path, sequence: Path) -> None:
    path = write_experiment(tmp_path, sequence)
    path.write_text(
        path.read_text().replace(OFFLOADED, "").replace("fps: 10}", "fps: 10, end_s: 1}")
    )
    code, out, err = slambed(
        *("run", str(path), "--wait", "--retries", "0", "--results", str(tmp_path)),
        DOCKER_HOST="unix:///nonexistent.sock",
    )
    assert code in (ExitCode.OK, ExitCode.NOT_ALL_GOOD), err
    assert "no Docker" in out and "taking engine local" in out


def test_nothing_is_left_on_the_host() -> None:
    """There is no process of ours whose harness has ended."""
    marker = f"{OWNER_VARIABLE}=".encode()
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            items = path.read_bytes().split(b"\0")
        except OSError:
            continue
        for item in items:
            if item.startswith(marker):
                owner, _, began = item.removeprefix(marker).decode().partition(":")
                assert str(start_time(int(owner))) == began, path
