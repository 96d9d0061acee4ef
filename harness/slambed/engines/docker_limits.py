# SPDX-License-Identifier: Apache-2.0
"""A node's limits as options of Docker."""

import contextlib
from typing import Any

import docker

from slambed.engines.base import LABEL, NodePlan
from slambed.engines.docker_errors import DAEMON_ERRORS


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
