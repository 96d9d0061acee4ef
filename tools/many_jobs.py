# SPDX-License-Identifier: Apache-2.0
"""Campaigns of many short virtual runs on many jobs, onto a disk that takes its time.

    tools/many_jobs.py [--runs 300] [--jobs 32] [--times 5] [--kill-every SECONDS]

Runs are those of a stand-in program that takes milliseconds; all around it (processes forked from
the server, metrics, commits up to 0.15 s late, ledger) is as in any campaign. `--kill-every` kills
the process of a run so often. Exit status 1 when a campaign was not complete, every run once.
"""

import sys
from pathlib import Path

# The process of every run imports this file, too: what a campaign needs stands behind the guard.
if __name__ == "__main__":
    tests = Path(__file__).resolve().parents[1] / "harness" / "tests"
    sys.path[:0] = [str(tests), str(tests / "campaign")]
    from many_campaigns import main

    sys.exit(main())
