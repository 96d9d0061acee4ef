# SPDX-License-Identifier: Apache-2.0
"""A program with slambed-sim's file contract but without SLAM, for tests of campaigns.

Parameters of the run: `sim_sleep_s` (its duration), `sim_until` (a file that it waits for),
`sim_act`: play (default), die, refuse, hang, burn (computes forever), flood (prints forever), some
(dies for seeds 0, 3 or 6 modulo 10: three in ten).
"""

import json
import os
import signal
import sys
import time
from pathlib import Path

FRAMES = 5


def main() -> int:
    config = json.loads(Path("run.json").read_text())
    act = config["params"].get("sim_act", "play")
    if act == "refuse":
        print("error: bad parameter, run.json; write another one", file=sys.stderr)
        return 2
    if act == "some":
        act = "die" if config["seed"] % 10 in (0, 3, 6) else "play"
    time.sleep(float(config["params"].get("sim_sleep_s", 0.0)))
    until = config["params"].get("sim_until")
    while until and not Path(until).exists():
        time.sleep(0.01)
    folder = Path("mobile")
    folder.mkdir()
    with (
        (folder / "events.jsonl").open("w") as events,
        (folder / "trajectory.txt").open("w") as path,
    ):
        for frame in range(FRAMES):
            if act == "die" and frame == 2:
                events.flush()
                os.kill(os.getpid(), signal.SIGSEGV)
            event = {"t_ns": frame * 100_000_000, "type": "frame_tracked", "frame": frame}
            event |= {"seq_s": frame / 10, "state": "ok", "track_ms": 1.0, "wait_ms": 0.1}
            events.write(json.dumps(event) + "\n")
            path.write(f"{frame / 10} {frame} {frame % 2} 0 0 0 0 1\n")
    while act == "hang":
        time.sleep(0.05)
    while act == "burn":
        pass
    while act == "flood":
        print("x" * 1000)
    node = {"role": "mobile", "exit_reason": "done", "stopped": False}
    (folder / "node.json").write_text(json.dumps(node | {"frames_total": FRAMES, "version": "0"}))
    return 0


sys.exit(main())
