# SPDX-License-Identifier: Apache-2.0
"""Work folder of a campaign's runs in progress, before they are added to the store."""

import os
from pathlib import Path
from secrets import token_hex

WORK = ".work"


def work_name() -> str:
    """Returns the name of this process's folder in `results/.work/`: its process id and a random
    suffix."""
    return f"{os.getpid()}-{token_hex(4)}"


def raw_of(results: Path, pid: int, run_key: str) -> Path | None:
    """Returns the folder of a run in progress; None if it has not begun or is done."""
    found = sorted((results / WORK).glob(f"{pid}-*/{run_key}"))
    return found[-1] if found else None
