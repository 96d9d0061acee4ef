# SPDX-License-Identifier: Apache-2.0
"""`runtime:` of system.yaml: how a system that is a program of its own is started.

Its software is what the section says, the files of its folder, and, in a container, its image.
"""

import hashlib
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from slambed.data.layouts import Layout
from slambed.errors import SlambedError

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
DIGEST_DIGITS = 12
# None of these changes what a system does.
LEFT_OUT_FOLDERS = {"__pycache__", ".git"}
LEFT_OUT_SUFFIXES = {".md", ".yaml", ".yml", ".pyc"}
SYSTEM_IN_CONTAINER, PLAYER_IN_CONTAINER = "/system", "/slambed"
PLAYERS_FILES = {
    "events.jsonl", "log.txt", "map.slm", "node.json", "ready.json", "trajectory.txt",
    "trajectory_live.txt",
}  # fmt: skip
"""Of a node's output folder."""
OF_A_FOLDER = {"reads", "trajectory", "trajectory_format"}


Gpu = (
    Literal["all"]
    | Annotated[int, Field(ge=1)]
    | Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]
)
"""All of them, how many, or these (numbers or UUIDs of nvidia-smi)."""


class RoleRuntime(BaseModel):
    """One role of a system that is a program of its own."""

    model_config = STRICT

    command: list[str] = Field(min_length=1)
    """Program and arguments; starts in the system's folder. `{folder}` is that folder."""
    image: str = ""
    """Of engine docker, instead of the one for all roles."""
    env: dict[str, str] = Field(default_factory=dict)
    """Name -> value of environment variables."""
    tmpfs: dict[str, int] = Field(default_factory=dict)
    """Engine docker: folder -> MB that can be written there."""
    user: str = ""
    """Engine docker: instead of a number that owns nothing."""
    gpu: Gpu | None = None
    """Engine docker: GPUs that the container gets: `all`, how many, or a list of their ids."""
    client: bool = True
    """It speaks to slambed-play by one of its clients; an edge need not."""


class Runtime(BaseModel):
    """How both roles are started."""

    model_config = STRICT

    image: str = ""
    """Name, or name@sha256:..., of an image that this host has; its id is part of run keys."""
    files: list[str] = Field(default_factory=list)
    """Files outside of the folder that belong to the software: a binary, a vocabulary."""
    ready_s: float = Field(default=30.0, gt=0, le=3600)
    """Longest time from its start until it says that it is ready."""
    reads: Layout | None = None
    """The mobile role reads a recorded folder of this layout, instead of frames of the player."""
    trajectory: str = Field(default="", pattern=r"^([A-Za-z0-9][A-Za-z0-9_.-]*)?$")
    """Where it reads a folder: the file with its poses that it leaves in $SLAMBED_OUTPUT."""
    trajectory_format: Literal["tum", "kitti"] = "tum"
    """`time tx ty tz qx qy qz qw`, or twelve numbers for each frame, camera to world."""
    mobile: RoleRuntime
    """Program of the mobile node."""
    edge: RoleRuntime | None = None
    """Program of the edge; given exactly where `roles` has one."""

    @model_validator(mode="after")
    def _has_one_way_to_its_frames(self) -> "Runtime":
        # By their values: a runtime that was written down whole has all fields and is read back.
        fields = type(self).model_fields
        extra = {n for n in OF_A_FOLDER - {"reads"} if getattr(self, n) != fields[n].default}
        if self.reads is None and extra:
            raise ValueError(f"{min(extra)} belongs to a system that reads a folder; write reads")
        if self.reads is None and not self.mobile.client:
            raise ValueError(
                "the mobile role takes its frames by a client (client: true), or reads a folder "
                "(reads: tum, euroc or kitti)"
            )
        if self.reads is None:
            return self
        # A default that was written down with all others, as in experiment.json, is nobody's wish.
        given = self.mobile.model_fields_set
        by_hand = "client" in given and given != set(type(self.mobile).model_fields)
        if by_hand and self.mobile.client:
            raise ValueError("a mobile role that reads a folder has no client; leave one out")
        if not self.trajectory:
            raise ValueError("a system that reads a folder leaves its poses in a file: trajectory")
        if self.trajectory in PLAYERS_FILES:
            raise ValueError(f"trajectory: {self.trajectory} is the player's; take another name")
        return self

    def has_client(self, role: str) -> bool:
        """Whether the role's program speaks to slambed-play."""
        return self.of(role).client and not (role == "mobile" and self.reads is not None)

    def of(self, role: str) -> RoleRuntime:
        """The role's part."""
        part = self.edge if role == "edge" else self.mobile
        assert part is not None
        return part

    @property
    def gpus(self) -> list[Gpu]:
        """What its roles ask for."""
        parts = (self.mobile, self.edge)
        return [part.gpu for part in parts if part is not None and part.gpu is not None]

    def image_of(self, role: str) -> str:
        """Name of the role's image; empty without one."""
        return self.of(role).image or self.image


def foreign_digest(runtime: Runtime, folder: Path, images: Mapping[str, str]) -> str:
    """SHA-256 (12 hex digits) of a system's software: its runtime section, the files of its folder,
    those that it names, its programs, and the ids of its images. Raises SlambedError for files that
    are not there."""
    # Runs of systems that read no folder, or ask for no GPU, keep the keys they had before any did.
    unused = OF_A_FOLDER if runtime.reads is None else set()
    left_out: dict[str, Any] = dict.fromkeys(("ready_s", *unused), True)
    for role in ("mobile", "edge"):
        part = getattr(runtime, role)
        if part is not None and part.gpu is None:
            left_out[role] = {"gpu"}
    digest = hashlib.sha256(runtime.model_dump_json(exclude=left_out).encode())
    named = [Path(name) if Path(name).is_absolute() else folder / name for name in runtime.files]
    parts = [("folder", path.relative_to(folder).as_posix(), path) for path in _files(folder)]
    parts += [("file", path.name, path) for path in named]
    if not images:
        # In a container the image has the programs.
        parts += [("program", path.name, path) for path in _programs(runtime, folder)]
    for kind, name, path in parts:
        try:
            content = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise SlambedError(
                f"runtime of {folder / 'system.yaml'}: {path}: {error.strerror}; correct files"
            ) from None
        digest.update(f"{kind}\0{name}\0{content}\n".encode())
    for name, identity in sorted(images.items()):
        digest.update(f"image\0{name}\0{identity}\n".encode())
    return digest.hexdigest()[:DIGEST_DIGITS]


def _files(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder).parts
        hidden = any(part.startswith(".") for part in inside)
        if hidden or LEFT_OUT_FOLDERS.intersection(inside) or path.suffix in LEFT_OUT_SUFFIXES:
            continue
        if path.is_file():
            yield path


def _programs(runtime: Runtime, folder: Path) -> Iterator[Path]:
    for part in filter(None, (runtime.mobile, runtime.edge)):
        name = part.command[0].replace("{folder}", str(folder))
        inside = folder / name
        if "/" in name and inside.is_file() and not inside.is_relative_to(folder):
            yield inside
        elif "/" not in name and (found := shutil.which(name)) is not None:
            yield Path(found).resolve()
