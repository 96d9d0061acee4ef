# SPDX-License-Identifier: Apache-2.0
"""Opening a link between the network namespaces of two nodes."""

from pathlib import Path
from typing import Any, Protocol

from slambed.link.choice import choose_backend
from slambed.link.profile import Profile
from slambed.link.session import LinkOptions, LinkSession, Shaper


class ShaperFactory(Protocol):
    """Constructor of a backend."""

    def __call__(
        self, mobile: Path, edge: Path, profile: Profile, seed: int, log_dir: Path, o: LinkOptions
    ) -> Shaper: ...


def open_link(
    backend: str,
    mobile_ns: str | Path,
    edge_ns: str | Path,
    profile: Profile,
    seed: int,
    log_dir: Path,
    **options: Any,
) -> LinkSession:
    """Connects two namespaces (file paths, or names known to `ip netns`).

    Afterwards the mobile node has address 10.77.0.1, the edge has 10.77.0.2, and the profile's
    value at time 0 is applied. `log_dir` is for the backend's own files. Options: fields of
    `LinkOptions`.
    """
    from slambed.link.netem import NetemShaper
    from slambed.link.relay import RelayShaper
    from slambed.link.veth import PlainShaper

    shapers: dict[str, ShaperFactory] = {
        "relay": RelayShaper,
        "netem": NetemShaper,
        "none": PlainShaper,
    }
    name = choose_backend(backend, profile)
    return LinkSession(
        shapers[name], mobile_ns, edge_ns, profile, seed, log_dir, LinkOptions(**options)
    )
