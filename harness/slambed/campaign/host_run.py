# SPDX-License-Identifier: Apache-2.0
"""A live run on one of several hosts: the data sent to the worker, and its execution there."""

import hashlib
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from slambed.campaign.foreign import software_of_foreign
from slambed.campaign.live_executor import LiveExecutor
from slambed.campaign.manifest import add_facts
from slambed.campaign.remote_result import of_machine
from slambed.campaign.remote_sequence import pack, remote_sequence, with_reference
from slambed.engines.base import Engine
from slambed.engines.live_run import LinkOpener
from slambed.engines.result import InterruptedRunError
from slambed.errors import KilledError, environment_error
from slambed.metrics.summary import Summary
from slambed.native import repository_root
from slambed.records.manifest import RunHost
from slambed.spec.experiment import Experiment
from slambed.spec.library import Library
from slambed.spec.run_spec import RunSpec


@dataclass
class ThisHost:
    """What the worker's process knows about its host."""

    engine: Engine
    open_link: LinkOpener
    facts: RunHost
    scratch: Path
    stop: threading.Event = field(default_factory=threading.Event)
    """Set when the campaign ends."""
    busy: threading.Lock = field(default_factory=threading.Lock)
    """Held during a run."""


_HERE: list[ThisHost] = []


def begin(host: ThisHost) -> None:
    """Initializes this process for runs."""
    _HERE[:] = [host]


@dataclass(frozen=True)
class HostRun:
    """A run as it is sent to a host, which finds everything else locally."""

    spec: RunSpec
    sequence: Path
    """Path of the sequence on the campaign's machine."""
    played_s: float
    command: list[str]
    """Command line of the user."""
    attempt: int
    root: Path
    """Checkout on the campaign's machine."""
    reference: bytes | None
    """Content of the path that the run is compared with."""


def execute_there(run: HostRun) -> tuple[Summary, bytes]:
    """Executes the run on the host; returns its summary and its packed folder."""
    (host,) = _HERE
    with _of(host), host.busy, _scratch(host.scratch) as scratch:
        raw = scratch / run.spec.run_key
        raw.mkdir()
        raw.chmod(0o755)
        spec = _at_home(run, scratch)
        played = {spec.dataset: (remote_sequence(spec, run.sequence), run.played_s)}
        executor = LiveExecutor(host.engine, host.open_link, played, command=run.command)
        try:
            summary = executor.execute(spec, raw, host.stop, run.attempt)
        except InterruptedRunError:
            # Only the campaign knows whether this was intended.
            raise KilledError("the worker was asked to end") from None
        kept: dict[str, Any] = run.spec.model_dump(mode="json")
        add_facts(raw, {"host": host.facts.as_json(), "spec": kept})
        return summary, pack(raw)


def _of(host: ThisHost) -> AbstractContextManager[None]:
    return of_machine(f"host {host.facts.name}")


@contextmanager
def _scratch(parent: Path) -> Iterator[Path]:
    """Makes a folder for one run. Nodes run as another user: they need access, and what they leave
    there may be removable only by root, which must not cost the result."""
    scratch = Path(tempfile.mkdtemp(dir=parent))
    try:
        scratch.chmod(0o755)
        yield scratch
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def prepare_there(spec: RunSpec, there: Path) -> None:
    """Makes sure, before its first run, that the host has the same sequence."""
    (host,) = _HERE
    with _of(host):
        remote_sequence(spec, there)


def foreign_there(experiment: Experiment, software: str) -> dict[str, str]:
    """Returns the tags of systems with their own programs, as installed on the host."""
    (host,) = _HERE
    with _of(host):
        notify = partial(print, file=sys.stderr, flush=True)
        return software_of_foreign(experiment, Library(), host.engine, software, notify)


def _at_home(run: HostRun, scratch: Path) -> RunSpec:
    """Returns the run with paths of this host."""
    for name, digest in run.spec.inputs.items():
        path = Path(str(run.spec.params[name]))
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != digest:
            raise environment_error(
                f"{path}, which parameter {name} names, is not there or another one; copy it there"
            )
    spec = with_reference(run.spec, run.reference, scratch)
    folder = Path(spec.system_folder)
    if spec.system_folder and folder.is_relative_to(run.root):
        here = str(repository_root() / folder.relative_to(run.root))
        return spec.model_copy(update={"system_folder": here})
    return spec
