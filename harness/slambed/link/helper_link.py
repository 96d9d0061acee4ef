# SPDX-License-Identifier: Apache-2.0
"""The harness side of a link that a helper container holds (`slambed.link.link_helper`)."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from slambed.errors import SlambedError
from slambed.link.facts import LinkFacts
from slambed.link.helper_messages import (
    Alive,
    AskAlive,
    LinkStopped,
    Opened,
    OpenLink,
    StopLink,
)
from slambed.link.traces import at_full_paths
from slambed.process.line_protocol import LineProcess, Start, Started
from slambed.spec.run_spec import RunSpec

MODULE = "slambed.link.link_helper"
OPEN_TIMEOUT_S = 60.0
ANSWER_TIMEOUT_S = 10.0
STOP_TIMEOUT_S = 30.0
ALIVE_EVERY_S = 0.2


class HelperLink:
    """Same interface as `run_link.RunLink`; the end of the helper counts as a failed link."""

    def __init__(self, process: LineProcess) -> None:
        self._process = process
        self._looked_s = 0.0
        self._alive = True
        self._facts: LinkFacts | None = None

    def start(self, t0_ns: int) -> None:
        """Sets run time 0 on CLOCK_MONOTONIC."""
        self._process.ask(Start(t0_ns=t0_ns), Started, ANSWER_TIMEOUT_S)

    def alive(self) -> bool:
        """Returns False once the link, or the helper that holds it, has failed."""
        if self._alive and time.monotonic() - self._looked_s > ALIVE_EVERY_S:
            self._looked_s = time.monotonic()
            try:
                self._alive = self._process.ask(AskAlive(), Alive, ANSWER_TIMEOUT_S).alive
            except SlambedError:
                self._alive = False
        return self._alive

    def stop(self) -> LinkFacts:
        """Takes the link down and returns its facts for the manifest."""
        if self._facts is None:
            try:
                self._facts = self._process.ask(StopLink(), LinkStopped, STOP_TIMEOUT_S).link
            except SlambedError as error:
                self._facts = LinkFacts.gone(str(error))
            finally:
                self._process.close()
        return self._facts


class HelperStarter(Protocol):
    """The part of an engine that a link needs."""

    def sidecar_command(
        self, module: str, writable: list[Path], readable: Sequence[Path] = ()
    ) -> list[str]:
        """Returns the command that runs a module of slambed as a sidecar of the running nodes,
        with access to the given paths."""


@dataclass(frozen=True)
class HelperLinkOpener:
    """Opens links in helper containers of an engine."""

    engine: HelperStarter

    def __call__(
        self, spec: RunSpec, mobile_ns: Path, edge_ns: Path, log_dir: Path, longest_s: float
    ) -> HelperLink:
        """Connects the two namespaces with the run's link."""
        # The helper runs as root, but without the capability to override file permissions.
        log_dir.chmod(0o777)
        log_dir = log_dir.resolve()
        # The user's folders do not exist in the helper, but the files of this link do.
        assert spec.link is not None
        content, traces = at_full_paths(spec.link.content)
        spec = spec.model_copy(update={"link": spec.link.model_copy(update={"content": content})})
        command = self.engine.sidecar_command(MODULE, [log_dir], traces)
        process = LineProcess(command, "link", log_dir / "helper_errors.txt")
        asked = OpenLink(
            spec=spec,
            mobile=str(mobile_ns),
            edge=str(edge_ns),
            log_dir=str(log_dir),
            longest_s=longest_s,
        )
        try:
            process.ask(asked, Opened, OPEN_TIMEOUT_S)
        except BaseException:
            process.close()
            raise
        return HelperLink(process)
