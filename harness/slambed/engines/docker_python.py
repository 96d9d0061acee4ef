# SPDX-License-Identifier: Apache-2.0
"""The image of systems with `runtime: python:` that name none: Debian's Python, and the Debian
packages that the system asks for. The packages of PyPI are mounted from the cache."""

import hashlib
import os
import subprocess

from slambed.engines.base import NodePlan
from slambed.engines.foreign import ENVIRONMENT_IN_CONTAINER
from slambed.engines.python_packages import find_environment
from slambed.errors import environment_error
from slambed.native import repository_root
from slambed.spec.runtime import PythonPackages, Runtime

BASE = "debian:bookworm-slim"
BASE_PYTHON = "3.11"
REPOSITORY = "slambed-python"
KEY_DIGITS = 12


def image_name(runtime: Runtime, role: str) -> str:
    """Returns the image of a role: the one it names, else the one that slambed makes for its
    Python packages; empty if it has neither."""
    if (named := runtime.image_of(role)) or runtime.python is None:
        return named
    key = hashlib.sha256(_recipe(runtime.python).encode()).hexdigest()[:KEY_DIGITS]
    return f"{REPOSITORY}:{key}"


def is_made_here(name: str) -> bool:
    """Returns whether slambed makes the image of this name itself."""
    return name.startswith(f"{REPOSITORY}:")


def build_python_image(python: PythonPackages, name: str, version: str, system: str) -> None:
    """Builds the image; output goes to the terminal. `version`: minor version of the packages'
    Python. Raises SlambedError if the image cannot be built or has another Python."""
    if version != BASE_PYTHON:
        raise environment_error(
            f"system {system} has packages of Python {version}, and {BASE} has {BASE_PYTHON}; name "
            f"an image with Python {version} in runtime.image, or use --engine local"
        )
    base = subprocess.run(["bash", str(repository_root() / "tools" / "base_image.sh")], check=False)
    if base.returncode == 0:
        print(f"making image {name}: {BASE} with {', '.join(['python3', *python.apt])}", flush=True)
        built = subprocess.run(
            ["docker", "build", "--quiet", "-t", name, "-"],
            input=_recipe(python),
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


def python_volume(plan: NodePlan) -> dict[str, dict[str, str]]:
    """Returns the volume with the Python packages of a container's system."""
    assert plan.runtime is not None and plan.system_folder is not None
    if plan.runtime.python is None:
        return {}
    folder = find_environment(plan.runtime.python, plan.system_folder).folder
    return {str(folder): {"bind": ENVIRONMENT_IN_CONTAINER, "mode": "ro"}}


def _recipe(python: PythonPackages) -> str:
    wanted = " ".join(["python3", *sorted(python.apt)])
    return (
        f"FROM {BASE}\n"
        f"RUN apt-get update && apt-get install -y --no-install-recommends {wanted} "
        "&& rm -rf /var/lib/apt/lists/*\n"
    )
