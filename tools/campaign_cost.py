#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""campaign_cost.py EXPERIMENT [RUNS]: CPU seconds of a virtual campaign and its report, by where.

Executes RUNS of every cell, one run at a time, into a scratch folder, as `slambed run --jobs 1`
does. Prints what this process took to start, per run and for the report, what the fork server took
to get ready, and what the process of a run took beside its simulation. The dataset should have been
played before: the first campaign fills caches.
"""

import os
import resource
import sys
import tempfile
import threading
import time
from pathlib import Path

import psutil

from slambed.campaign.virtual_task import VirtualTask
from slambed.metrics.summary import Summary

SIMULATED = "SLAMBED_MEASURED_CPU"
"""Where processes of runs leave what their simulations took."""


class MeasuredTask(VirtualTask):
    """A run that leaves what its simulation took."""

    def execute(self) -> Summary:
        """As ever."""
        before = simulated_s()
        summary = super().execute()
        with Path(os.environ[SIMULATED]).open("a") as out:
            out.write(f"{simulated_s() - before}\n")
        return summary


def simulated_s() -> float:
    """By the children that this process has waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    from slambed.campaign import processes
    from slambed.campaign import run_experiment as run
    from slambed.campaign.processes import ProcessExecutor
    from slambed.commands.run_and_report import show_report
    from slambed.spec.run_spec import RunSpec
    from slambed.terminal import console

    began: list[float] = []

    class MeasuredExecutor(ProcessExecutor):
        def execute(
            self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1
        ) -> Summary:
            began.append(time.process_time())
            return super().execute(spec, raw, stop, attempt)

    processes.VirtualTask = MeasuredTask  # type: ignore[misc]
    run.ProcessExecutor = MeasuredExecutor  # type: ignore[misc]
    count = sys.argv[2] if len(sys.argv) > 2 else None
    with tempfile.TemporaryDirectory() as scratch:
        simulated = Path(scratch) / "simulated"
        os.environ[SIMULATED] = str(simulated)
        options = run.Options(count, "virtual", Path(scratch) / "results", jobs=1)
        folder = run.run_experiment(sys.argv[1], options, console()).folder
        campaign_s = time.process_time() - began[0]
        server, beneath = 0.0, 0.0
        for child in psutil.Process().children():
            used = child.cpu_times()
            server += used.user + used.system
            beneath += used.children_user + used.children_system
        assert folder is not None
        before = time.process_time()
        show_report(folder, console())
        report_s = time.process_time() - before
        simulations = [float(line) for line in simulated.read_text().splitlines()]
    runs = len(began)
    print(
        f"start {began[0]:.2f} s, fork server {server:.2f} s, report {report_s:.2f} s; "
        f"each of {runs} runs: process {(beneath - sum(simulations)) / runs:.3f} s, "
        f"campaign {campaign_s / runs:.3f} s, simulation {sum(simulations) / runs:.3f} s"
    )


if __name__ == "__main__":
    main()
