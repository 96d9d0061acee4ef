# SPDX-License-Identifier: Apache-2.0
"""The image of systems with `runtime: python:` that name none: Debian's Python, and the Debian
packages that the system asks for. The packages of PyPI are mounted from the cache."""

import contextlib
import hashlib
import os
import shutil
import subprocess

import docker
from docker.errors import APIError, NotFound

from slambed.engines.base import LABEL, NodePlan
from slambed.engines.docker_errors import no_docker_command
from slambed.engines.foreign import ENVIRONMENT_IN_CONTAINER
from slambed.engines.python_packages import find_environment, version_of
from slambed.errors import environment_error
from slambed.native import repository_root
from slambed.spec.runtime import PythonPackages, Runtime

BASES = {"3.11": "debian:bookworm-slim", "3.12": "ubuntu:24.04", "3.13": "debian:trixie-slim"}
"""Minor version of Python -> the system that has it. A host with that Python is mostly the same
system, so that what it installs or compiles fits the C library of the image."""
REPOSITORY = "slambed-python"
KEY_DIGITS = 12
ANSWER_LIMIT_S = 60


def image_name(runtime: Runtime, role: str, system: str) -> str:
    """Returns the image of a role: the one it names, else the one that slambed makes for its
    Python packages; empty if it has neither. Raises SlambedError if slambed cannot make it."""
    if not is_made_here(runtime, role):
        return runtime.image_of(role)
    assert runtime.python is not None
    recipe = _recipe(runtime.python, base_of(runtime.python, system))
    key = hashlib.sha256(recipe.encode()).hexdigest()[:KEY_DIGITS]
    return f"{REPOSITORY}:{key}"


def is_made_here(runtime: Runtime, role: str) -> bool:
    """Returns whether slambed makes the image of this role itself."""
    return runtime.python is not None and not runtime.image_of(role)


def base_of(python: PythonPackages, system: str) -> str:
    """Returns the system that has the Python of the packages. Raises SlambedError if none has."""
    version = version_of(python)
    if (base := BASES.get(version)) is None:
        raise environment_error(
            f"system {system} has packages of Python {version}, and slambed makes images with "
            f"{', '.join(BASES)}; name an image in runtime.image, or use --engine local"
        )
    return base


def build_python_image(python: PythonPackages, name: str, system: str) -> None:
    """Builds the image; output goes to the terminal. Raises SlambedError if it cannot be built."""
    base = base_of(python, system)
    if shutil.which("docker") is None:
        raise no_docker_command(f"the image of system {system}")
    script = repository_root() / "tools" / "base_image.sh"
    if subprocess.run(["bash", str(script), base], check=False).returncode == 0:
        print(f"making image {name}: {base} with {', '.join(['python3', *python.apt])}", flush=True)
        built = subprocess.run(
            ["docker", "build", "--quiet", "-t", name, "-"],
            input=_recipe(python, base),
            text=True,
            check=False,
            # Every Docker has the classic builder.
            env=os.environ | {"DOCKER_BUILDKIT": "0"},
        )
        if built.returncode == 0:
            return
    raise environment_error(
        f"the image of system {system} could not be built, see the lines above; correct python.apt "
        "of its system.yaml, or check the network"
    )


def must_have_python(client: docker.DockerClient, image: str, version: str, system: str) -> None:
    """Raises SlambedError if the python3 of a user's image is not of the minor version that the
    packages were installed for: their binary modules would not be found."""
    container = client.containers.create(
        image,
        ["-c", "import sys; print('%d.%d' % sys.version_info[:2])"],
        entrypoint=["python3"],
        labels={LABEL: "python"},
        network_mode="none",
    )
    try:
        container.start()
        container.wait(timeout=ANSWER_LIMIT_S)
        found = container.logs(stderr=False).decode(errors="replace").strip()
    except APIError as refused:
        raise environment_error(
            f"system {system}: python3 does not start in image {image}: {refused.explanation}; "
            "correct runtime.image, or leave it out and slambed makes one"
        ) from None
    finally:
        with contextlib.suppress(NotFound):
            container.remove(force=True, v=True)
    if found != version:
        raise environment_error(
            f"system {system} has packages of Python {version}, and image {image} has "
            f"{found or 'none that answers'}; name its version under python in its system.yaml"
        )


def python_volume(plan: NodePlan) -> dict[str, dict[str, str]]:
    """Returns the volume with the Python packages of a container's system."""
    assert plan.runtime is not None and plan.system_folder is not None
    if plan.runtime.python is None:
        return {}
    folder = find_environment(plan.runtime.python, plan.system_folder).folder
    return {str(folder): {"bind": ENVIRONMENT_IN_CONTAINER, "mode": "ro"}}


def _recipe(python: PythonPackages, base: str) -> str:
    wanted = " ".join(["python3", *sorted(python.apt)])
    return (
        f"FROM {base}\n"
        f"RUN apt-get update && apt-get install -y --no-install-recommends {wanted} "
        "&& rm -rf /var/lib/apt/lists/*\n"
    )
