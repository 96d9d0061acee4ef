# SPDX-License-Identifier: Apache-2.0
"""Shared by the live link tests: the built relay, skip reasons, and measurements on a disturbed
host."""

import functools
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import ParamSpec, Self

import pytest
from waiting import LIMIT_S

from slambed.errors import SlambedError
from slambed.native import find_program


def why_no_relay() -> str:
    """Returns why the relay cannot run here; empty if it can."""
    if os.geteuid() != 0:
        return "needs root for network namespaces"
    if not Path("/dev/net/tun").exists():
        return "needs /dev/net/tun"
    try:
        find_program("slambed-relay")
    except SlambedError as error:
        return str(error)
    return ""


NEEDS_RELAY = "needs root, TUN and slambed-relay ('make build')"
needs_relay = pytest.mark.skipif(bool(why_no_relay()), reason=why_no_relay() or NEEDS_RELAY)
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="needs root for network namespaces")

P = ParamSpec("P")

ATTEMPTS = 4
NAP_S = 0.02
CALM_MS = 0.5
"""Maximum mean wake-up delay of a sleeping thread."""


class Lateness:
    """Measures wake-up delays: the CPU of a virtual machine is a process of a possibly busy
    host, whose delays say nothing about the kernel."""

    def __init__(self) -> None:
        self.mean_ms = 0.0
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def _watch(self) -> None:
        late_s: list[float] = []
        while not self._stopped.is_set():
            start = time.monotonic()
            time.sleep(NAP_S)
            late_s.append(time.monotonic() - start - NAP_S)
        self.mean_ms = 1e3 * sum(late_s) / len(late_s)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stopped.set()
        self._thread.join(LIMIT_S)


def again_when_late(test: Callable[P, None]) -> Callable[P, None]:
    """Repeats a test that fails on a machine with late wake-ups."""

    @functools.wraps(test)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        for left in reversed(range(ATTEMPTS)):
            with Lateness() as lateness:
                try:
                    return test(*args, **kwargs)
                except AssertionError as error:
                    failure = error
            if not left or lateness.mean_ms < CALM_MS:
                raise failure

    return run
