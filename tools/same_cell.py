# SPDX-License-Identifier: Apache-2.0
"""same_cell.py BIN_A BIN_B [RUNS]: plays one cell of virtual runs with two builds of slambed-sim.

Compares every file of every run; any different byte is an error. Needs
PYTHONPATH=harness:harness/tests.
"""

import os
import sys
import tempfile
from pathlib import Path

from virtual_parts import Quiet, fingerprints, make_sequence, plan_of, played_of, write_experiment

from slambed.campaign.folder import ResultFolder
from slambed.campaign.ledger import Ledger
from slambed.campaign.processes import ProcessExecutor
from slambed.campaign.runner import Runner

CELL = """\
id: walk
title: One cell, from one state to the other and back
systems: [{{system: dynnetslam, variant: wh_wosz, label: switching}}]
datasets: [{sequence}]
playback: {{mode: realtime, fps: 10}}
link:
  profiles: [{{profile: ramp, name: ramp, params: {{rise_s: 2, hold_s: 1, fall_s: 2}}}}]
devices: {{mobile: raspberry_pi_4, edge: edge_i7_6700t}}
engine: virtual
runs: {{default: {runs}}}
"""


def main() -> int:
    programs = [Path(argument).resolve() for argument in sys.argv[1:3]]
    runs = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    os.environ["SLAMBED_BIN"] = str(programs[0])
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        plan = plan_of(write_experiment(work, make_sequence(work / "walk", 5), runs, CELL))
        found, all_good = [], True
        for side, folder in zip("ab", programs, strict=True):
            results = ResultFolder(work / side)
            results.create()
            # Each side has its own feature cache, so that both builds extract features.
            executor = ProcessExecutor(
                played_of(plan), folder / "slambed-sim", work / f"{side}-f", 2
            )
            verdict = Runner(results, Ledger(work / side / "ledger.jsonl"), executor).run(
                plan.specs, Quiet()
            )
            print(f"{folder}: {verdict.done} runs, {verdict.valid} valid", flush=True)
            all_good &= verdict.valid == len(plan.specs)
            found.append(fingerprints(results))
    different = sorted(
        name
        for name in found[0].keys() | found[1].keys()
        if found[0].get(name) != found[1].get(name)
    )
    for name in different:
        print(f"differs: {name}")
    print(f"{'different' if different else 'same'} bytes: {len(found[0])} files of {runs} runs")
    return 0 if all_good and not different else 1


if __name__ == "__main__":
    sys.exit(main())
