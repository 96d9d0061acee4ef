# SPDX-License-Identifier: Apache-2.0
"""How an engine starts a system with its own program: slambed-play runs in front of it."""

import sys
from pathlib import Path
from typing import Any

from slambed.engines.base import NODE_UID, NodePlan
from slambed.engines.docker_gpu import gpu_options
from slambed.engines.python_packages import find_environment
from slambed.errors import environment_error
from slambed.native import find_program, repository_root
from slambed.spec.runtime import OF_A_RECORDING, PLAYER_IN_CONTAINER, SYSTEM_IN_CONTAINER

PLAYER = "slambed-play"
PATH = "/usr/local/bin:/usr/bin:/bin"
FRAMES_IN_CONTAINER = "/frames"
ENVIRONMENT_IN_CONTAINER = "/python"
ELF_INTERPRETER = 3
"""Program header type PT_INTERP: the program needs shared libraries of its host."""


def clients_folder() -> Path:
    """Returns the folder of slambed_client.py and slambed_client.h."""
    return repository_root() / "systems" / "apps" / "play" / "client"


def player_arguments(plan: NodePlan, config: str, folder: str, frames: str = "") -> list[str]:
    """Returns the arguments of slambed-play. `folder` is the system's folder, `frames` the
    recorded one if it reads one; all paths are as the node sees them."""
    assert plan.runtime is not None
    places = {"folder": folder, **_recorded(plan, config, frames)}
    own = list(plan.runtime.of(plan.role).command)
    for name, place in places.items():
        own = [word.replace("{" + name + "}", place) for word in own]
    flags = [] if plan.runtime.has_client(plan.role) else ["--no-client"]
    if "trajectory" in places:
        flags += ["--trajectory", plan.runtime.trajectory]
    return [
        *("--role", plan.role, "--config", config, "--directory", folder),
        *(*flags, "--", *own),
    ]


def _recorded(plan: NodePlan, config: str, frames: str) -> dict[str, str]:
    """Returns the recorded folder and the pose file, for a system that reads a folder."""
    assert plan.runtime is not None
    if plan.runtime.reads is None or plan.role != "mobile":
        return {}
    left = Path(config).parent / plan.role / plan.runtime.trajectory
    return dict(zip(OF_A_RECORDING, (frames, str(left)), strict=True))


def environment(
    plan: NodePlan, clients: str, path: str | None, config: str = "", frames: str = ""
) -> dict[str, str]:
    """Returns the environment of the program, except for what slambed-play adds; independent of
    the user's shell. `path` is None if the image defines PATH."""
    assert plan.runtime is not None
    own = plan.runtime.of(plan.role).env
    usual = {"LANG": "C.UTF-8", "HOME": "/tmp", "PYTHONDONTWRITEBYTECODE": "1"}
    if path is not None:
        usual["PATH"] = path
    python = [clients, *filter(None, [own.get("PYTHONPATH")])]
    if plan.runtime.python is not None:
        assert plan.system_folder is not None
        installed = find_environment(plan.runtime.python, plan.system_folder)
        if path is None:
            # The image has a Python of the same version (docker_python.py); the environment's own
            # is a link to one of the host.
            python.append(f"{ENVIRONMENT_IN_CONTAINER}/{installed.packages_inside}")
        else:
            usual["PATH"] = f"{installed.programs}:{path}"
    recorded = _recorded(plan, config, frames)
    places = {f"SLAMBED_{name.upper()}": place for name, place in recorded.items()}
    return usual | own | places | {"PYTHONPATH": ":".join(python)}


def host_path() -> str:
    """Puts slambed's own environment first: its python3 has numpy and OpenCV."""
    return f"{Path(sys.executable).parent}:{PATH}"


def container_options(plan: NodePlan, image: str, config: str, barrier: str) -> dict[str, Any]:
    """Returns the container options for a third-party image. The player itself waits at the
    start barrier, because an image may have no shell."""
    assert plan.runtime is not None
    part = plan.runtime.of(plan.role)
    clients = f"{PLAYER_IN_CONTAINER}/client"
    arguments = player_arguments(plan, config, SYSTEM_IN_CONTAINER, FRAMES_IN_CONTAINER)
    return {
        "image": image,
        "entrypoint": [f"{PLAYER_IN_CONTAINER}/{PLAYER}"],
        "command": ["--start-barrier", barrier, *arguments],
        "user": part.user or f"{NODE_UID}:{NODE_UID}",
        "environment": environment(plan, clients, None, config, FRAMES_IN_CONTAINER),
        **gpu_options(part.gpu),
        "tmpfs": {place: f"size={size}m" for place, size in part.tmpfs.items()},
    }


def player_volumes(plan: NodePlan) -> dict[str, dict[str, str]]:
    """Returns the volumes of a container with a third-party image."""
    assert plan.system_folder is not None
    player = find_program(PLAYER)
    if not _is_static(player):
        raise environment_error(
            f"{player} needs libraries of this host, which no image of others has; "
            "run 'slambed images --force'"
        )
    volumes = {
        str(player): {"bind": f"{PLAYER_IN_CONTAINER}/{PLAYER}", "mode": "ro"},
        str(clients_folder()): {"bind": f"{PLAYER_IN_CONTAINER}/client", "mode": "ro"},
        str(plan.system_folder): {"bind": SYSTEM_IN_CONTAINER, "mode": "ro"},
    }
    if plan.frames is not None and plan.role == "mobile":
        volumes[str(plan.frames.resolve())] = {"bind": FRAMES_IN_CONTAINER, "mode": "ro"}
    return volumes


def _is_static(program: Path) -> bool:
    """Returns whether an ELF64 program has no interpreter."""
    content = program.read_bytes()
    begin = int.from_bytes(content[32:40], "little")
    size = int.from_bytes(content[54:56], "little")
    count = int.from_bytes(content[56:58], "little")
    kinds = [int.from_bytes(content[begin + i * size :][:4], "little") for i in range(count)]
    return content[:4] == b"\x7fELF" and ELF_INTERPRETER not in kinds
