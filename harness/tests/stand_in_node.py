# SPDX-License-Identifier: Apache-2.0
"""A program with slambed-node's file contract but without SLAM, for tests of the harness.

The parameter `act` selects its behavior: play (default), die, hang, refuse, burn, hungry, threads,
flood (prints forever), many (leaves many empty files).
"""

import argparse
import json
import os
import signal
import sys
import threading
import time
from pathlib import Path


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--role")
    parser.add_argument("--config", type=Path)
    arguments = parser.parse_args()
    config = json.loads(arguments.config.read_text())
    act = config["params"].get(f"{arguments.role}_act", "play")
    if act == "refuse":
        print("error: bad parameter, run.json; write another one", file=sys.stderr)
        return 2
    stopped = False

    def stop(number: int, frame: object) -> None:
        nonlocal stopped
        stopped = act != "hang"

    signal.signal(signal.SIGTERM, stop)
    output = Path(config["output"])
    folder = output / arguments.role
    folder.mkdir(exist_ok=True)
    if act == "threads":
        for _ in range(2):
            threading.Thread(target=time.sleep, args=(600,), daemon=True).start()
    (folder / "ready.json").write_text("{}")
    start = output / "start.json"
    while not start.exists() and not stopped:
        time.sleep(0.005)
    if stopped:
        return 0
    t0_ns = json.loads(start.read_text())["t0_ns"]
    seconds = config["playback"]["end_s"]
    with (folder / "events.jsonl").open("w") as events:
        for frame in range(round(seconds * 10)):
            while time.monotonic_ns() < t0_ns + frame * 100_000_000 and not stopped:
                time.sleep(0.002)
            if act == "die" and frame == 2:
                os.kill(os.getpid(), signal.SIGSEGV)
            if stopped:
                break
            if act == "hungry":
                hoard = b"x" * (900 << 20)
                print(len(hoard))
            if act == "burn":
                until = time.monotonic() + 0.09
                while time.monotonic() < until:
                    pass
            event = {"t_ns": time.monotonic_ns() - t0_ns, "type": "frame_tracked", "frame": frame}
            event |= {"seq_s": frame / 10, "state": "ok", "track_ms": 1.0, "wait_ms": 0.1}
            if arguments.role == "mobile":
                events.write(json.dumps(event) + "\n")
    while act == "hang":
        time.sleep(0.05)
    while act == "flood" and not stopped:
        print("x" * 1000, flush=True)
    if act == "many":
        for number in range(10_000):
            (folder / str(number)).touch()
        while not stopped:
            time.sleep(0.05)
    node = {"role": arguments.role, "exit_reason": "done", "stopped": stopped}
    (folder / "node.json").write_text(json.dumps(node | {"frames_total": 0, "version": "0"}))
    return 0


sys.exit(main())
