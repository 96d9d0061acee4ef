# SPDX-License-Identifier: Apache-2.0
"""GPUs for containers of systems with their own programs: `gpu` of their runtime, as in `docker
run --gpus`."""

import contextlib
from typing import Any

import docker
from docker.errors import APIError, NotFound
from docker.types import DeviceRequest

from slambed.engines.base import LABEL
from slambed.engines.docker_errors import daemon_failures
from slambed.errors import environment_error
from slambed.spec.runtime import Gpu

ALL = -1
"""Value in Docker's API."""


def gpu_options(gpu: Gpu | None) -> dict[str, Any]:
    """Returns the GPU part of a container request; empty without a GPU."""
    if gpu is None:
        return {}
    if isinstance(gpu, list):
        request = DeviceRequest(device_ids=gpu, capabilities=[["gpu"]])
    else:
        request = DeviceRequest(count=ALL if gpu == "all" else gpu, capabilities=[["gpu"]])
    return {"device_requests": [request]}


def must_give_gpu(client: docker.DockerClient, image: str, gpu: Gpu, system: str) -> None:
    """Tests GPU access with a container of `image` that ends at once, because the daemon does
    not report it. Raises SlambedError without access."""
    with daemon_failures("make a container with a GPU"):
        container = client.containers.create(
            image,
            entrypoint=["/bin/true"],
            labels={LABEL: "gpu"},
            network_mode="none",
            read_only=True,
            cap_drop=["ALL"],
            security_opt=["no-new-privileges"],
            **gpu_options(gpu),
        )
        try:
            container.start()
        except APIError as error:
            raise environment_error(
                f"system {system} asks for a GPU (gpu: {gpu}), and Docker gives none: "
                f"{error.explanation}; install the NVIDIA Container Toolkit, or leave gpu out"
            ) from None
        finally:
            with contextlib.suppress(NotFound):
                container.remove(force=True, v=True)
