# SPDX-License-Identifier: Apache-2.0
"""What a Docker daemon says about itself that a run needs to know: limits that it does not enforce,
folders that it does not see. After Docker's documentation of rootless mode and of `docker info`,
and that of the snap; the keys are those of the Engine API."""

from collections.abc import Mapping
from typing import Any

ENFORCED = {
    "CpuCfsQuota": "CPU quotas",
    "CPUSet": "CPU sets",
    "MemoryLimit": "memory limits",
}
"""Key of `docker info` -> what the daemon ignores where it is false."""
SNAP = "/var/snap/"


def shortcomings(info: Mapping[str, Any]) -> list[str]:
    """Returns a line for each thing that this daemon does not do; `info` is `client.info()`."""
    found: list[str] = []
    lacks = [what for key, what in ENFORCED.items() if info.get(key) is False]
    rootless = any("rootless" in str(option) for option in info.get("SecurityOptions") or [])
    if lacks:
        kind = "rootless Docker" if rootless else "this Docker"
        remedy = (
            "delegate cpu, cpuset and memory to your user (Delegate= of user@.service)"
            if rootless
            else "use --engine local, or a daemon outside of any container"
        )
        found.append(
            f"{kind} ignores {', '.join(lacks)}, so runs of limited devices are invalid; {remedy}"
        )
    elif rootless:
        found.append("rootless Docker was never tried here; use the usual daemon if it fails")
    if str(info.get("DockerRootDir", "")).startswith(SNAP):
        found.append(
            "Docker of the snap sees no files outside of your home and none in its hidden folders; "
            "set SLAMBED_CACHE and --results to visible folders there, or install docker.io"
        )
    return found
