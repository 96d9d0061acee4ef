# SPDX-License-Identifier: Apache-2.0
"""Measurements of the link itself, in separate namespaces (`slambed link measure`)."""

import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from slambed.link.backend import open_link
from slambed.link.profile import Profile, load_profile, parse_profile
from slambed.link.record import LinkRecord
from slambed.link.scratch import two_namespaces
from slambed.link.session import EDGE_ADDRESS, MOBILE_ADDRESS, LinkOptions
from slambed.link.traffic import (
    Flood,
    TcpRttProbe,
    one_way,
    tcp_throughput_mbps,
    udp_flood,
)

HEAD_START_NS = 100_000_000
AROUND_S = 60.0
"""Longer than a measurement takes besides its seconds."""


@dataclass(frozen=True)
class LinkRun:
    """A measured link."""

    profile: Profile
    record: LinkRecord


@dataclass(frozen=True)
class BenchRow:
    """One profile over one backend; errors in ms from kernel timestamps, without the base delay."""

    profile: str
    backend: str
    packets: int
    one_way_base: float
    """Half of the RTT while the link adds no delay."""
    one_way_median: float
    """Error |one-way delay mobile to edge - profile - base|; also in the next two fields."""
    one_way_p99: float
    one_way_max: float
    rtt_median: float
    """RTT error of the link proof; also in the next field."""
    rtt_p99: float
    reordered: int


def _for_all(seconds: float) -> dict[str, float]:
    """Returns the option with which a profile plays for so many seconds and what is around them."""
    return {"horizon_s": max(LinkOptions.horizon_s, seconds + AROUND_S)}


def measure_link(
    profile: Profile,
    backend: str,
    seconds: float,
    seed: int = 1,
    with_tcp: bool = False,
    **options: Any,
) -> LinkRun:
    """Measures a profile between two temporary namespaces. With `with_tcp` the record also has
    the series `tcp_rtt_ms`."""
    with ExitStack() as stack:
        log_dir = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        mobile, edge = stack.enter_context(two_namespaces())
        link = stack.enter_context(
            open_link(backend, mobile, edge, profile, seed, log_dir, **_for_all(seconds), **options)
        )
        t0_ns = time.monotonic_ns() + HEAD_START_NS
        link.start(t0_ns)
        follower = TcpRttProbe(mobile, edge, EDGE_ADDRESS) if with_tcp else None
        with follower or ExitStack():
            time.sleep(seconds + HEAD_START_NS / 1e9)
        record = link.stop()
    if follower is None:
        return LinkRun(profile, record)
    rows = pd.DataFrame(follower.samples, columns=["t_s", "value"])
    rows["t_s"] = (rows["t_s"] - t0_ns) / 1e9
    rows["series"] = "tcp_rtt_ms"
    frame = pd.concat([record.frame, rows], ignore_index=True)[list(record.frame.columns)]
    return LinkRun(profile, replace(record, frame=frame))


def bench(
    profile: Profile, backend: str, seconds: float, rate_hz: float = 20.0, **options: Any
) -> tuple[BenchRow, pd.DataFrame]:
    """Measures one-way UDP delays and echo RTTs over a profile; returns the row and the link
    log."""
    with ExitStack() as stack:
        log_dir = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        mobile, edge = stack.enter_context(two_namespaces())
        link = stack.enter_context(
            open_link(backend, mobile, edge, profile, 1, log_dir, **_for_all(seconds), **options)
        )
        t0_ns = time.monotonic_ns()
        link.start(t0_ns)
        samples = one_way(mobile, edge, EDGE_ADDRESS, rate_hz, seconds)
        record = link.stop()
    sent_s = (samples.sent_ns - t0_ns) / 1e9
    error = samples.delay_ms - profile.up_ms(sent_s) - link.base_ms / 2
    size = np.abs(error[np.isfinite(error)])
    row = BenchRow(
        profile=profile.name,
        backend=record.backend,
        packets=len(size),
        one_way_base=link.base_ms / 2,
        one_way_median=float(np.median(size)),
        one_way_p99=float(np.percentile(size, 99)),
        one_way_max=float(size.max()),
        rtt_median=record.proof.error_ms_median,
        rtt_p99=record.proof.error_ms_p99,
        reordered=samples.reordered,
    )
    return row, record.frame


def bench_profiles(seconds: float) -> list[Profile]:
    """Returns constants of 0, 5, 20 and 40 ms one way, and the papers' two shapes (ramp and
    sine)."""
    half = {"rise_s": seconds / 2, "hold_s": 0.0, "fall_s": seconds / 2}
    return [
        *(parse_profile(rtt_ms, "bench") for rtt_ms in (0, 10, 40, 80)),
        parse_profile({"profile": "ramp", "params": half, "name": "ramp"}, "bench"),
        load_profile("sine"),
    ]


def throughput(backend: str, rtt_ms: float, seconds: float = 5.0) -> tuple[float, float]:
    """Returns the TCP goodput [Mbit/s] up and down."""
    with ExitStack() as stack:
        log_dir = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        mobile, edge = stack.enter_context(two_namespaces())
        profile = parse_profile(rtt_ms, "bench")
        link = stack.enter_context(
            open_link(backend, mobile, edge, profile, 1, log_dir, probe_hz=0)
        )
        link.start(time.monotonic_ns())
        up = tcp_throughput_mbps(mobile, edge, EDGE_ADDRESS, seconds)
        down = tcp_throughput_mbps(edge, mobile, MOBILE_ADDRESS, seconds)
        return up, down


def reordering(backend: str, count: int) -> Flood:
    """Sends numbered packets at full speed while the delay changes by 40 ms five times per
    second."""
    swing = {"sine": {"mean_ms": 20, "amplitude_ms": 20, "period_s": 0.2}}
    with ExitStack() as stack:
        log_dir = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        mobile, edge = stack.enter_context(two_namespaces())
        profile = parse_profile({"name": "swing", "rtt_ms": swing}, "bench")
        link = stack.enter_context(
            open_link(backend, mobile, edge, profile, 1, log_dir, probe_hz=0)
        )
        link.start(time.monotonic_ns())
        return udp_flood(mobile, edge, EDGE_ADDRESS, count)
