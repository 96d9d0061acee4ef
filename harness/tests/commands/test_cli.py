# SPDX-License-Identifier: Apache-2.0
"""The command line: one-line errors, documented exit codes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import refused, slambed, slambed_process
from data_samples import write_prepared
from virtual_parts import needs_programs

from slambed.errors import ExitCode
from slambed.spec.experiment_name import name_of
from slambed.spec.library import Library


def test_help_lists_the_commands() -> None:
    for arguments in (["--help"], []):
        code, out, _ = slambed(*arguments)
        assert code == ExitCode.OK
        for name in ("run", "status", "report", "data", "profiles", "doctor", "images", "clean"):
            assert name in out


def test_version() -> None:
    for called in (slambed, slambed_process):
        code, out, err = called("--version")
        assert (code, err) == (ExitCode.OK, "") and out.startswith("slambed ")


def test_a_mistake_is_the_exit_code_of_the_process() -> None:
    code, out, err = slambed_process("rnu")
    assert (code, out) == (ExitCode.BAD_INPUT, "") and err.count("\n") == 1


def test_wrong_usage_is_one_line() -> None:
    assert "--runz" in refused(ExitCode.BAD_INPUT, "run", "quickstart", "--runz", "3")
    assert "'rnu'. Did you mean 'run'? See" in refused(ExitCode.BAD_INPUT, "rnu")
    assert "'frobnicate'. See" in refused(ExitCode.BAD_INPUT, "frobnicate")
    assert "docker, local" in refused(ExitCode.BAD_INPUT, "run", "quickstart", "--engine", "moby")


def test_run_without_an_experiment_lists_them() -> None:
    code, out, err = slambed("run")
    assert (code, err) == (ExitCode.OK, "")
    assert all(name in out for name in Library().experiments()) and "'slambed run NAME'" in out
    # With an option somebody meant an experiment, and a script must not go on.
    assert "which experiment?" in refused(ExitCode.BAD_INPUT, "run", "--engine", "virtual")


def test_a_name_may_have_a_dot() -> None:
    found = map(name_of, ("quickstart", "foo.v2", "experiments/foo.v2.yaml", "results/foo.v2/"))
    assert list(found) == ["quickstart", "foo.v2", "foo.v2", "foo.v2"]
    assert "results/foo.v2" in refused(ExitCode.BAD_INPUT, "report", "foo.v2")


def test_an_unknown_experiment_names_its_neighbor() -> None:
    assert "did you mean 'quickstart'" in refused(ExitCode.BAD_INPUT, "run", "quikstart")


def test_what_is_no_experiment_is_reported_for_what_it_is(tmp_path: Path) -> None:
    line = refused(ExitCode.BAD_INPUT, "run", str(tmp_path))
    assert f"{tmp_path} is a folder" in line
    line = refused(ExitCode.BAD_INPUT, "run", "mine.YML")
    assert "mine.YML does not end in .yaml or .yml" in line


@needs_programs
def test_results_in_a_file_are_refused(tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("")
    line = refused(
        ExitCode.BAD_INPUT, "run", "quickstart", "--engine", "virtual", "--results", str(taken)
    )
    assert "choose another --results" in line


def test_results_that_are_nowhere_are_refused(tmp_path: Path) -> None:
    line = refused(ExitCode.BAD_INPUT, "papers", "--results", str(tmp_path / "nope"))
    assert "no such folder" in line and "nope" in line
    assert not (tmp_path / "nope").exists()


def test_results_before_a_command_of_papers_are_refused() -> None:
    line = refused(ExitCode.BAD_INPUT, "papers", "--results", "elsewhere", "compare", "dynnetslam")
    assert "slambed papers compare --results ..." in line
    line = refused(ExitCode.BAD_INPUT, "papers", "--results", "elsewhere", "kept")
    assert "slambed papers kept --out ..." in line
    line = refused(ExitCode.BAD_INPUT, "papers", "--results", "elsewhere", "lint")
    assert "slambed papers lint reads no results" in line


REAL = """\
id: tiny
title: A tiny experiment
systems: [{system: orbslam2}]
datasets: [synthetic_room]
link: {profiles: [none, ramp]}
devices: {mobile: host}
"""


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("[none, ramp]", "[{name: bad, rtt_ms: -5}]", "negative latency"),
        ("[none, ramp]", "[nonee]", "did you mean 'none'"),
        ("title:", "titel:", "unknown key 'titel'"),
        ("mobile: host", "mobile: hots", "did you mean 'host'"),
        ("system: orbslam2", "system: orbslam", "did you mean 'orbslam2'"),
        ("[synthetic_room]", "[synthetic_rom]", "did you mean 'synthetic_room'"),
        (
            "system: orbslam2}]\ndatasets: [synthetic_room]",
            "system: multithread_rl}]\ndatasets: [synthetic_mono_room]",
            "is mono, system multithread_rl",
        ),
    ],
)
def test_a_bad_experiment_is_refused_before_anything_starts(
    tmp_path: Path, old: str, new: str, part: str
) -> None:
    path = tmp_path / "tiny.yaml"
    path.write_text(REAL.replace(old, new))
    line = refused(ExitCode.BAD_INPUT, "run", str(path), "--results", str(tmp_path / "results"))
    assert part in line and "tiny.yaml" in line
    assert refused(ExitCode.BAD_INPUT, "run", str(path), "--check") == line
    assert not (tmp_path / "results").exists()


def test_an_experiment_can_be_checked_alone() -> None:
    code, out, _ = slambed("run", "quickstart", "--check", "--engine", "virtual")
    assert code == ExitCode.OK and out.splitlines()[0].endswith("quickstart.yaml: good")


def test_checking_knows_how_long_a_prepared_sequence_is(tmp_path: Path) -> None:
    write_prepared(tmp_path / "short")
    path = tmp_path / "tiny.yaml"
    played = REAL.replace("synthetic_room", str(tmp_path / "short"))
    path.write_text(played + "playback: {end_s: 30000}\n")
    line = refused(ExitCode.BAD_INPUT, "run", str(path), "--check")
    assert "playback.end_s 30000 is after the end of" in line and "tiny.yaml line 7" in line
    path.write_text(played)
    assert slambed("run", str(path), "--check", "--engine", "virtual")[0] == ExitCode.OK


@pytest.mark.parametrize(
    ("asked", "part"),
    [
        (("--set", "playbak.end_s=5"), "unknown key 'playbak'"),
        (("--set", "playback.end=5"), "unknown key 'end'"),
        (("--set", "link.rtt_ms=20"), "unknown key 'rtt_ms'"),
        (("--runs", "some"), "--runs some is neither a number"),
        (("--runs", "0"), "--runs 0 is neither a number"),
        (("--runs", "10001"), "--runs 10001 is neither a number from 1 to 10,000"),
        (("--only", "nothing"), "--dry-run shows which runs they select"),
    ],
)
def test_checking_looks_at_what_is_asked_for(asked: tuple[str, ...], part: str) -> None:
    assert part in refused(ExitCode.BAD_INPUT, "run", "quickstart", "--check", *asked)


@pytest.mark.parametrize("cluster", [("--slurm",), ("--scheduler", "tcp://127.0.0.1:1")])
def test_checking_refuses_a_live_run_on_a_cluster_as_run_does(
    tmp_path: Path, cluster: tuple[str, ...]
) -> None:
    live = ("run", "quickstart", "--engine", "local", *cluster, "--results", str(tmp_path))
    line = refused(ExitCode.BAD_INPUT, *live, "--check")
    assert "add --engine virtual" in line
    assert refused(ExitCode.BAD_INPUT, *live) == line


def test_checking_asks_for_the_number_of_slurm_jobs() -> None:
    slurm = ("run", "quickstart", "--check", "--engine", "virtual", "--slurm")
    assert "--slurm needs --jobs" in refused(ExitCode.BAD_INPUT, *slurm)
    assert slambed(*slurm, "--jobs", "2")[0] == ExitCode.OK


def test_a_group_of_commands_without_one_says_so() -> None:
    code, out, err = slambed("cache")
    assert code == ExitCode.BAD_INPUT and "prune" in out
    assert "a subcommand is missing" in err


def test_status_and_report_of_nothing_say_how_to_begin(tmp_path: Path) -> None:
    nothing = ("--results", str(tmp_path))
    line = refused(ExitCode.BAD_INPUT, "report", "quickstart", *nothing)
    assert "slambed run quickstart" in line
    code, out, err = slambed("status", "quickstart", *nothing)
    message = "not run yet: 0 of 9 runs; start with 'slambed run quickstart'"
    assert (code, out.strip(), err) == (ExitCode.OK, message, "")
    _, out, _ = slambed("status", "sensors", *nothing)
    assert "0 of at most 8 runs" in out
    line = refused(ExitCode.BAD_INPUT, "status", "quikstart", *nothing)
    assert "did you mean 'quickstart'" in line
    assert "is a folder" in refused(ExitCode.BAD_INPUT, "status", str(tmp_path), *nothing)


def test_status_of_runs_without_their_plan_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "quickstart" / "runs" / "0123").mkdir(parents=True)
    line = refused(ExitCode.BAD_INPUT, "status", "quickstart", "--results", str(tmp_path))
    assert "experiment.json is missing or not whole" in line


def test_no_docker_is_one_line() -> None:
    line = refused(ExitCode.ENVIRONMENT, "images", DOCKER_HOST="unix:///nonexistent/docker.sock")
    assert "no Docker" in line and "engine local runs live, as root" in line


def test_a_bug_is_one_line_too() -> None:
    code = """
import sys
import slambed.commands.doctor
from slambed.commands import main
slambed.commands.doctor.examine = lambda: 1 / 0
sys.exit(main.run_command(["doctor"]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == ExitCode.INTERNAL
    assert "a bug of slambed" in done.stderr and len(done.stderr.strip().splitlines()) == 1
    # For a report of it.
    told = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"SLAMBED_DEBUG": "1"},
    )
    assert told.returncode == ExitCode.INTERNAL
    assert told.stderr.startswith("Traceback") and "ZeroDivisionError" in told.stderr
    assert told.stderr.strip().splitlines()[-1] == done.stderr.strip()


def test_doctor_reports_about_every_topic() -> None:
    code, out, _ = slambed("doctor", COLUMNS="200")
    assert code in (ExitCode.OK, ExitCode.ENVIRONMENT)
    for topic in ("docker", "netem", "tun", "cgroups", "cores", "data", "privilege", "programs"):
        assert topic in out
