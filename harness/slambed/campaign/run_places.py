# SPDX-License-Identifier: Apache-2.0
"""Where the runs of a campaign may begin, for executors that care which run goes where."""

from typing import Protocol

from slambed.spec.run_spec import RunSpec


class Places(Protocol):
    """Asked before a run is taken, notified when it has ended; from several threads."""

    def claim(self, spec: RunSpec) -> bool:
        """Whether the run may begin now: then its place is kept free for it until `release`."""

    def release(self, spec: RunSpec) -> None:
        """It has ended, or will not begin."""

    def host_of(self, spec: RunSpec) -> str | None:
        """Name of the host of a claimed run; None where there is only one."""


class AnyPlace:
    """One place is as good as another."""

    def claim(self, spec: RunSpec) -> bool:
        """Always."""
        return True

    def release(self, spec: RunSpec) -> None:
        """Nothing was kept."""

    def host_of(self, spec: RunSpec) -> None:
        """There is none."""
        return None
