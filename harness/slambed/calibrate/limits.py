# SPDX-License-Identifier: Apache-2.0
"""`slambed calibrate --limits DEVICE`: measures what busy threads get under a device's limits."""

import json
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from math import fsum
from pathlib import Path
from statistics import mean

from rich.table import Table

from slambed.calibrate.host import PROGRAM, run_pace
from slambed.engines.base import Engine, NodePlan, allot_cpus, differences, thread_invalid_reasons
from slambed.engines.docker import DockerEngine
from slambed.engines.docker_image import connect, find_image, image_tag
from slambed.engines.helper import is_root
from slambed.engines.host_lock import STOP, host_lock
from slambed.engines.local import LocalEngine
from slambed.engines.reaper import mark_children, reap
from slambed.engines.sidecar_client import SidecarClient
from slambed.errors import ExitCode, SlambedError, environment_error
from slambed.native import find_program
from slambed.process.cpus import own_cpus
from slambed.spec.device import Device, Limits
from slambed.spec.host_speed import HostSpeed

SETTLE_S = 1.5
"""Time in which threads are found and capped; the first ones are busy already."""
GRACE_S = 30.0
REFERENCE_S = 1.0


@dataclass(frozen=True)
class Achieved:
    """What busy threads got in total, in cores of this host."""

    engine: str
    threads: int
    asked: float
    cpu: float
    """CPU time per wall time."""
    speed: float
    """Work per wall time, relative to an unlimited thread of this host measured right before and
    after. Noisier than `cpu`, because the host's own speed changes."""
    longest_freeze_ms: float
    """Longest time in which a thread made no progress."""
    freezes_over_10_ms: int
    metronome: float | None
    """CPU use of the metronome in percent of a core; None without one."""
    problems: list[str]

    @property
    def error_percent(self) -> float:
        """Returns the error of CPU time relative to the request."""
        return 100 * (self.cpu / self.asked - 1)


def engines(asked: str | None) -> list[Engine]:
    """Returns the requested engine, or all that this host has."""
    if asked == "local":
        return [LocalEngine(find_program(PROGRAM))]
    if asked == "docker":
        return [_docker()]
    found: list[Engine] = [LocalEngine(find_program(PROGRAM))] if is_root() else []
    try:
        found.append(_docker())
    except SlambedError as error:
        if not found or error.code != ExitCode.ENVIRONMENT:
            raise
    return found


def _docker() -> Engine:
    client = connect()
    image = find_image(client)
    if image is None:
        raise environment_error(f"image {image_tag()} is not built; run 'slambed images'")
    return DockerEngine(client, image, PROGRAM)


@contextmanager
def quiet_host() -> Iterator[None]:
    """Holds the host lock, so that no campaign runs."""
    with host_lock("slambed calibrate --limits", advice=STOP), mark_children():
        reap()
        yield


def measure_limits(
    device: Device, host: HostSpeed, engine: Engine, threads: int, seconds: float
) -> Achieved:
    """Measures `threads` busy threads as the mobile node of an engine."""
    limits = device.limits_on(host.speed, len(own_cpus()))
    if limits.quota_cores is None:
        raise SlambedError(f"device {device.name} has no CPU limits to look at")
    with ExitStack() as stack:
        run_dir = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slambed-limits-")))
        run_dir.chmod(0o755)
        asked = {"threads": threads, "seconds": seconds, "settle_s": SETTLE_S}
        config = asked | {"output": engine.output_path(run_dir, "mobile")}
        (run_dir / "run.json").write_text(json.dumps(config))
        before = run_pace(REFERENCE_S)["threads"][0]["units_per_cpu_s"]
        cpus = allot_cpus(limits, None, own_cpus())
        plan = NodePlan("mobile", "limits", run_dir, run_dir, limits, cpus["mobile"])
        node = engine.start(plan)
        stack.callback(node.remove)
        sidecar = SidecarClient(engine, {"mobile": node}, {"mobile": limits}, cpus, run_dir)
        stack.callback(sidecar.close)
        node.release()
        deadline = time.monotonic() + SETTLE_S + seconds + GRACE_S
        sidecar.start(time.monotonic_ns())
        while (code := node.exit_code()) is None and time.monotonic() < deadline:
            time.sleep(0.1)
        observed = sidecar.stop()
        if code != 0:
            raise SlambedError(f"{PROGRAM} ended with {code} in engine {engine.name}")
        per_thread = json.loads((run_dir / "mobile" / "pace.json").read_text())["threads"]
        problems = differences(limits, node.granted, cpus["mobile"])
        if limits.thread_cores is not None:
            problems += thread_invalid_reasons("mobile", observed.threads["mobile"], limits)
    after = run_pace(REFERENCE_S)["threads"][0]["units_per_cpu_s"]
    return Achieved(
        engine=engine.name,
        threads=threads,
        asked=expected_cores(limits, threads),
        cpu=fsum(thread["cpu_share"] for thread in per_thread),
        speed=fsum(thread["units_per_s"] for thread in per_thread) / mean([before, after]),
        longest_freeze_ms=max(thread["longest_freeze_ms"] for thread in per_thread),
        freezes_over_10_ms=sum(thread["freezes_over_10_ms"] for thread in per_thread),
        metronome=observed.own.metronome_cpu_percent or None,
        problems=problems,
    )


def expected_cores(limits: Limits, threads: int) -> float:
    """Returns the cores that `threads` busy threads should get."""
    assert limits.quota_cores is not None
    if limits.thread_cores is None:
        return min(limits.quota_cores, float(threads))
    return min(limits.thread_cores * threads, limits.quota_cores)


def limits_table(rows: list[Achieved]) -> Table:
    columns = ["engine", "busy threads", "asked cores", "CPU cores", "error %", "work, cores"]
    freezes = ["longest freeze ms", "freezes > 10 ms", "metronome %"]
    table = Table(*columns, *freezes, box=None)
    for row in rows:
        table.add_row(
            row.engine,
            str(row.threads),
            f"{row.asked:.3f}",
            f"{row.cpu:.4f}",
            f"{row.error_percent:+.1f}",
            f"{row.speed:.3f}",
            f"{row.longest_freeze_ms:.1f}",
            str(row.freezes_over_10_ms),
            "-" if row.metronome is None else f"{row.metronome:.1f}",
        )
    return table
