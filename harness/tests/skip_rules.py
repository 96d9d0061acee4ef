# SPDX-License-Identifier: Apache-2.0
"""Which tests a host may skip, and why: a skip without a rule indicates a missing component."""

import os
import re
from collections.abc import Callable
from pathlib import Path

from checkout import HAS_GIT, HAS_HISTORY

from slambed.engines.docker_image import connect
from slambed.errors import SlambedError
from slambed.link.netem import netem_available
from slambed.sampling.cgroup import version


def _not_root() -> bool:
    return os.geteuid() != 0


def _no_docker() -> bool:
    try:
        connect().close()
    except SlambedError:
        return True
    return False


RULES: list[tuple[str, Callable[[], bool]]] = [
    (r"needs root", _not_root),
    (r"needs Docker|needs the node image", _no_docker),
    (r"this kernel has no netem", lambda: not netem_available()),
    (r"this kernel has netem", netem_available),
    (r"needs the program git", lambda: not HAS_GIT),
    (r"needs the history of a checkout", lambda: not HAS_HISTORY),
    (r"no autogroups", lambda: not Path("/proc/self/autogroup").exists()),
    (r"those of cgroup v1", lambda: version() != "v1"),
    (r"/dev/net/tun|TUN", lambda: _not_root() or not Path("/dev/net/tun").exists()),
    (r"no recording .* in the folders given", lambda: True),
]
"""Part of a skip reason, and whether it applies to this host."""


def unexpected(reason: str) -> bool:
    """Returns True if nothing about this host explains such a skip."""
    return not any(re.search(part, reason) and holds() for part, holds in RULES)
