# SPDX-License-Identifier: Apache-2.0
"""Profiles as experiments name them, and the backend for each one."""

from pathlib import Path
from typing import Any

from slambed.link.choice import choose_backend
from slambed.link.profile import parse_profile
from slambed.spec.faults import Fault, with_cuts
from slambed.spec.matrix import NamedProfile

ANY_CUT = Fault(at_s=0.0, link="cut", for_s=1.0)

# Descriptive keys of a profile, which are not part of the run key.
WORDS = ("description", "source")


def read_profile(
    item: str | float | dict[str, Any], where: str, near: Path | None = None
) -> NamedProfile:
    """Parses a profile given by name, as a number or inline; traces of the latter are named as
    seen from folder `near`."""
    profile = parse_profile(item, where, near)
    content = {key: value for key, value in profile.content.items() if key not in WORDS}
    return NamedProfile(profile.name, content, profile.remarks, profile.recorded)


def adds_nothing(profile: NamedProfile) -> bool:
    """Returns whether the profile adds nothing to the path."""
    return parse_profile(profile.content, f"profile {profile.name}").is_none


def backend_for(
    asked: str, profile: NamedProfile, cut: bool = False, netem: bool | None = None
) -> str:
    """Returns the backend of a profile. With `cut`, some runs also drop all packets for a while.
    `netem` tells whether the hosts that execute the runs have it; None checks this host."""
    content = profile.content
    if cut:
        content = with_cuts(content | {"gap_mode": "drop"}, [ANY_CUT])
    return choose_backend(asked, parse_profile(content, f"profile {profile.name}"), netem)
