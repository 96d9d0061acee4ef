# SPDX-License-Identifier: Apache-2.0
"""A node's limits as options of Docker."""

import contextlib
from typing import Any

import docker

from slambed.engines.base import LABEL, NodePlan
from slambed.engines.docker_errors import DAEMON_ERRORS

KEPT_LOGS = 2
"""With one file the daemon would begin again at each limit, and keep nothing of before."""


def limits_of(plan: NodePlan) -> dict[str, Any]:
    """Returns the limits as arguments of the Docker API."""
    limits = plan.limits
    found: dict[str, Any] = {"cpuset_cpus": ",".join(map(str, plan.cpus))}
    if limits.quota_cores is not None:
        period_us = round(limits.period_ms * 1000)
        found |= {"cpu_period": period_us, "cpu_quota": round(limits.quota_cores * period_us)}
    if limits.memory_mb is not None:
        found |= {"mem_limit": limits.memory_mb * 2**20}
    return found


def writing_limits(plan: NodePlan) -> dict[str, Any]:
    """Returns the limits of what a node writes: no file is larger, and the daemon keeps no more
    of what it prints, whatever the daemon's own log driver is."""
    if plan.limit_bytes is None:
        return {}
    size = docker.types.Ulimit(name="fsize", soft=plan.limit_bytes, hard=plan.limit_bytes)
    kept = {"max-size": str(plan.limit_bytes), "max-file": str(KEPT_LOGS)}
    log = docker.types.LogConfig(type=docker.types.LogConfig.types.JSON, config=kept)
    return {"ulimits": [size], "log_config": log}


def as_options(limits: dict[str, Any]) -> list[str]:
    """Returns the same limits as options of `docker run`."""
    named = {"memory" if key == "mem_limit" else key: value for key, value in limits.items()}
    return [
        part for key, value in named.items() for part in (f"--{key.replace('_', '-')}", str(value))
    ]


def parent_group(client: docker.DockerClient) -> str | None:
    """Returns the parent cgroup of engine `local` if the daemon manages cgroups itself: its weight
    gives the nodes priority over the rest of the host. With systemd, containers stay in its slices.

    An unreachable daemon is reported later, when a container is created.
    """
    with contextlib.suppress(*DAEMON_ERRORS):
        if client.info().get("CgroupDriver") == "cgroupfs":
            return f"/{LABEL}"
    return None
