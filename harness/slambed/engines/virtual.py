# SPDX-License-Identifier: Apache-2.0
"""One virtual run: both nodes in one slambed-sim process with a discrete-event clock.

It needs no privileges. Equal specs give bit-identical results, whatever the load on the host
(docs/explanation/virtual-time.md).
"""

import ctypes
import fcntl
import hashlib
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from slambed.engines.base import last_line
from slambed.engines.child_end import end_of
from slambed.engines.cpu_watch import IDLE_LIMIT_S, CpuWatch
from slambed.engines.faults import write_planned
from slambed.engines.result import InterruptedRunError, Outcome, RunResult, run_config, time_limit_s
from slambed.engines.written_bytes import TooManyBytesError, WrittenBytes
from slambed.errors import ExitCode, KilledError, SlambedError, environment_error
from slambed.link.direction import ModeledLink
from slambed.link.facts import LinkFacts
from slambed.link.modeled import modeled_link, write_link_log
from slambed.link.profile import parse_profile
from slambed.native import SIMULATION
from slambed.process.endings import ended_from_outside, ending
from slambed.records.sim_config import CacheFile, MaskFile, SimConfig, SimDevices
from slambed.spec.device import CostModel, Device
from slambed.spec.run_spec import RunSpec, canonical_json

LEAST_LIMIT_S = 120.0
LIMIT_FACTOR = 20.0
"""Limits of CPU time and of virtual time as a multiple of the played time, on top of LEAST_LIMIT_S;
a run that exceeds one of them hangs."""
LONGEST_S = 1e6
"""Largest limit that slambed-sim accepts."""
WATCH_PERIOD_S = 0.25
CACHE_BYTES = 4 << 30
"""Maximum size of feature and image caches; the least recently used ones are removed first."""
CACHES = (".features", ".images")
NICE = 10
"""A tenth of an ordinary process's share; with less, thirty jobs on a busy core would stall."""
AUTOGROUP_TRIES, AUTOGROUP_PAUSE_S = 60, 0.05
PR_SET_PDEATHSIG = 1
QUALITY = "jpeg_quality"
"""Parameter of systems that send pictures; features extracted on the edge depend on it."""
SEEN_FROM = (QUALITY, "full_offload")
"""Parameters that decide whether features are extracted from raw or JPEG pictures."""


def sim_config(
    spec: RunSpec, horizon_s: float, features: Path | None, limit_s: float | None = None
) -> SimConfig:
    """Returns the simulated environment of the nodes (docs/reference/run-folder.md, "Virtual
    run")."""
    link: ModeledLink | None = None
    if spec.link is not None:
        profile = parse_profile(spec.link.content, f"profile {spec.link.profile}")
        link = modeled_link(profile, horizon_s)
    config = SimConfig(
        format="slambed-sim",
        version=1,
        run="run.json",
        devices=SimDevices(
            mobile=_model(spec.device_mobile),
            edge=_model(spec.device_edge) if spec.device_edge else None,
        ),
        link=link,
        edge_frozen_s=[(f.at_s, f.end_s) for f in spec.faults if f.edge == "freeze"],
        feature_cache=CacheFile(path=str(features), key=feature_key(spec)) if features else None,
        limit_s=limit_s,
    )
    if spec.masks is not None:
        masks = [
            MaskFile(n_m=made.n_m, path=made.path, key=made.key)
            for made in (spec.masks, *spec.further_masks)
        ]
        config = config.model_copy(update={"mask_caches": masks})
    if features is None or QUALITY not in spec.params:
        return config
    # The JPEG cache lies next to the feature cache.
    key = canonical_json(
        {
            "sequence": spec.sequence_checksum,
            "software": spec.software,
            QUALITY: spec.params[QUALITY],
        }
    )
    images = CacheFile(path=str(_named(features.parent, key, ".images")), key=key)
    return config.model_copy(update={"image_cache": images})


def _model(device: Device) -> CostModel:
    if device.model is None:
        raise SlambedError(
            f"device {device.name} has no cost model; fit one: slambed calibrate --stages"
        )
    return device.model


def feature_key(spec: RunSpec) -> str:
    """Returns everything that the features of a sequence depend on."""
    seen = seen_with(spec.params)
    return canonical_json({"sequence": spec.sequence_checksum, "software": spec.software, **seen})


def seen_with(params: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the parameters on which features depend."""
    return {n: v for n, v in params.items() if n.startswith("n_orb") or n in SEEN_FROM}


def feature_file(folder: Path, spec: RunSpec) -> Path:
    """Returns the feature cache file of this run's sequence."""
    return _named(folder, feature_key(spec), ".features")


def _named(folder: Path, key: str, suffix: str) -> Path:
    return folder / f"{hashlib.sha256(key.encode()).hexdigest()[:16]}{suffix}"


@dataclass(frozen=True)
class VirtualRun:
    """Executes one RunSpec in `run_dir` and leaves its raw files there."""

    spec: RunSpec
    sequence: Path
    played_s: float
    run_dir: Path
    program: Path
    features: Path | None
    """Folder of feature caches; None: every run extracts its own features."""
    least_limit_s: float = LEAST_LIMIT_S
    idle_limit_s: float = IDLE_LIMIT_S

    def execute(self, stop: threading.Event) -> RunResult:
        """Executes the run. A program that refuses its input, dies, exceeds its CPU time or writes
        too much is an outcome; an idle one raises PassingError."""
        self._write_files()
        cache = feature_file(self.features, self.spec) if self.features else None
        written = WrittenBytes(self.run_dir, self.spec.max_run_mb)
        try:
            with _made_once(cache):
                code = self._run(stop, written)
            written.look()
        except TooManyBytesError as error:
            written.cut()
            return self._result("died", str(error))
        if code is not None and ended_from_outside(code):
            # We never kill it for a limit, so this is not the system's fault.
            raise KilledError(
                f"{SIMULATION} of run {self.spec.run_key} was killed ({ending(code)}); "
                "is there enough memory?"
            )
        if code == ExitCode.ENVIRONMENT:
            last_words = last_line(self.run_dir / "log.txt").removeprefix("error: ")
            raise SlambedError(f"{SIMULATION}: {last_words}", ExitCode(code))
        return self._result(_outcome(code), None if code == 0 else self._reason(code))

    def _result(self, outcome: Outcome, reason: str | None) -> RunResult:
        link = LinkFacts.virtual() if self.spec.link else None
        return RunResult(outcome=outcome, reason=reason, link=link)

    def _write_files(self) -> None:
        # The output path is relative, so that equal runs in different folders leave equal files.
        # The link changes as long as that of a live run may last.
        horizon_s = time_limit_s(self.spec, self.played_s, 0.0)
        config = run_config(self.spec, str(self.sequence.resolve()), ".", horizon_s)
        (self.run_dir / "run.json").write_text(json.dumps(config.as_json(), indent=1))
        features = feature_file(self.features, self.spec).resolve() if self.features else None
        world = sim_config(
            self.spec,
            horizon_s,
            features,
            min(LEAST_LIMIT_S + LIMIT_FACTOR * self.played_s, LONGEST_S),
        )
        (self.run_dir / "sim.json").write_text(json.dumps(world.as_json()))
        if self.spec.link is not None:
            profile = parse_profile(self.spec.link.content, f"profile {self.spec.link.profile}")
            write_link_log(profile, self.played_s, self.run_dir / "link")
        write_planned(self.spec.faults, self.played_s, self.run_dir)

    def _run(self, stop: threading.Event, written: WrittenBytes) -> int | None:
        """Returns the exit code; None if it exceeded its CPU time."""
        with (self.run_dir / "log.txt").open("wb") as log:
            process = subprocess.Popen(
                [str(self.program), "--config", "sim.json"],
                cwd=self.run_dir,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                # Ctrl-C reaches only the harness, and the simulation must not outlive it.
                start_new_session=True,
                preexec_fn=as_child,
            )
        watch = CpuWatch(process.pid, SIMULATION, self._limit_s(), self.idle_limit_s)
        try:
            with end_of(process) as wait:
                while (code := wait(WATCH_PERIOD_S)) is None:
                    if stop.is_set():
                        raise InterruptedRunError
                    if watch.spent():
                        return None
                    written.watch()
            return code
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()

    def _limit_s(self) -> float:
        return self.least_limit_s + LIMIT_FACTOR * self.played_s

    def _reason(self, code: int | None) -> str:
        if code is None:
            return f"{SIMULATION} had not finished after {self._limit_s():.0f} s of CPU time"
        last_words = last_line(self.run_dir / "log.txt")
        if code == ExitCode.PEER:
            return last_words.removeprefix("error: ")
        return f"{SIMULATION}: {ending(code)}: {last_words}"


def _outcome(code: int | None) -> Outcome:
    if code is None:
        return "timed_out"
    known: dict[int, Outcome] = {
        0: "completed",
        int(ExitCode.BAD_INPUT): "refused",
        int(ExitCode.PEER): "timed_out",
    }
    return known.get(code, "died")


_LIBC = ctypes.CDLL(None)


def as_child() -> None:
    """Prepares the child: the kernel kills it with the thread that started it, and exceeding a
    file size limit becomes an error that it reports."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    go_behind()


def go_behind() -> None:
    """Lowers the priority of this process: live runs on this host come first, and virtual runs
    are not time-critical."""
    os.setpriority(os.PRIO_PROCESS, 0, max(os.getpriority(os.PRIO_PROCESS, 0), NICE))
    # Kernels with autogroups divide CPU time among sessions first, and this is a new session.
    for _ in range(AUTOGROUP_TRIES):
        try:
            Path("/proc/self/autogroup").write_text(str(NICE))
        except BlockingIOError:
            # Non-root processes may do this once per 0.1 s on the whole host, and each change by
            # root restarts that interval. Next to a campaign of root it may take a while.
            time.sleep(AUTOGROUP_PAUSE_S)
            continue
        except OSError:
            pass
        break


@contextmanager
def _made_once(cache: Path | None) -> Iterator[None]:
    """While the cache is missing only one run continues and creates it; the others then use it."""
    if cache is None:
        yield
        return
    if cache.exists():
        os.utime(cache)
        yield
        return
    try:
        cache.parent.mkdir(parents=True, exist_ok=True)
        lock = cache.with_suffix(".lock").open("w")
    except OSError as refused:
        raise environment_error(
            f"{cache.parent}: {refused.strerror}; set SLAMBED_CACHE to a folder you may write"
        ) from None
    with lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if cache.exists():
            fcntl.flock(lock, fcntl.LOCK_UN)
        yield


def prune_features(folder: Path, limit_bytes: int = CACHE_BYTES) -> None:
    """Removes leftovers of killed runs, and the least recently used caches beyond the limit. Locks
    stay: other processes may wait on them."""
    caches = (path for suffix in CACHES for path in folder.glob(f"*{suffix}*"))
    found: list[tuple[os.stat_result, Path]] = []
    for path in caches:
        with suppress(FileNotFoundError):  # another campaign may have removed it
            if path.is_file():
                found.append((path.stat(), path))
    left = limit_bytes
    for status, path in sorted(found, key=lambda item: -item[0].st_mtime):
        left -= status.st_size
        if left < 0 or (path.suffix not in CACHES and status.st_mtime < time.time() - 3600):
            path.unlink(missing_ok=True)
