# SPDX-License-Identifier: Apache-2.0
"""The link of a live run, which writes its log to the run folder."""

from pathlib import Path

from slambed.link.backend import open_link
from slambed.link.facts import LinkFacts
from slambed.link.profile import parse_profile
from slambed.link.proof import LinkTolerance
from slambed.link.session import LinkSession
from slambed.spec.run_spec import RunSpec


class RunLink:
    """An open link that writes its log to the run folder and returns its facts for the manifest."""

    def __init__(self, session: LinkSession, log_dir: Path) -> None:
        self._session = session
        self._log_dir = log_dir

    def start(self, t0_ns: int) -> None:
        """Sets run time 0 on CLOCK_MONOTONIC."""
        self._session.start(t0_ns)

    def alive(self) -> bool:
        """Returns False once the link has failed."""
        return self._session.alive()

    def stop(self) -> LinkFacts:
        """Takes the link down, writes its log and returns its facts for the manifest."""
        record = self._session.stop()
        record.frame.to_parquet(self._log_dir / "link.parquet")
        return record.facts

    def close(self) -> None:
        """Takes the link down without a record; harmless after `stop`."""
        self._session.close()


def open_for_run(
    spec: RunSpec, mobile_ns: Path, edge_ns: Path, log_dir: Path, longest_s: float
) -> RunLink:
    """Connects the two namespaces with the run's link."""
    assert spec.link is not None
    tolerance = LinkTolerance(
        median_ms=spec.tolerances.rtt_error_ms_median, p99_ms=spec.tolerances.rtt_error_ms_p99
    )
    session = open_link(
        spec.link.backend,
        mobile_ns,
        edge_ns,
        parse_profile(spec.link.content, f"profile {spec.link.profile}"),
        spec.seed,
        log_dir,
        horizon_s=longest_s,
        tolerance=tolerance,
    )
    return RunLink(session, log_dir)
