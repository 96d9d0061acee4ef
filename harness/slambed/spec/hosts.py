# SPDX-License-Identifier: Apache-2.0
"""hosts.yaml: the machines that may execute the live runs of a campaign
(docs/reference/hosts.md)."""

from collections import Counter
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from slambed.errors import SlambedError
from slambed.files.names import Address, Name
from slambed.files.yaml_source import YamlSource, load_yaml, parse
from slambed.suggestion import suggestion

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True)
HERE = "here"
"""Address of the machine that starts the campaign."""


class Host(BaseModel):
    """A machine that executes live runs, one at a time."""

    model_config = STRICT

    name: Name
    """Name in manifests and tables."""
    address: Address
    """SSH address (`user@machine`, `ssh://user@machine:port`, an alias), or `here`."""
    slambed: str = Field(default="slambed", min_length=1)
    """Folder of the checkout on that host, with its `.venv`; relative to the home folder."""
    engine: Literal["docker", "local"] = "docker"
    """What executes the runs there."""
    cores: int | None = Field(default=None, ge=1, le=1024)
    """Number of CPUs that runs may use on that host, the first available ones; null = all."""
    labels: list[Name] = Field(default_factory=list)
    """Labels that select the host with `--on`."""
    ssh: list[str] = Field(default_factory=list)
    """Further arguments of the ssh command, such as `-p` and a port."""
    environment: dict[str, str] = Field(default_factory=dict)
    """Environment variables of the runs on that host: `SLAMBED_CACHE`, `SLAMBED_DATA`."""

    @property
    def is_here(self) -> bool:
        """True for the machine that starts the campaign."""
        return self.address == HERE


class Hosts(BaseModel):
    """The content of hosts.yaml."""

    model_config = STRICT

    hosts: list[Host] = Field(min_length=1)
    """The machines."""


def read_hosts(path: Path, on: list[str] | None = None, engine: str | None = None) -> list[Host]:
    """Returns the hosts of a file, or only those with a name or label in `on`.

    `engine` is the command line's choice. All hosts must have the same engine because it is part of
    the run key. Raises a one-line SlambedError for an invalid file.
    """
    source = load_yaml(path)
    hosts = parse(Hosts, source).hosts
    _check(hosts, source)
    chosen = [host for host in hosts if not on or {host.name, *host.labels} & set(on)]
    known = [word for host in hosts for word in (host.name, *host.labels)]
    for word in on or []:
        if word not in known:
            raise SlambedError(
                f"--on {word} is no host and no label of {path}; {suggestion(word, known)}"
            )
    engines = {host.engine: host.name for host in chosen}
    if engine not in (None, "auto"):
        for host in chosen:
            if host.engine != engine:
                raise SlambedError(
                    f"--engine {engine}, but host {host.name} of {path} has engine {host.engine}; "
                    "leave --engine out, or choose hosts with --on"
                )
    elif len(engines) > 1:
        message = ", ".join(f"{name} has {engine}" for engine, name in engines.items())
        raise SlambedError(
            f"hosts of {path} have different engines, which makes different runs: {message}; "
            "choose hosts of one with --on"
        )
    return chosen


def _check(hosts: list[Host], source: YamlSource) -> None:
    for key in ("name", "address"):
        seen: Counter[tuple[str, ...]] = Counter()
        for index, host in enumerate(hosts):
            # The same machine with two SSH ports counts as two addresses.
            value = (host.name,) if key == "name" else (host.address, *host.ssh)
            seen[value] += 1
            if seen[value] > 1:
                raise source.complaint(f"{key} '{value[0]}' is given twice", ("hosts", index, key))
    names = {host.name for host in hosts}
    for index, host in enumerate(hosts):
        if wrong := names.intersection(host.labels):
            raise source.complaint(
                f"label '{min(wrong)}' is the name of a host", ("hosts", index, "labels")
            )
        if host.is_here and host.ssh:
            raise source.complaint(
                "'ssh' is for hosts that ssh leads to, this one is here", ("hosts", index, "ssh")
            )
