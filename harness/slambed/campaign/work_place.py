# SPDX-License-Identifier: Apache-2.0
"""Where a campaign has its runs in hand, until each gets its place in the store."""

import os
from pathlib import Path
from secrets import token_hex

WORK = ".work"


def work_name() -> str:
    """Of this process's folder in `results/.work/`: its number finds it, the rest is nobody's."""
    return f"{os.getpid()}-{token_hex(4)}"


def raw_of(results: Path, pid: int, run_key: str) -> Path | None:
    """Where a process has a run in hand; None where it has not begun, or is done."""
    found = sorted((results / WORK).glob(f"{pid}-*/{run_key}"))
    return found[-1] if found else None
