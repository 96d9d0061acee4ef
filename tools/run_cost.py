#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""run_cost.py EXPERIMENT [TIMES]: CPU seconds of a virtual run, simulator and harness apart.

Executes the first run of an experiment several times in this process, into a scratch folder, and
prints medians: what the simulation took, what the harness took around it (files written, logs read,
metrics, tables, manifest), and their ratio, which other work on the host changes least. A first
execution, which fills caches, does not count.
"""

import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path

from slambed.campaign.plan import check, make_plan
from slambed.campaign.virtual_task import VirtualTask
from slambed.data.places import cache_folder
from slambed.native import SIMULATION, find_program
from slambed.spec.device import VIRTUAL
from slambed.spec.library import Library
from slambed.spec.software import host_software


def task_of(name: str, raw: Path) -> VirtualTask:
    """The first run of an experiment."""
    library = Library()
    experiment, source = library.experiment(name)
    profiles = check(experiment, source, library, VIRTUAL)
    software = host_software(program=SIMULATION)
    plan = make_plan(experiment, source, library, profiles, VIRTUAL, software, 1)
    spec = plan.specs[0]
    sequence = plan.sequences[spec.dataset]
    return VirtualTask(
        spec,
        raw.resolve(),
        sequence.path.resolve(),
        sequence.played_s(experiment.playback),
        find_program(SIMULATION).resolve(),
        (cache_folder() / "features").resolve(),
        sys.argv,
    )


def cpu_s(who: int) -> float:
    """User and system time of this process, or of the children it has waited for."""
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def execute(name: str) -> tuple[float, float]:
    """CPU seconds of simulator and harness."""
    with tempfile.TemporaryDirectory() as scratch:
        task = task_of(name, Path(scratch))
        simulator, harness = cpu_s(resource.RUSAGE_CHILDREN), time.process_time()
        task.execute()
        return cpu_s(resource.RUSAGE_CHILDREN) - simulator, time.process_time() - harness


def main() -> None:
    name, times = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    execute(name)
    found = [execute(name) for _ in range(times)]
    simulator, harness = (statistics.median(part) for part in zip(*found, strict=True))
    ratio = statistics.median(own / sim for sim, own in found)
    print(f"simulator {simulator:.3f} s, harness {harness:.3f} s, ratio {ratio:.3f}, {times} runs")


if __name__ == "__main__":
    main()
