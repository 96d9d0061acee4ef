# SPDX-License-Identifier: Apache-2.0
"""The emulated network between the two nodes: profiles, backends and their proof (docs/link.md)."""

from slambed.link.backend import choose_backend, open_link
from slambed.link.profile import Profile, load_profile, parse_profile, profile_names
from slambed.link.record import LinkRecord
from slambed.link.session import LinkOptions, LinkSession

__all__ = [
    "LinkOptions",
    "LinkRecord",
    "LinkSession",
    "Profile",
    "choose_backend",
    "load_profile",
    "open_link",
    "parse_profile",
    "profile_names",
]
