# SPDX-License-Identifier: Apache-2.0
"""Sends the same messages over a real link and through the virtual engine's model of it.

Both use one TCP connection with messages going up. Live: two namespaces, the kernel's TCP and a
link backend. Virtual: `slambed-sim --messages`.
"""

import json
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.errors import environment_error
from slambed.link.backend import open_link
from slambed.link.modeled import modeled_link
from slambed.link.profile import Profile, parse_profile
from slambed.link.scratch import two_namespaces
from slambed.link.session import EDGE_ADDRESS, LinkOptions
from slambed.native import SIMULATION, find_program
from slambed.process.namespaces import inside

PORT = 47095
HEADER_BYTES = 44
"""Header of a frame on a channel (runtime/frame_header.hpp), which the virtual link adds."""
HEAD_START_S = 0.5
CONNECT_TIMEOUT_S = 20.0
LONGEST_STALL_S = 150.0
"""TCP's retransmission timeout backs off to 120 s."""
NS = 1e9

SIZES = (1_000, 10_000, 40_000, 160_000, 640_000)
"""Bytes of a probe, a small and a typical keyframe, an update, and Edge-SLAM's text keyframe."""
RTTS_MS = (0.25, 20.0, 40.0, 80.0)
RATES_MBPS = (None, 50.0)
GAP_S = 2.5
"""Time between messages, so that each one starts on an idle connection."""


@dataclass(frozen=True)
class Trace:
    """Send times and sizes of messages."""

    sent_s: NDArray[np.float64]
    sizes: NDArray[np.int64]

    @staticmethod
    def of(sizes: Sequence[int], repetitions: int, gap_s: float = GAP_S) -> "Trace":
        """Cycles through all sizes, one message at a time."""
        every = np.array([*sizes] * repetitions)
        return Trace(gap_s * np.arange(len(every), dtype=np.float64), every)

    @staticmethod
    def steady(count: int, size: int, hz: float) -> "Trace":
        """Messages of one size at a constant rate."""
        return Trace(np.arange(count, dtype=np.float64) / hz, np.full(count, size))

    @property
    def end_s(self) -> float:
        """Time by which the last message has certainly arrived."""
        return float(self.sent_s[-1]) + GAP_S


def bench_profile(rtt_ms: float, rate_mbps: float | None) -> Profile:
    """Returns a profile with a constant RTT and an optional rate."""
    rate = {} if rate_mbps is None else {"rate": {"mbps": rate_mbps}}
    return parse_profile({"name": "messages", "rtt_ms": rtt_ms, **rate}, "messages")


def virtual_ms(profile: Profile, trace: Trace, seed: int = 1) -> NDArray[np.float64]:
    """Returns the latency of each message in the model."""
    content = {
        "format": "slambed-messages",
        "version": 1,
        "seed": seed,
        "link": modeled_link(profile, trace.end_s).as_json(),
        "messages": [
            {"sent_s": float(t), "bytes": int(max(0, size - HEADER_BYTES))}
            for t, size in zip(trace.sent_s, trace.sizes, strict=True)
        ],
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "messages.json"
        path.write_text(json.dumps(content))
        done = subprocess.run(
            [find_program(SIMULATION), "--messages", path],
            capture_output=True,
            text=True,
            check=True,
        )
    arrived = [json.loads(line)["received_ns"] / NS for line in done.stdout.splitlines()]
    return (np.array(arrived) - trace.sent_s) * 1e3


def live_ms(
    profile: Profile, trace: Trace, backend: str = "relay", seed: int = 1
) -> NDArray[np.float64]:
    """Returns the latency of each message measured between two namespaces."""
    horizon_s = max(LinkOptions.horizon_s, trace.end_s + LONGEST_STALL_S)
    with ExitStack() as stack:
        log_dir = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        mobile, edge = stack.enter_context(two_namespaces())
        link = stack.enter_context(
            open_link(
                backend, mobile, edge, profile, seed, log_dir, probe_hz=0, horizon_s=horizon_s
            )
        )
        server = stack.enter_context(
            inside(edge, lambda: socket.create_server((EDGE_ADDRESS, PORT)))
        )
        client = stack.enter_context(
            inside(
                mobile,
                lambda: socket.create_connection((EDGE_ADDRESS, PORT), timeout=CONNECT_TIMEOUT_S),
            )
        )
        # Otherwise the timeout of the connection holds for every message, too.
        client.settimeout(LONGEST_STALL_S)
        peer, _ = server.accept()
        stack.enter_context(peer)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # Run time 0 is the trace's time 0, as in the model: bursts and cuts hit the same messages.
        begin = time.monotonic() + HEAD_START_S
        link.start(int(begin * NS))

        def send() -> None:
            with suppress(OSError):  # the reader reports what does not arrive
                for due_s, size in zip(trace.sent_s, trace.sizes, strict=True):
                    time.sleep(max(0.0, begin + due_s - time.monotonic()))
                    client.sendall(bytes(int(size)))

        thread = threading.Thread(target=send, daemon=True)
        thread.start()
        peer.settimeout(LONGEST_STALL_S)
        arrived = [_take(peer, int(size)) for size in trace.sizes]
        thread.join()
    # Measured from the due time: a full send buffer blocks the sender, and that wait must count.
    return (np.array(arrived) - begin - trace.sent_s) * 1e3


def _take(peer: socket.socket, size: int) -> float:
    """Returns the time at which the last byte of a message arrived."""
    left = size
    while left > 0:
        try:
            piece = peer.recv(min(left, 1 << 18))
        except TimeoutError:
            raise environment_error(
                f"the link carried nothing for {LONGEST_STALL_S:.0f} s; use a profile with "
                "shorter cuts and less loss"
            ) from None
        if not piece:
            raise ConnectionError("the sender closed the connection")
        left -= len(piece)
    return time.monotonic()


def compare(
    profiles: Sequence[tuple[float, float | None]],
    sizes: Sequence[int],
    repetitions: int,
    backend: str = "relay",
) -> pd.DataFrame:
    """Returns one row per profile (RTT, rate) and size: live and virtual medians, and their
    difference."""
    rows = []
    for rtt_ms, rate_mbps in profiles:
        profile, trace = bench_profile(rtt_ms, rate_mbps), Trace.of(sizes, repetitions)
        live, virtual = live_ms(profile, trace, backend), virtual_ms(profile, trace)
        for size in sizes:
            own = trace.sizes == size
            measured, modeled = float(np.median(live[own])), float(np.median(virtual[own]))
            rows.append(
                {
                    "rtt_ms": rtt_ms,
                    "rate_mbps": rate_mbps,
                    "bytes": size,
                    "live_ms": measured,
                    "live_spread_ms": float(np.ptp(live[own])),
                    "virtual_ms": modeled,
                    "error_ms": modeled - measured,
                    "error_percent": 100 * (modeled / measured - 1),
                }
            )
    return pd.DataFrame(rows)


QUANTILES = (0.5, 0.9, 1.0)


def compare_profile(
    profile: Profile, trace: Trace, seeds: Sequence[int], backend: str = "relay"
) -> pd.DataFrame:
    """Returns one row per seed: latencies of the trace's messages on the real link and in the
    model.

    Columns are `live_50_ms`, `virtual_50_ms`, likewise 90 and 100 (the longest stall). With random
    impairments the same seed gives different runs on both sides, so compare distributions, not
    rows.
    """
    rows = []
    for seed in seeds:
        row: dict[str, float] = {"seed": seed}
        for side, took in (
            ("live", live_ms(profile, trace, backend, seed)),
            ("virtual", virtual_ms(profile, trace, seed)),
        ):
            for quantile in QUANTILES:
                row[f"{side}_{100 * quantile:.0f}_ms"] = float(np.quantile(took, quantile))
        rows.append(row)
    return pd.DataFrame(rows)
