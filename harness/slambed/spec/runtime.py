# SPDX-License-Identifier: Apache-2.0
"""`runtime:` of system.yaml: how a system with its own program is started.

Its software tag covers this section, the files of its folder and, in a container, its image.
"""

import hashlib
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from slambed.data.layouts import Layout
from slambed.errors import SlambedError
from slambed.files.names import FileName, must_be_word
from slambed.files.yaml_source import MisplacedError, matching
from slambed.suggestion import did_you_mean

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
DIGEST_DIGITS = 12
# None of these changes the behavior of a system.
LEFT_OUT_FOLDERS = {"__pycache__", ".git"}
LEFT_OUT_SUFFIXES = {".md", ".yaml", ".yml", ".pyc"}
SYSTEM_IN_CONTAINER, PLAYER_IN_CONTAINER = "/system", "/slambed"
PLAYERS_FILES = {
    "events.jsonl", "log.txt", "map.slm", "node.json", "ready.json", "trajectory.txt",
    "trajectory_live.txt",
}  # fmt: skip
"""Files that slambed-play writes into a node's output folder."""
OF_A_FOLDER = {"reads", "trajectory", "trajectory_format"}


Gpu = (
    Literal["all"]
    | Annotated[int, Field(ge=1)]
    | Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]
)
"""All GPUs, a number of GPUs, or a list of ids (numbers or UUIDs of nvidia-smi)."""


OF_A_RECORDING = ("frames", "trajectory")
"""Placeholders in the command of a system that reads a folder: that folder and the pose file."""
PLACES = ("folder", *OF_A_RECORDING)
"""Placeholders of a command."""


def _without_nul(text: str) -> str:
    if "\0" in text:
        raise ValueError("a NUL byte cannot be given to a program; remove it")
    return text


Text = Annotated[str, AfterValidator(_without_nul)]
"""What can be given to a program."""


class RoleRuntime(BaseModel):
    """One role of a system with its own program."""

    model_config = STRICT

    command: list[Text] = Field(min_length=1)
    """Program and arguments, started in the system's folder. `{folder}` is replaced by that
    folder."""
    image: str = ""
    """Engine docker: image of this role; replaces the common one."""
    env: dict[str, Text] = Field(default_factory=dict)
    """Name -> value of environment variables."""
    tmpfs: dict[str, int] = Field(default_factory=dict)
    """Engine docker: path of a writable tmpfs -> its size in MiB."""
    user: str = ""
    """Engine docker: user of the process; the default is a numeric id that owns no files."""
    gpu: Gpu | None = None
    """Engine docker: GPUs of the container: `all`, a number, or a list of ids."""
    client: bool = True
    """Whether the program talks to slambed-play through one of its client libraries; an edge
    need not."""

    @model_validator(mode="after")
    def _can_be_started(self) -> "RoleRuntime":
        for name in self.env:
            must_be_word(name, ("env", name))
        for index, word in enumerate(self.command):
            for name in re.findall(r"(?<!\$)\{([a-z_]+)\}", word):
                if name not in PLACES and (near := did_you_mean(name, PLACES)):
                    what = f"unknown placeholder '{{{name}}}'{near}"
                    raise MisplacedError(what, ("command", index))
        return self


Requirement = Annotated[str, *matching(r"^[^-\s]", "a requirement of pip, not an option")]
DebianPackage = Annotated[str, *matching(r"^[a-z0-9][a-z0-9.+-]+$", "the name of a Debian package")]


class PythonPackages(BaseModel):
    """Packages of PyPI that a system in Python needs. The harness installs them once into an
    environment in the cache, which nodes read; the resolved versions are part of run keys."""

    model_config = STRICT

    requires: list[Requirement] = Field(default_factory=list)
    """Requirements as pip has them, such as `numpy==2.2.1`."""
    requirements: str = ""
    """Name of a requirements file in the system's folder, with or without hashes; it replaces
    `requires`."""
    version: Annotated[str, *matching(r"^(3\.\d+)?$", "a version such as '3.11'")] = ""
    """Minor version of Python, such as `"3.11"`; the default is that of slambed's own Python."""
    apt: list[DebianPackage] = Field(default_factory=list)
    """Debian packages that the Python packages need. On engine local the host must have them; they
    are never installed there by slambed. An image that slambed makes has them."""

    @model_validator(mode="after")
    def _has_one_list(self) -> "PythonPackages":
        if bool(self.requires) == bool(self.requirements):
            raise ValueError("python needs either requires or requirements")
        return self


class Runtime(BaseModel):
    """How the programs of both roles are started."""

    model_config = STRICT

    image: str = ""
    """Name, or name@sha256:..., of an image on this host; its id is part of run keys."""
    files: list[str] = Field(default_factory=list)
    """Files outside the folder that belong to the software, such as a binary or a vocabulary."""
    ready_s: float = Field(default=30.0, gt=0, le=3600)
    """Timeout from the start until the program reports that it is ready."""
    python: PythonPackages | None = None
    """Packages of PyPI that the programs import."""
    reads: Layout | None = None
    """Layout of the recorded folder that the mobile role reads instead of frames from
    slambed-play."""
    trajectory: FileName = ""
    """For a system that reads a folder: the pose file that it writes to $SLAMBED_OUTPUT."""
    trajectory_format: Literal["tum", "kitti"] = "tum"
    """tum: `time tx ty tz qx qy qz qw`; kitti: 12 numbers per frame, camera to world."""
    mobile: RoleRuntime
    """Program of the mobile node."""
    edge: RoleRuntime | None = None
    """Program of the edge; given exactly where `roles` has one."""

    @model_validator(mode="after")
    def _has_one_way_to_its_frames(self) -> "Runtime":
        # Values are compared with their defaults because a fully written runtime has all fields
        # when it is read back.
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
        # A default that was written with all other fields, as in experiment.json, is no choice of
        # the user.
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
        """Returns whether the role's program talks to slambed-play."""
        return self.of(role).client and not (role == "mobile" and self.reads is not None)

    def of(self, role: str) -> RoleRuntime:
        """Returns the settings of the role."""
        part = self.edge if role == "edge" else self.mobile
        assert part is not None
        return part

    @property
    def gpus(self) -> list[Gpu]:
        """GPUs that the roles request."""
        parts = (self.mobile, self.edge)
        return [part.gpu for part in parts if part is not None and part.gpu is not None]

    def image_of(self, role: str) -> str:
        """Returns the image name of the role; empty without one."""
        return self.of(role).image or self.image


def foreign_digest(
    runtime: Runtime, folder: Path, images: Mapping[str, str], packages: str = ""
) -> str:
    """Returns SHA-256 (12 hex digits) of a system's software: its runtime section, the files of
    its folder, the files it names, its programs, its image ids and its installed `packages`.
    Raises SlambedError for missing files."""
    # Systems that read no folder, need no packages or request no GPU keep the run keys from before
    # these options existed.
    unused = OF_A_FOLDER if runtime.reads is None else set()
    if runtime.python is None:
        unused = unused | {"python"}
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
        # In a container the image contains the programs.
        known = {path.resolve() for _, _, path in parts}
        programs = _programs(runtime, folder)
        parts += [("program", path.name, path) for path in programs if path.resolve() not in known]
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
    if packages:
        digest.update(f"packages\0{packages}".encode())
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
        if "/" in name and inside.is_file():
            yield inside
        elif "/" not in name and (found := shutil.which(name)) is not None:
            yield Path(found).resolve()
