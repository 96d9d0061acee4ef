# SPDX-License-Identifier: Apache-2.0
"""Waiting for a quiet host: what ends it, and who hears of it."""

import os
import signal
import threading
from contextlib import nullcontext
from typing import Any

import pytest

from slambed.campaign import choose, host_worker, run_experiment, server_folder
from slambed.campaign.host_messages import JoinCampaign
from slambed.campaign.quiet import Load, wait_for_quiet
from slambed.engines import reaper
from slambed.process.line_protocol import LineReader, Message, Note

QUIET, BUSY = Load(0.0, 1.0), Load(0.0, 80.0)
LOOK = "slambed.campaign.quiet.look"
ANNOUNCED = f"{BUSY}; waiting up to 10 min for it to become quiet"


def test_a_quiet_host_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    loads, lines = iter([BUSY, BUSY, QUIET]), list[str]()
    monkeypatch.setattr(LOOK, lambda: next(loads))
    stop = threading.Event()
    assert wait_for_quiet(600, stop, lines.append) == QUIET and lines == [ANNOUNCED]
    monkeypatch.setattr(LOOK, lambda: QUIET)
    assert wait_for_quiet(600, stop, lines.append) == QUIET and lines == [ANNOUNCED]
    monkeypatch.setattr(LOOK, lambda: BUSY)
    assert wait_for_quiet(0, stop, lines.append) == BUSY and lines == [ANNOUNCED]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("load", [QUIET, BUSY])
def test_a_campaign_that_is_asked_to_end_meanwhile_does_not_start(
    monkeypatch: pytest.MonkeyPatch, number: signal.Signals, load: Load
) -> None:
    def look() -> Load:
        os.kill(os.getpid(), number)
        return load

    lines: list[str] = []
    monkeypatch.setattr(LOOK, look)
    with pytest.raises(KeyboardInterrupt):
        run_experiment._await_quiet(600, lines.append)
    assert lines == ([] if load.quiet else [ANNOUNCED])


def test_a_campaign_hears_how_quiet_its_host_is(monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    monkeypatch.setattr(LOOK, lambda: BUSY)
    run_experiment._await_quiet(0, lines.append)
    assert lines == [str(BUSY)]


def test_a_worker_gives_up_its_host_when_its_campaign_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """The campaign hears that the host waits, and has ended when the worker asks next."""
    changes: list[tuple[Any, str, Any]] = [
        (choose, "check_privilege", lambda engine: None),
        (choose, "choose_engine", lambda *_: (None, "s")),
        (host_worker, "host_lock", lambda *_, **__: nullcontext()),
        (reaper, "mark_children", nullcontext),
        (reaper, "reap", lambda: ""),
        (server_folder, "sweep", lambda prefix: pytest.fail("it goes on")),
    ]
    for module, name, value in changes:
        monkeypatch.setattr(module, name, value)
    loads = iter([BUSY, QUIET])
    monkeypatch.setattr(LOOK, lambda: next(loads))
    asked = JoinCampaign(
        name="lab1",
        labels=[],
        engine="local",
        cores=None,
        scheduler="",
        port=0,
        contact=None,
        certificate="",
        key="",
        wait_s=0.0,
        quiet_s=600.0,
        measure=False,
        take=True,
    )
    inside, outside = os.pipe()
    answers: list[Message] = []

    def answer(message: Message) -> None:
        answers.append(message)
        os.close(outside)

    with pytest.raises(EOFError):
        host_worker._work(asked, LineReader(inside), answer)
    os.close(inside)
    assert answers == [Note(line=ANNOUNCED)]
