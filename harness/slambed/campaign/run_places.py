# SPDX-License-Identifier: Apache-2.0
"""Placement of runs, for executors that assign runs to hosts."""

from typing import Protocol

from slambed.spec.run_spec import RunSpec


class Places(Protocol):
    """Called before and after each run, from several threads."""

    def claim(self, spec: RunSpec) -> bool:
        """Returns whether the run may start now; if so, reserves its place until `release`."""

    def release(self, spec: RunSpec) -> None:
        """Releases the place: the run has ended or will not start."""

    def host_of(self, spec: RunSpec) -> str | None:
        """Returns the host of a claimed run; None if there is only one."""


class AnyPlace:
    """Placement without any restriction."""

    def claim(self, spec: RunSpec) -> bool:
        """Returns True."""
        return True

    def release(self, spec: RunSpec) -> None:
        """Does nothing."""

    def host_of(self, spec: RunSpec) -> None:
        """Returns None."""
        return None
