# SPDX-License-Identifier: Apache-2.0
"""Opening a link between the network namespaces of two nodes."""

from pathlib import Path
from typing import Any, Literal, Protocol, cast

from slambed.errors import SlambedError
from slambed.link.profile import Profile
from slambed.link.session import LinkOptions, LinkSession, Shaper

BackendName = Literal["auto", "relay", "netem", "none"]
BACKENDS: list[str] = ["auto", "relay", "netem", "none"]


class ShaperFactory(Protocol):
    """How a backend is made."""

    def __call__(
        self, mobile: Path, edge: Path, profile: Profile, seed: int, log_dir: Path, o: LinkOptions
    ) -> Shaper: ...


def choose_backend(asked: str, profile: Profile) -> Literal["relay", "netem", "none"]:
    """`auto` is netem where the kernel has it and nothing random is asked for, else the relay: it
    begins and ends bursts to the microsecond, too."""
    from slambed.link.netem import netem_available, why_not_netem

    if asked not in BACKENDS:
        raise SlambedError(f"unknown link backend '{asked}', link; known: {', '.join(BACKENDS)}")
    if asked == "netem" and (reason := why_not_netem(profile)):
        raise SlambedError(f"backend netem cannot do profile '{profile.name}': {reason}")
    if asked == "none" and not profile.is_none:
        raise SlambedError(f"backend none adds nothing, but profile '{profile.name}' does")
    if asked != "auto":
        return cast(Literal["relay", "netem", "none"], asked)
    random = any(side.loss for side in (profile.up, profile.down)) or why_not_netem(profile)
    return "relay" if random or not netem_available() else "netem"


def open_link(
    backend: str,
    mobile_ns: str | Path,
    edge_ns: str | Path,
    profile: Profile,
    seed: int,
    log_dir: Path,
    **options: Any,
) -> LinkSession:
    """Joins two namespaces (paths of their files, or names known to `ip netns`).

    Afterwards the mobile end is 10.77.0.1, the edge end 10.77.0.2, and the profile's value at time
    0 is applied. `log_dir` is for the backend's own files. Options: fields of `LinkOptions`.
    """
    from slambed.link.netem import NetemShaper, PlainShaper
    from slambed.link.relay import RelayShaper

    shapers: dict[str, ShaperFactory] = {
        "relay": RelayShaper,
        "netem": NetemShaper,
        "none": PlainShaper,
    }
    name = choose_backend(backend, profile)
    return LinkSession(
        shapers[name], mobile_ns, edge_ns, profile, seed, log_dir, LinkOptions(**options)
    )
