# SPDX-License-Identifier: Apache-2.0
"""`slambed run` while another campaign holds the host lock."""

import fcntl
import json
import os
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_line import refused, slambed
from harness_parts import needs_root
from virtual_parts import make_sequence, needs_programs, write_experiment
from waiting import LIMIT_S

from slambed.campaign import choose, live_plan
from slambed.campaign.plan import check
from slambed.campaign.store import RunStore
from slambed.commands import run_and_report as reporting
from slambed.engines import host_lock as locking
from slambed.engines.host_lock import host_lock
from slambed.errors import ExitCode, SlambedError
from slambed.spec.library import Library

LIVE = """\
id: walk
title: A short walk here
systems: [{{system: orbslam2, label: alone}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
devices: {{mobile: host}}
engine: local
runs: {{default: {runs}}}
"""
HOLDER = re.escape(f"slambed run other (process {os.getpid()}), since ") + r"\d{4}-\d\d-\d\d "


@pytest.fixture
def lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Replaces the host's lock, which other campaigns may hold; their processes must not be taken
    for what a killed campaign left."""
    path = tmp_path / "host.lock"
    monkeypatch.setattr("slambed.engines.reaper.reap", lambda: "")
    monkeypatch.setattr(locking, "default_lock_path", lambda: path)
    return path


@contextmanager
def another_campaign(lock: Path) -> Iterator[None]:
    with host_lock("slambed run other", lock, where=Path("/elsewhere/results/other")):
        yield


def command(tmp_path: Path, *more: str) -> list[str]:
    path = write_experiment(tmp_path, make_sequence(tmp_path / "walk", 1), 2, LIVE)
    return ["run", str(path), "--results", str(tmp_path / "results"), *more]


def put_runs(tmp_path: Path) -> None:
    """Stores all runs of the experiment, as if they had been executed."""
    library = Library()
    experiment, source = library.experiment(str(tmp_path / "walk.yaml"))
    profiles = check(experiment, source, library, "local")
    plan = live_plan.without_making((experiment, source, library, profiles), "local", 2)
    assert plan is not None
    store = RunStore(tmp_path / "results")
    for spec in plan.specs:
        folder = store.runs / spec.run_key
        folder.mkdir(parents=True)
        (folder / "manifest.json").write_text("{}")
        (folder / "summary.json").write_text(json.dumps({"valid": True, "outcome": "completed"}))


@needs_root
@needs_programs
def test_a_dry_run_needs_no_host(tmp_path: Path, lock: Path) -> None:
    asked = command(tmp_path, "--dry-run")
    with another_campaign(lock):
        code, out, err = slambed(*asked)
    assert code == ExitCode.OK, err
    assert "alone/walk: 0 of 2 runs there" in out and "2 runs to execute" in out
    assert not (tmp_path / "results").exists()


@needs_root
@needs_programs
def test_where_all_runs_are_there_the_report_needs_no_host(
    tmp_path: Path, lock: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, shown = command(tmp_path), []
    monkeypatch.setattr(reporting, "show_report", lambda *expected: shown.append(expected))
    # The check for a quiet host does not run either.
    monkeypatch.setattr("slambed.campaign.quiet.look", lambda: pytest.fail("looked at the host"))
    put_runs(tmp_path)
    with another_campaign(lock):
        code, out, err = slambed(*asked, "--wait-for-quiet", "5")
        assert code == ExitCode.OK, err
        assert "2 runs, 2 there already" in out and len(shown) == 1
        # A run that is forced needs the host.
        line = refused(ExitCode.ENVIRONMENT, *asked, "--force", "alone/walk")
        assert re.search(f"another live campaign runs on this host: {HOLDER}", line)
        assert (
            "in /elsewhere/results/other; stop it, or wait for it: 'slambed run' has --wait" in line
        )


@needs_root
@needs_programs
def test_who_waits_says_for_whom_and_that_it_goes_on(
    tmp_path: Path, lock: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def enough(*asked: object) -> None:
        raise SlambedError("enough")

    asked = command(tmp_path, "--wait")
    monkeypatch.setattr(choose, "choose_engine", enough)
    held, over = threading.Event(), threading.Event()

    def hold() -> None:
        with another_campaign(lock):
            held.set()
            over.wait(30)

    holder = threading.Thread(target=hold, daemon=True)
    holder.start()
    assert held.wait(30)
    looks = []

    def taken(fd: int) -> bool:
        looks.append(fd)
        if len(looks) == 3:
            over.set()
            holder.join(LIMIT_S)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    monkeypatch.setattr(locking, "taken", taken)
    code, out, err = slambed(*asked)
    assert code == ExitCode.BAD_INPUT and "enough" in err
    first, second = out.splitlines()
    assert re.match(f"waiting: another live campaign runs on this host: {HOLDER}", first), out
    assert first.endswith("in /elsewhere/results/other")
    assert re.match(r"going on at \d\d:\d\d:\d\d UTC, after 0:00:0\d of waiting", second)


def test_commands_that_do_not_wait_do_not_name_the_option(lock: Path) -> None:
    with another_campaign(lock):
        line = refused(ExitCode.ENVIRONMENT, "clean")
    assert "call this again when it has ended" in line and "--wait" not in line


def test_a_lock_of_an_earlier_version_is_understood(tmp_path: Path, lock: Path) -> None:
    with another_campaign(lock):
        lock.write_text(json.dumps({"pid": 7, "purpose": "slambed run old"}))
        message = r": slambed run old \(process 7\); stop it"
        with pytest.raises(SlambedError, match=message), host_lock("mine", lock):
            pass
