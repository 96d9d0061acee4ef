# SPDX-License-Identifier: Apache-2.0
"""A stored summary of a synthetic run, which detects changed metrics. Run as a program to write
the summary again; increment METRICS_VERSION first."""

import json
import tempfile
from pathlib import Path
from typing import Any

from results_factory import RawRun, spec_of, write_raw

from slambed.metrics.catalog import METRICS_VERSION
from slambed.metrics.run_summary import summarize_run
from slambed.spec.faults import Fault

KEPT = Path(__file__).parent / "kept_summary.json"
COMMAND = "python harness/tests/kept_summary.py"


def summary_today(folder: Path) -> dict[str, Any]:
    """Returns the summary of a run that covers every metric a synthetic run can have."""
    run = RawRun(
        lost_at_s=((5.0, 6.5),),
        stall_ms=80.0,
        faults=(Fault(link="cut", at_s=3.0, for_s=1.0),),
        seed=7,
    )
    raw = write_raw(folder / "raw", run)
    states = [{"from": "start", "to": "OS", "t_ns": 1}, {"from": "OS", "to": "MES", "t_ns": 4}]
    with (raw / "mobile" / "events.jsonl").open("a") as events:
        for state in states:
            change = state | {"t_ns": state["t_ns"] * 10**9, "type": "state_changed"}
            events.write(json.dumps(change) + "\n")
    return summarize_run(raw, spec_of("dynnetslam", "wh_wsz", "ramp_85", 0))


def main() -> None:
    """Writes KEPT."""
    with tempfile.TemporaryDirectory() as folder:
        found = summary_today(Path(folder))
    content = {"version": METRICS_VERSION, "summary": found}
    KEPT.write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
