# SPDX-License-Identifier: Apache-2.0
"""The campaign's side of the link package: profiles by name, and an open link for a run."""

from pathlib import Path
from typing import Any

from slambed.link.backend import choose_backend, open_link
from slambed.link.profile import parse_profile
from slambed.link.proof import LinkTolerance
from slambed.link.record import LinkFacts
from slambed.link.session import LinkSession
from slambed.spec.faults import Fault, with_cuts
from slambed.spec.matrix import NamedProfile
from slambed.spec.run_spec import RunSpec

ANY_CUT = Fault(at_s=0.0, link="cut", for_s=1.0)

# Words about a profile; a change of them does not change a run.
WORDS = ("description", "source")


def read_profile(item: str | float | dict[str, Any], where: str) -> NamedProfile:
    """A profile by name, as a number or written in place, checked."""
    profile = parse_profile(item, where)
    content = {key: value for key, value in profile.content.items() if key not in WORDS}
    return NamedProfile(profile.name, content)


def backend_for(asked: str, profile: NamedProfile, cut: bool = False) -> str:
    """The backend that a profile gets on this host; cut: some runs drop everything for a while."""
    content = profile.content
    if cut:
        content = with_cuts(content | {"gap_mode": "drop"}, [ANY_CUT])
    return choose_backend(asked, parse_profile(content, f"profile {profile.name}"))


class RunLink:
    """An open link that leaves its log in the run folder and its record in the manifest."""

    def __init__(self, session: LinkSession, log_dir: Path) -> None:
        self._session = session
        self._log_dir = log_dir

    def start(self, t0_ns: int) -> None:
        """Run time 0 on CLOCK_MONOTONIC."""
        self._session.start(t0_ns)

    def alive(self) -> bool:
        """False once the link went away by itself."""
        return self._session.alive()

    def stop(self) -> LinkFacts:
        """Takes the link down; what it says goes into the manifest."""
        record = self._session.stop()
        record.frame.to_parquet(self._log_dir / "link.parquet")
        return record.facts

    def close(self) -> None:
        """Takes the link down without a record; harmless after `stop`."""
        self._session.close()


def open_for_run(
    spec: RunSpec, mobile_ns: Path, edge_ns: Path, log_dir: Path, longest_s: float
) -> RunLink:
    """Joins the two namespaces by the link that the run asks for."""
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
