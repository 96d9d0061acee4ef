# SPDX-License-Identifier: Apache-2.0
"""Profiles as experiments name them, and which backend they get."""

from typing import Any

from slambed.link.choice import choose_backend
from slambed.link.profile import parse_profile
from slambed.spec.faults import Fault, with_cuts
from slambed.spec.matrix import NamedProfile

ANY_CUT = Fault(at_s=0.0, link="cut", for_s=1.0)

# Words about a profile; a change of them does not change a run.
WORDS = ("description", "source")


def read_profile(item: str | float | dict[str, Any], where: str) -> NamedProfile:
    """A profile by name, as a number or written in place, checked."""
    profile = parse_profile(item, where)
    content = {key: value for key, value in profile.content.items() if key not in WORDS}
    return NamedProfile(profile.name, content)


def adds_nothing(profile: NamedProfile) -> bool:
    """Whether it leaves the path as it is."""
    return parse_profile(profile.content, f"profile {profile.name}").is_none


def backend_for(
    asked: str, profile: NamedProfile, cut: bool = False, netem: bool | None = None
) -> str:
    """The backend that a profile gets on this host; cut: some runs drop everything for a while.
    `netem`: whether other hosts have it, where they execute the runs."""
    content = profile.content
    if cut:
        content = with_cuts(content | {"gap_mode": "drop"}, [ANY_CUT])
    return choose_backend(asked, parse_profile(content, f"profile {profile.name}"), netem)
