# SPDX-License-Identifier: Apache-2.0
"""Campaigns of many short virtual runs on many jobs, onto a disk that takes its time: what
tools/many_jobs.py calls."""

import argparse
import contextlib
import os
import random
import shutil
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from chaos_faults import role_of
from test_processes import SlowFolder, children, runs
from virtual_parts import Quiet
from waiting import LIMIT_S

from slambed.campaign.ledger import Ledger
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.runner import MOST_DEATHS, Runner

PROGRAM = Path(__file__).parent / "stand_in_sim.sh"


@dataclass
class Killer:
    """Kills the process of a run so often, waiting for the next one where there is none, and stops
    before one run could bear no more."""

    every_s: float
    over: threading.Event = field(default_factory=threading.Event)
    killed: int = 0

    def run(self) -> None:
        """Until it is told to end."""
        while self.killed < MOST_DEATHS - 1 and not self.over.wait(self.every_s):
            while not self.over.wait(0.005) and not self._kill():
                pass

    def _kill(self) -> bool:
        found = psutil.Process().children(recursive=True)
        for process in random.sample(found, len(found)):
            with contextlib.suppress(psutil.Error):
                if role_of(process, os.getpid()) == "worker":
                    process.kill()
                    self.killed += 1
                    return True
        return False


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=32)
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--kill-every", type=float, metavar="SECONDS")
    asked = parser.parse_args()
    good = 0
    for number in range(asked.times):
        with tempfile.TemporaryDirectory(prefix="slambed-many-") as folder:
            good += campaign(Path(folder), asked, number)
    print(f"many jobs: {good} of {asked.times} campaigns complete")
    return 0 if good == asked.times else 1


def campaign(place: Path, asked: argparse.Namespace, number: int) -> bool:
    """True when every run is there once, and nothing else."""
    random.seed(number)
    (place / "sequence").mkdir()
    program = place / "slambed-sim"
    shutil.copy(PROGRAM, program)
    program.chmod(0o755)
    folder = SlowFolder(place / "tiny")
    folder.create()
    ledger = Ledger(folder.path / "ledger.jsonl")
    played = {"room": (place / "sequence", 0.5)}
    runner = Runner(folder, ledger, ProcessExecutor(played, program, None, asked.jobs))
    killer = Killer(asked.kill_every or 0.0)
    thread = threading.Thread(target=killer.run, daemon=True)
    todo = runs(asked.runs)
    began_s = time.monotonic()
    if asked.kill_every:
        thread.start()
    try:
        verdict = runner.run(todo, Quiet())
    finally:
        killer.over.set()
        if asked.kill_every:
            thread.join(LIMIT_S)
    took_s = time.monotonic() - began_s
    finished = [e["run_key"] for e in ledger.read() if e["event"] == "run_finished"]
    once = sorted(finished) == folder.run_keys() == sorted(spec.run_key for spec in todo)
    left = [p.pid for p in children() if str(place) in " ".join(p.cmdline())]
    print(
        f"{number + 1}: {verdict.done} runs of {asked.runs} on {asked.jobs} jobs, {took_s:.0f} s, "
        f"{killer.killed} processes killed, {len(verdict.given_up)} given up, "
        f"each {'once' if once else 'NOT once'}, {len(left)} processes left",
        flush=True,
    )
    return once and verdict.trusted == asked.runs and not left
