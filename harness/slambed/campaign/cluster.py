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
from slambed.campaign.folder import read_object
from slambed.campaign.makers import Played
from slambed.campaign.worker import answer, refusal
from slambed.data.places import cache_folder
from slambed.engines.result import InterruptedRunError
from slambed.engines.virtual import PROGRAM
from slambed.errors import ExitCode, SlambedError, environment_error
from slambed.native import find_program
from slambed.spec.matrix import RunSpec
from slambed.spec.software import host_software

LOOK_EVERY_S = 0.1
CONNECT_TIMEOUT_S = 20.0
FIRST_WORKER_TIMEOUT_S = 600.0
"""A batch system may let its first job wait."""
SLURM_MEMORY = "2 GiB"
"""Of one worker, where Dask's configuration does not say."""


@dataclass
class ClusterPool:
    """Makes virtual runs on whatever workers the scheduler has."""

    played: Played
    client: Any
    jobs: int

    def make(self, spec: RunSpec, raw: Path, stop: threading.Event) -> dict[str, Any]:
        """Hands the run to the cluster and waits for it."""
        from distributed import KilledWorker

        sequence, played_s = self.played[spec.dataset]
        task = {
            "spec": spec.model_dump(mode="json"),
            "sequence": str(sequence.resolve()),
            "played_s": played_s,
            "command": sys.argv,
        }
        future = self.client.submit(make_away, task, pure=False)
        try:
            told = self._wait(future, stop)
        except KilledWorker:
            raise environment_error(
                f"workers died again and again in run {spec.run_key}; is there enough memory?"
            ) from None
        except (CancelledError, OSError):
            raise environment_error(
                "the scheduler is gone; finished runs are kept, start it and call again to go on"
            ) from None
        finally:
            with suppress(Exception):
                future.cancel()
        if (error := told.get("error")) is not None:
            raise SlambedError(error, ExitCode(told["code"]))
        unpack(told["files"], raw)
        summary: dict[str, Any] = told["summary"]
        return summary

    def _wait(self, future: Any, stop: threading.Event) -> dict[str, Any]:
        while True:
            try:
                told: dict[str, Any] = future.result(timeout=LOOK_EVERY_S)
                return told
            except TimeoutError:
                if stop.is_set():
                    raise InterruptedRunError from None

    def close(self) -> None:
        """Leaves the cluster; one that was made for this campaign ends."""
        cluster = self.client.cluster
        self.client.close()
        if cluster is not None:
            cluster.close()


def join_cluster(played: Played, address: str, jobs: int | None) -> ClusterPool:
    """A scheduler that somebody started, with the workers it has."""
    distributed = _imported("distributed", "--scheduler")
    try:
        client = distributed.Client(address, timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise environment_error(
            f"no Dask scheduler at {address}: {error}; start one: dask scheduler"
        ) from None
    return _pool(played, client, jobs, FIRST_WORKER_TIMEOUT_S)


def start_on_slurm(played: Played, jobs: int | None) -> ClusterPool:
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


def _pool(played: Played, client: Any, jobs: int | None, wait_s: float) -> ClusterPool:
    try:
        client.wait_for_workers(1, timeout=wait_s)
    except TimeoutError:
        client.close()
        raise environment_error(f"the cluster got no worker in {wait_s:.0f} s") from None
    return ClusterPool(played, client, jobs or sum(client.nthreads().values()))


def _imported(module: str, option: str) -> Any:
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError:
        raise environment_error(
            f"{option} needs {module.partition('.')[0]}; pip install 'slambed[cluster]'"
        ) from None


def make_away(task: dict[str, Any]) -> dict[str, Any]:
    """On a worker: makes the run and packs its folder."""
    from distributed import get_worker

    # The worker's own folder: what a killed worker leaves there, Dask removes.
    with tempfile.TemporaryDirectory(dir=get_worker().local_directory) as scratch:
        raw = Path(scratch) / "raw"
        raw.mkdir()
        try:
            spec = RunSpec.model_validate(task["spec"])
            here = task | {
                "raw": str(raw),
                "sequence": str(_sequence(spec, Path(task["sequence"]))),
                "program": str(_program(spec.software)),
                "features": str(cache_folder() / "features"),
            }
        except SlambedError as error:
            return refusal(f"worker on {socket.gethostname()}: {error}", error.code)
        told = answer(here)
        return told if "error" in told else told | {"files": pack(raw)}


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
def _program(software: str) -> Path:
    if (found := host_software(program=PROGRAM)) != software:
        raise environment_error(f"software is {found}, the campaign's {software}; run 'make build'")
    return find_program(PROGRAM)


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
