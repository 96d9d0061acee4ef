# SPDX-License-Identifier: Apache-2.0
"""Virtual runs on the workers of a Dask cluster: `--scheduler tcp://...` and `--slurm`.

A run is made in a scratch folder of its worker and travels back whole, so workers need the same
sources and the sequence, but no common file system. This process alone writes results and ledger:
a worker that dies leaves nothing, and Dask gives its run to another one.
"""

import io
import socket
import sys
import tarfile
import tempfile
import threading
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from slambed.campaign.datasets import prepare_sequence
from slambed.campaign.executors import Played
from slambed.campaign.virtual_task import VirtualTask
from slambed.data.places import cache_folder
from slambed.engines.result import InterruptedRunError
from slambed.errors import KilledError, SlambedError, environment_error
from slambed.json_file import read_object
from slambed.metrics.summary import Summary
from slambed.native import SIMULATION, find_program
from slambed.spec.run_spec import RunSpec
from slambed.spec.software import host_software, software_of_systems

LOOK_EVERY_S = 0.1
CONNECT_TIMEOUT_S = 20.0
FIRST_WORKER_TIMEOUT_S = 600.0
"""A batch system may let its first job wait."""
SLURM_MEMORY = "2 GiB"
"""Of one worker, where Dask's configuration does not say."""


@dataclass
class ClusterExecutor:
    """Executes virtual runs on whatever workers the scheduler has."""

    played: Played
    client: Any
    jobs: int

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Hands the run to the cluster and waits for it."""
        from distributed import KilledWorker

        sequence, played_s = self.played[spec.dataset]
        away = AwayRun(spec, sequence.resolve(), played_s, sys.argv, attempt)
        future = self.client.submit(execute_away, away, pure=False)
        try:
            summary, files = self._wait(future, stop)
        except KilledWorker:
            raise KilledError(
                f"workers died again and again in run {spec.run_key}; is there enough memory?"
            ) from None
        except (CancelledError, OSError):
            raise environment_error(
                "the scheduler is gone; finished runs are kept, start it and call again to go on"
            ) from None
        finally:
            with suppress(Exception):
                future.cancel()
        unpack(files, raw)
        return summary

    def _wait(self, future: Any, stop: threading.Event) -> tuple[Summary, bytes]:
        while True:
            try:
                found: tuple[Summary, bytes] = future.result(timeout=LOOK_EVERY_S)
                return found
            # distributed's sync() has no result to return where its wait was cancelled in the
            # moment in which it ended, and stumbles over that.
            except (TimeoutError, UnboundLocalError):
                if future.cancelled():
                    raise CancelledError from None
                if stop.is_set():
                    raise InterruptedRunError from None

    def close(self) -> None:
        """Leaves the cluster; one that was made for this campaign ends."""
        cluster = self.client.cluster
        self.client.close()
        if cluster is not None:
            cluster.close()


def join_cluster(played: Played, address: str, jobs: int | None) -> ClusterExecutor:
    """A scheduler that somebody started, with the workers it has."""
    distributed = _imported("distributed", "--scheduler")
    try:
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise environment_error(
            f"no Dask scheduler at {address}: {error}; start one: dask scheduler"
        ) from None
    return _pool(played, client, jobs, FIRST_WORKER_TIMEOUT_S)


def start_on_slurm(played: Played, jobs: int | None) -> ClusterExecutor:
    """Workers as Slurm jobs, one core each; queue, account and wall time come from Dask's own
    configuration (jobqueue.yaml)."""
    if jobs is None:
        raise SlambedError("--slurm needs --jobs: how many one-core jobs to ask Slurm for")
    jobqueue = _imported("dask_jobqueue", "--slurm")
    distributed = _imported("distributed", "--slurm")
    config = _imported("dask.config", "--slurm")
    try:
        cluster = jobqueue.SLURMCluster(
            cores=config.get("jobqueue.slurm.cores", None) or 1,
            memory=config.get("jobqueue.slurm.memory", None) or SLURM_MEMORY,
        )
        cluster.scale(jobs=jobs)
    except (OSError, RuntimeError, ValueError) as error:
        raise environment_error(f"Slurm refuses: {error}") from None
    return _pool(played, distributed.Client(cluster), jobs, FIRST_WORKER_TIMEOUT_S)


def _pool(played: Played, client: Any, jobs: int | None, wait_s: float) -> ClusterExecutor:
    try:
        client.wait_for_workers(1, timeout=wait_s)
    except TimeoutError:
        client.close()
        raise environment_error(f"the cluster got no worker in {wait_s:.0f} s") from None
    return ClusterExecutor(played, client, jobs or sum(client.nthreads().values()))


def _imported(module: str, option: str) -> Any:
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError:
        raise environment_error(
            f"{option} needs {module.partition('.')[0]}; pip install 'slambed[cluster]'"
        ) from None


@dataclass(frozen=True)
class AwayRun:
    """A run as it travels to a worker, which finds the rest where it is."""

    spec: RunSpec
    sequence: Path
    """Where the campaign has it."""
    played_s: float
    command: list[str]
    attempt: int


def execute_away(away: AwayRun) -> tuple[Summary, bytes]:
    """On a worker: executes the run; its summary and its packed folder."""
    from distributed import get_worker

    # The worker's own folder: what a killed worker leaves there, Dask removes.
    with tempfile.TemporaryDirectory(dir=get_worker().local_directory) as scratch:
        raw = Path(scratch) / "raw"
        raw.mkdir()
        try:
            task = VirtualTask(
                away.spec,
                raw,
                _sequence(away.spec, away.sequence),
                away.played_s,
                _program(away.spec.software, away.spec.system),
                cache_folder() / "features",
                away.command,
                away.attempt,
            )
        except SlambedError as error:
            line = f"worker on {socket.gethostname()}: {error}"
            raise SlambedError(line, error.code) from None
        return task.execute(), pack(raw)


def _sequence(spec: RunSpec, there: Path) -> Path:
    """Where the campaign has it, or prepared here from the same source."""
    if (read_object(there / "sequence.json") or {}).get("checksum") == spec.sequence_checksum:
        return there
    found, checksum = _prepared(spec.dataset)
    if checksum != spec.sequence_checksum:
        raise SlambedError(f"dataset {spec.dataset} is another one here: checksum {checksum[:12]}")
    return found


@cache
def _prepared(dataset: str) -> tuple[Path, str]:
    sequence = prepare_sequence(dataset)
    return sequence.path, sequence.checksum


@cache
def _program(software: str, system: str) -> Path:
    whole = host_software(program=SIMULATION)
    if (found := software_of_systems(whole, [system]).get(system, whole)) != software:
        raise environment_error(f"software is {found}, the campaign's {software}; run 'make build'")
    return find_program(SIMULATION)


def pack(folder: Path) -> bytes:
    """The files that a result keeps: raw logs are in its tables."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.suffix != ".jsonl":
                archive.add(path, path.relative_to(folder).as_posix())
    return packed.getvalue()


def unpack(packed: bytes, folder: Path) -> None:
    """Into an empty folder."""
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
