# SPDX-License-Identifier: Apache-2.0
"""Selects the backend that emulates a profile on this host."""

from typing import Literal, cast

from slambed.errors import SlambedError
from slambed.link.profile import Profile

BACKENDS: list[str] = ["auto", "relay", "netem", "none"]


def choose_backend(
    asked: str, profile: Profile, netem: bool | None = None
) -> Literal["relay", "netem", "none"]:
    """Resolves `auto`: netem if the kernel has it and the profile has no loss, jitter, gaps or
    rate trace, otherwise the relay, whose bursts are accurate to the microsecond. `netem` tells
    whether the hosts that execute the runs have netem; None checks this host."""
    from slambed.link.netem import netem_available, why_not_netem

    if asked not in BACKENDS:
        raise SlambedError(f"unknown link backend '{asked}', link; known: {', '.join(BACKENDS)}")
    if asked == "netem" and (reason := why_not_netem(profile)):
        raise SlambedError(f"backend netem cannot do profile '{profile.name}': {reason}")
    if asked == "none" and not profile.is_none:
        raise SlambedError(f"backend none adds nothing, but profile '{profile.name}' does")
    if asked != "auto":
        return cast(Literal["relay", "netem", "none"], asked)
    needs_relay = any(side.loss for side in (profile.up, profile.down)) or why_not_netem(profile)
    if needs_relay or not (netem_available() if netem is None else netem):
        return "relay"
    return "netem"
