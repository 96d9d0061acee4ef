# SPDX-License-Identifier: Apache-2.0
"""The segmenter next to an edge container: a separate container with the host's Python mounted
read-only and a shared folder as its only connection."""

import contextlib
import os
import subprocess
from pathlib import Path
from typing import Any

import docker
from docker.errors import NotFound

from slambed.data.places import cache_folder
from slambed.engines.base import LABEL, NODE_UID, NodePlan
from slambed.engines.docker_errors import DAEMON_ERRORS, no_docker_command
from slambed.engines.docker_limits import as_options, limits_of
from slambed.engines.helper import host_python, read_only
from slambed.engines.segmenter import (
    ENVIRONMENT,
    LOG,
    SOCKET,
    SegmenterProcess,
    command,
    make_folder,
)
from slambed.native import repository_root
from slambed.segment import WITH_INPUT

PIDS_LIMIT = 64


def group_of_edge(client: docker.DockerClient, pid: int) -> str | None:
    """Returns the edge container's cgroup as a parent for another container. None if the daemon
    cannot use it: a v2 cgroup with processes has no children, and systemd requires a slice."""
    info = client.info()
    if info.get("CgroupDriver") != "cgroupfs" or str(info.get("CgroupVersion")) != "1":
        return None
    for line in Path(f"/proc/{pid}/cgroup").read_text().splitlines():
        _, controllers, path = line.split(":", 2)
        if "cpu" in controllers.split(",") and path != "/" and ".." not in path:
            return path
    return None


def start_segmenter(
    client: docker.DockerClient, image: Any, plan: NodePlan, edge_pid: int, network: str
) -> SegmenterProcess:
    """Starts the segmenter in the edge's cgroup, or in one with the same limits."""
    folder = make_folder(plan.run_dir)
    name = f"{LABEL}-{plan.run_key}-segmenter"

    def clear() -> None:
        with contextlib.suppress(NotFound, *DAEMON_ERRORS):
            client.containers.get(name).remove(force=True, v=True)

    clear()
    parent = group_of_edge(client, edge_pid)
    environment = ENVIRONMENT | {"SLAMBED_CACHE": str(cache_folder().resolve()), "HOME": "/tmp"}
    bound = [
        *host_python(),
        repository_root() / "catalog" / "networks",
        cache_folder().resolve() / "networks",
    ]
    if network.endswith(".yaml"):
        bound.append(Path(network).resolve())
    # Runs as the harness's user, who can read the host's private files without capabilities. The
    # edge is in the same user group, which may use the socket.
    user = f"{os.geteuid()}:{NODE_UID}"
    run = [
        *("docker", "run", "--interactive", "--rm", "--name", name),
        *("--label", f"{LABEL}={plan.run_key}", "--label", f"{LABEL}.role=segmenter"),
        *("--network", "none", "--user", user, "--cap-drop", "ALL"),
        *("--security-opt", "no-new-privileges", "--read-only", "--tmpfs", "/tmp"),
        *("--pids-limit", str(PIDS_LIMIT)),
        *(("--cgroup-parent", parent) if parent is not None else as_options(limits_of(plan))),
        *(part for volume in read_only(bound) for part in ("--volume", volume)),
        *("--volume", f"{folder}:{folder}"),
        *(part for item in environment.items() for part in ("--env", "=".join(item))),
    ]
    # The container ends with this process.
    python, *arguments = command(str(folder / SOCKET), network, WITH_INPUT)
    log_file = folder / LOG
    with log_file.open("ab") as log:
        if parent is None:
            log.write(b"in a control group of its own, with the edge's limits\n")
            log.flush()
        try:
            process = subprocess.Popen(
                [*run, "--entrypoint", python, str(image.id), *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,
            )
        except FileNotFoundError:
            raise no_docker_command("the segmenter") from None
    return SegmenterProcess(process, log_file, clear)
