# SPDX-License-Identifier: Apache-2.0
"""The process on a board, besides its Docker: reports its clock, samples the mobile node, holds the
lock of the board.

It is sent over ssh as source, with the modules of `SHIPPED`, and can only import the standard
library (`agent_source`). It answers each line of JSON with one, and ends with its input.
"""

import contextlib
import json
import os
import platform
import socket
import struct
import sys
import threading
import time
from pathlib import Path
from typing import Any

from slambed.engines.lock_file import default_lock_path, open_lock, taken
from slambed.errors import SlambedError
from slambed.sampling.cgroup import CgroupReader, paths_of
from slambed.sampling.tasks import Pressure, RunQueueDelay
from slambed.sampling.tcp_info import TcpWatch

SAMPLE_EVERY_S = 0.1
NS_PER_S = 1e9
TCP_SETTINGS = ("tcp_congestion_control", "tcp_rmem", "tcp_wmem", "tcp_slow_start_after_idle")
ECHO = struct.Struct("!QQQ")
"""Number of the exchange (the whole request), time received, time answered [ns]."""


def cpu_online() -> list[int]:
    """Returns the numbers of the CPUs that a node may use."""
    return sorted(os.sched_getaffinity(0))


def model() -> str:
    """Returns the model of the board from its device tree, or else of its CPU."""
    with contextlib.suppress(OSError):
        return Path("/proc/device-tree/model").read_text(errors="replace").strip("\0 \n")
    for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model"):
            return value.strip()
    return platform.machine()


def look() -> dict[str, Any]:
    """Returns facts about this machine and its ssh connection."""
    # client address, client port, server address, server port
    words = os.environ.get("SSH_CONNECTION", "").split()
    tcp = {}
    for name in TCP_SETTINGS:
        try:
            tcp[f"net/ipv4/{name}"] = Path(f"/proc/sys/net/ipv4/{name}").read_text().strip()
        except OSError:
            continue
    return {
        "reply": "seen",
        "architecture": platform.machine(),
        "model": model(),
        "cpus": cpu_online(),
        "kernel": platform.release(),
        "python": platform.python_version(),
        "from_address": words[0] if len(words) == 4 else "",
        "own_address": words[2] if len(words) == 4 else "",
        "tcp": tcp,
    }


def steal_s() -> float | None:
    """Returns the CPU time of all CPUs that the hypervisor gave to other guests."""
    try:
        words = Path("/proc/stat").read_text().split("\n", 1)[0].split()
        return int(words[8]) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return None


class ClockEcho:
    """Answers datagrams with the times of their receipt and of the answer."""

    def __init__(self, address: str) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, 0))
        self.port = int(self._socket.getsockname()[1])
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            data, sender = self._socket.recvfrom(64)
            received_ns = time.monotonic_ns()
            if len(data) == 8:
                (number,) = struct.unpack("!Q", data)
                self._socket.sendto(ECHO.pack(number, received_ns, time.monotonic_ns()), sender)


class Watch:
    """Samples one node from `start` to `stop`, with timestamps of the board's clock."""

    def __init__(self, pid: int, ports: list[int]) -> None:
        paths = paths_of(pid)
        self._reader = CgroupReader(paths)
        self._delay = RunQueueDelay(pid)
        self._pressure = Pressure(paths.unified)
        self._tcp = TcpWatch(None, ports) if ports else None
        self._samples: list[dict[str, Any]] = []
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None
        self._cpu_s = 0.0
        self._began_s = time.monotonic()

    def granted(self) -> dict[str, Any]:
        """Returns the limits of its cgroup."""
        return vars(self._reader.granted())

    def start(self) -> None:
        """Starts sampling in a thread."""
        self._began_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopped.is_set():
            try:
                self._samples.append(self._sample())
            except OSError:
                break  # its cgroup is gone
            due = max(due + SAMPLE_EVERY_S, time.monotonic())
            self._stopped.wait(due - time.monotonic())
        self._cpu_s = time.thread_time()

    def _sample(self) -> dict[str, Any]:
        at_ns, usage = time.monotonic_ns(), self._reader.usage()
        tcp = self._tcp.read() if self._tcp is not None else None
        return {
            "at_ns": at_ns,
            "cpu_s": usage.cpu_s,
            "memory_mb": usage.memory_bytes / 2**20,
            "throttled_s": usage.throttled_s,
            "throttled_periods": usage.throttled_periods,
            "periods": usage.periods,
            "run_delay_s": self._delay.seconds(),
            "cpu_pressure_s": self._pressure.seconds(),
            "host_steal_s": steal_s(),
            "tcp_rtt_ms": None if tcp is None else tcp.rtt_ms,
            "tcp_retransmits": None if tcp is None else tcp.retransmits,
        }

    def stop(self) -> dict[str, Any]:
        """Returns all samples, and the CPU use of sampling in percent of one core."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()
        lasted_s = max(time.monotonic() - self._began_s, SAMPLE_EVERY_S)
        for kept in (self._reader, self._delay, self._pressure, self._tcp):
            if kept is not None:
                kept.close()
        percent = 100 * self._cpu_s / lasted_s
        return {"reply": "sampled", "samples": self._samples, "sampler_cpu_percent": percent}


class Agent:
    """Answers requests, one at a time."""

    def __init__(self) -> None:
        self._lock = -1
        self._watch: Watch | None = None

    def answer(self, asked: dict[str, Any]) -> dict[str, Any]:
        """Returns the answer to a request."""
        what = asked["request"]
        if what == "clock":
            received_ns = time.monotonic_ns()
            return {
                "reply": "clock",
                "received_ns": received_ns,
                "answered_ns": time.monotonic_ns(),
            }
        if what == "look":
            return look()
        if what == "echo":
            return {"reply": "echoing", "port": ClockEcho(asked["address"]).port}
        if what == "lock":
            self._lock = open_lock(default_lock_path())
            return {"reply": "locked", "ours": taken(self._lock)}
        if what == "watch":
            self._watch = Watch(asked["pid"], asked["ports"])
            return {"reply": "watching", "granted": self._watch.granted()}
        assert self._watch is not None
        if what == "start":
            self._watch.start()
            return {"reply": "sampling"}
        assert what == "stop", what
        return self._watch.stop()


def main() -> None:
    """Serves requests until the input ends."""
    agent = Agent()
    with os.fdopen(0, "rb", buffering=0) as requests:
        for line in requests:
            try:
                reply = agent.answer(json.loads(line))
            except (SlambedError, OSError) as error:
                reply = {"reply": "failure", "error": str(error), "code": 3, "passes": False}
            sys.stdout.write(json.dumps(reply) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
