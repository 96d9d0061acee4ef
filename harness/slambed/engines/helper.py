# SPDX-License-Identifier: Apache-2.0
"""A helper container: executes for members of the group docker what otherwise needs root.

It runs this package with the host's Python (mounted read-only), so that both ways give the same
results. It has only the capabilities that its module needs, and ends with its standard input.
"""

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from slambed.engines.base import LABEL
from slambed.native import find_program

NAMESPACES = Path("/run/slambed")
"""Folder in which a helper finds the network namespace of each node."""
CAPABILITIES = {
    # setns; real-time priority of the metronome.
    "slambed.engines.sidecar": ["SYS_ADMIN", "SYS_NICE"],
    # setns; devices, addresses, queueing; ICMP; real-time priority and locked memory.
    "slambed.link.link_helper": ["SYS_ADMIN", "NET_ADMIN", "NET_RAW", "SYS_NICE", "IPC_LOCK"],
}
ALLOWED = Path("/proc/sys/net/ipv4/tcp_allowed_congestion_control")


@dataclass(frozen=True)
class Helper:
    """Common settings of the helpers of one run."""

    image_id: str
    run_key: str
    namespaces: dict[str, str]
    """Role -> file of the network namespace on the daemon's host."""

    def container(self, module: str) -> str:
        """Returns the container's name, which is unique per module and run."""
        return f"{LABEL}-{self.run_key}-{container_role(module)}"

    def command(self, module: str, writable: list[Path], readable: Sequence[Path]) -> list[str]:
        """Returns the `docker run` command for a module of this package."""
        capabilities = [part for c in CAPABILITIES[module] for part in ("--cap-add", c)]
        return [
            *("docker", "run", "--interactive", "--rm"),
            *("--name", self.container(module), "--label", f"{LABEL}={self.run_key}"),
            *("--label", f"{LABEL}.role={container_role(module)}"),
            # Threads are moved between cgroups by their ids on the host.
            *("--pid", "host", "--cgroupns", "host", "--network", _network()),
            *("--user", "0:0", "--cap-drop", "ALL", *capabilities),
            *("--security-opt", "no-new-privileges", "--read-only"),
            # The nodes' TCP settings are in /proc/sys.
            *("--security-opt", "systempaths=unconfined", "--security-opt", "apparmor=unconfined"),
            *("--device", "/dev/net/tun"),
            *self._volumes(writable, readable),
            *("--env", f"PYTHONPATH={_package_folder()}", "--env", f"SLAMBED_BIN={_programs()}"),
            *("--env", "PYTHONDONTWRITEBYTECODE=1", "--env", "HOME=/tmp", "--tmpfs", "/tmp"),
            *("--entrypoint", sys.executable, self.image_id, "-m", module),
        ]

    def _volumes(self, writable: list[Path], readable: Sequence[Path]) -> list[str]:
        bound = read_only([*host_python(), _programs(), *readable])
        bound += [f"{path}:{path}" for path in writable]
        bound += [f"{file}:{NAMESPACES / role}:ro" for role, file in self.namespaces.items()]
        bound.append("/sys/fs/cgroup:/sys/fs/cgroup")
        return [part for volume in bound for part in ("--volume", volume)]


def host_python() -> list[Path]:
    """Returns the files of the host that this package needs."""
    needed = [Path("/usr"), Path("/etc/ld.so.cache"), _package_folder()]
    prefixes = (Path(prefix) for prefix in (sys.prefix, sys.base_prefix))
    return needed + [prefix for prefix in prefixes if not prefix.is_relative_to("/usr")]


def read_only(paths: list[Path]) -> list[str]:
    """Returns volume options that mount paths read-only at the same place."""
    return [f"{path}:{path}:ro" for path in dict.fromkeys(paths) if path.exists()]


def container_role(module: str) -> str:
    """Returns the role in the label and the name of a module's container."""
    return module.rpartition(".")[2]


def _package_folder() -> Path:
    return Path(__file__).resolve().parents[2]


def _programs() -> Path:
    return find_program("slambed-relay").resolve().parent


def _network() -> str:
    """Returns the network of the helper. It is not used, but if the host does not allow cubic to
    all namespaces, only the initial namespace can change that."""
    try:
        allowed = ALLOWED.read_text(encoding="ascii").split()
    except OSError:
        return "none"
    return "none" if "cubic" in allowed else "host"


def direct_command(module: str) -> list[str]:
    """Returns the command that runs the module as a child, for a harness with root privileges."""
    return [sys.executable, "-m", module]


def is_root() -> bool:
    return os.geteuid() == 0
