# SPDX-License-Identifier: Apache-2.0
"""The harness's hold on a link that a helper container keeps (`slambed.campaign.link_helper`)."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slambed.engines.base import Engine
from slambed.errors import SlambedError
from slambed.line_process import LineProcess
from slambed.spec.matrix import RunSpec

MODULE = "slambed.campaign.link_helper"
OPEN_TIMEOUT_S = 60.0
ANSWER_TIMEOUT_S = 10.0
STOP_TIMEOUT_S = 30.0
ALIVE_EVERY_S = 0.2


class RemoteLink:
    """Same life as `links.RunLink`; a helper that ends is a link that went away."""

    def __init__(self, process: LineProcess) -> None:
        self._process = process
        self._looked_s = 0.0
        self._alive = True
        self._record: dict[str, Any] | None = None

    def start(self, t0_ns: int) -> None:
        """Run time 0 on CLOCK_MONOTONIC."""
        self._process.ask({"start": t0_ns}, ANSWER_TIMEOUT_S)

    def alive(self) -> bool:
        """False once the link, or the helper that keeps it, went away."""
        if self._alive and time.monotonic() - self._looked_s > ALIVE_EVERY_S:
            self._looked_s = time.monotonic()
            try:
                self._alive = bool(self._process.ask({"alive": True}, ANSWER_TIMEOUT_S)["alive"])
            except SlambedError:
                self._alive = False
        return self._alive

    def stop(self) -> dict[str, Any]:
        """Takes the link down; what it says goes into the manifest."""
        if self._record is None:
            try:
                self._record = self._process.ask({"stop": True}, STOP_TIMEOUT_S)["stopped"]
            except SlambedError as error:
                self._record = _nothing(str(error))
            finally:
                self._process.close()
        assert self._record is not None
        return self._record


def _nothing(why: str) -> dict[str, Any]:
    """The record of a link whose helper took all it knew with it."""
    return {
        "backend": None,
        "base_rtt_ms": None,
        "drops": None,
        "died": why,
        "proof": None,
        "distrust": f"the link went away: {why}",
        "details": {},
    }


@dataclass(frozen=True)
class HelperLinks:
    """Opens links in helper containers of an engine."""

    engine: Engine

    def __call__(
        self, spec: RunSpec, mobile_ns: Path, edge_ns: Path, log_dir: Path, longest_s: float
    ) -> RemoteLink:
        """Joins the two namespaces by the link that the run asks for."""
        # The helper is root without a root's right to write anywhere.
        log_dir.chmod(0o777)
        log_dir = log_dir.resolve()
        command = self.engine.beside(MODULE, [log_dir])
        process = LineProcess(command, "link", log_dir / "helper_errors.txt")
        asked = {
            "spec": spec.model_dump(mode="json"),
            "mobile": str(mobile_ns),
            "edge": str(edge_ns),
            "log_dir": str(log_dir),
            "longest_s": longest_s,
        }
        try:
            process.ask({"open": asked}, OPEN_TIMEOUT_S)
        except BaseException:
            process.close()
            raise
        return RemoteLink(process)
