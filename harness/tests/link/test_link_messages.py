# SPDX-License-Identifier: Apache-2.0
"""Messages through the modeled link and through the relay."""

import json
import os
import socket
import subprocess
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from harness_parts import needs_root
from virtual_parts import needs_programs

from slambed.errors import ExitCode, SlambedError
from slambed.link import bench
from slambed.link import messages as traffic
from slambed.link.messages import (
    HEADER_BYTES,
    Trace,
    bench_profile,
    compare,
    compare_profile,
    live_ms,
    virtual_ms,
)
from slambed.link.modeled import modeled_link
from slambed.link.profile import Profile, parse_profile
from slambed.native import find_program

pytestmark = needs_programs
SEGMENT = 1448


def test_a_small_message_takes_half_the_rtt() -> None:
    found = virtual_ms(bench_profile(40.0, None), Trace.of((1_000,), 3))
    assert found == pytest.approx([20.0] * 3, abs=0.01)


def test_slow_start_costs_a_round_trip_per_doubling() -> None:
    """10, 20, 40 segments of a new connection need 0.5, 1.5 and 2.5 RTTs."""
    for segments, trips in ((10, 0.5), (11, 1.5), (30, 1.5), (31, 2.5), (70, 2.5)):
        size = segments * SEGMENT
        (took,) = virtual_ms(bench_profile(80.0, None), Trace.of((size,), 1))
        assert took == pytest.approx(80.0 * trips, abs=1.0), segments


def test_an_idle_connection_starts_slowly_again() -> None:
    profile, size = bench_profile(80.0, None), 100 * SEGMENT
    first, second = virtual_ms(profile, Trace.of((size,), 2, gap_s=3.0))
    assert second == pytest.approx(first, abs=1.0)
    _, busy = virtual_ms(profile, Trace.of((size,), 2, gap_s=0.4))
    assert busy < first - 80.0


def test_a_rate_serializes() -> None:
    (took,) = virtual_ms(bench_profile(0.25, 10.0), Trace.of((640_000,), 1))
    packets = 640_000 / SEGMENT
    wire_bytes = 640_000 + packets * 52
    serial_ms = wire_bytes * 8 / 10e6 * 1e3
    # The queue overflows once, so some segments are retransmitted.
    assert serial_ms < took < 1.05 * serial_ms


BURSTS = parse_profile(
    {
        "name": "bursts",
        "rtt_ms": {"repeat": {"period_s": 10, "of": {"steps": [[0, 10], [5, 90]]}}},
        "loss": {"gilbert_elliott": {"good_s": 5, "bad_s": 0.1}},
    },
    "bursts",
)


def test_bursts_in_time_never_stall_tcp_for_long() -> None:
    """250 messages of 25 kB at 10 Hz: a burst costs one or two timeouts for any seed."""
    trace = Trace.steady(250, 25_000, 10.0)
    for seed in range(1, 9):
        took = virtual_ms(BURSTS, trace, seed)
        assert np.median(took) < 60.0 and took.max() < 3_000.0, seed


def test_an_outage_is_over_a_few_round_trips_after_the_time_out() -> None:
    """A lost window is recovered in slow start, not by one segment per RTT."""
    profile = parse_profile(
        {
            "name": "cut",
            "rtt_ms": 40,
            "gaps": [{"start_s": 1.0, "length_s": 0.3}],
            "gap_mode": "drop",
        },
        "cut",
    )
    trace = Trace(np.array([0.5, 0.985]), np.array([140_000, 140_000]))
    _, second = virtual_ms(profile, trace)
    assert 300.0 < second < 1_200.0


@needs_root
@pytest.mark.skipif(not Path("/dev/net/tun").exists(), reason="needs /dev/net/tun")
def test_live_and_model_meet_the_same_bursts() -> None:
    table = compare_profile(BURSTS, Trace.steady(100, 25_000, 10.0), seeds=(1,))
    assert (table["live_100_ms"] < 3_000.0).all() and (table["virtual_100_ms"] < 3_000.0).all()
    assert (table["live_50_ms"] >= 5.0).all() and (table["virtual_50_ms"] >= 5.0).all()


@needs_root
@pytest.mark.skipif(not Path("/dev/net/tun").exists(), reason="needs /dev/net/tun")
def test_the_relay_shows_the_same_shape() -> None:
    """Loose limits, which only a gross error exceeds on a loaded machine."""
    table = compare([(80.0, None)], (1_000, 160_000), repetitions=3)
    small, large = table["live_ms"]
    assert small >= 39.0 and large >= small + 2 * 80.0
    assert (table["virtual_ms"] <= table["live_ms"] * 1.25).all()


class OpenedError(Exception):
    """What this link is opened with."""


def opens(*_: Any, horizon_s: float, **__: Any) -> None:
    raise OpenedError(horizon_s)


@pytest.mark.parametrize(("seconds", "least_s"), [(10.0, 900.0), (1000.0, 1050.0)])
def test_a_profile_plays_for_all_of_a_measurement(
    monkeypatch: pytest.MonkeyPatch, seconds: float, least_s: float
) -> None:
    profile, late = bench_profile(1.0, None), Trace.steady(2, 1_000, 1 / seconds)
    for module in (bench, traffic):
        monkeypatch.setattr(module, "two_namespaces", lambda: nullcontext(("mobile", "edge")))
        monkeypatch.setattr(module, "open_link", opens)
    for measure in (
        lambda: bench.measure_link(profile, "relay", seconds),
        lambda: bench.bench(profile, "relay", seconds),
        lambda: live_ms(profile, late),
    ):
        with pytest.raises(OpenedError) as opened:
            measure()
        assert opened.value.args[0] >= least_s


def test_the_sender_bears_as_long_a_stall_as_the_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    """The connection's own timeout is shorter."""
    made: list[socket.socket] = []

    def here(namespace: str, make: Callable[[], socket.socket]) -> socket.socket:
        made.append(make())
        return made[-1]

    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    link = SimpleNamespace(start=lambda t0_ns: None)
    for name, value in (("EDGE_ADDRESS", "127.0.0.1"), ("PORT", port), ("HEAD_START_S", 0.0)):
        monkeypatch.setattr(traffic, name, value)
    monkeypatch.setattr(traffic, "two_namespaces", lambda: nullcontext(("mobile", "edge")))
    monkeypatch.setattr(traffic, "open_link", lambda *_, **__: nullcontext(link))
    monkeypatch.setattr(traffic, "inside", here)
    assert len(live_ms(bench_profile(1.0, None), Trace.steady(2, 1_000, 100.0))) == 2
    _, client = made
    assert client.gettimeout() == traffic.LONGEST_STALL_S


def test_a_link_that_carries_nothing_is_one_line() -> None:
    near, far = socket.socketpair()
    near.settimeout(0.01)
    line = "the link carried nothing for 150 s; use a profile with shorter cuts and less loss"
    with near, far, pytest.raises(SlambedError, match=line) as raised:
        traffic._take(near, 1)
    assert raised.value.code == ExitCode.ENVIRONMENT


def test_bad_traces_are_refused(tmp_path: Path) -> None:
    program = find_program("slambed-sim")
    good = {"format": "slambed-messages", "version": 1, "seed": 1}
    good |= {"link": {"step_ms": 10, "interpolation": "linear"}}
    good["link"] |= {side: {"delay_us": [0]} for side in ("up", "down")}
    message = {"sent_s": 0.0, "bytes": 1000 - HEADER_BYTES}
    for messages, complaint in (
        ([message], ""),
        ([], "messages must be a list"),
        ([message, message | {"sent_s": -1.0}], "messages[1].sent_s must not go back"),
        ([message | {"bytes": -5}], "messages[0].bytes"),
        ([message | {"size": 3}], "messages[0].size is unknown"),
    ):
        path = tmp_path / "trace.json"
        path.write_text(json.dumps(good | {"messages": messages}))
        done = subprocess.run([program, "--messages", path], capture_output=True, text=True)
        assert done.returncode == (ExitCode.BAD_INPUT if complaint else ExitCode.OK), done.stderr
        assert complaint in done.stderr and done.stderr.count(os.linesep) == bool(complaint)
    assert np.isfinite(json.loads(good_arrival(program, tmp_path, good, message))["received_ns"])


def of_link(**keys: Any) -> Profile:
    return parse_profile({"rtt_ms": 10, **keys}, "test")


def jitter(**keys: Any) -> dict[str, Any]:
    return {"up": {"jitter": keys}}


def chain(**keys: Any) -> dict[str, Any]:
    return {"up": {"loss": {"gilbert_elliott": keys}}}


LIMITS = [
    ({"rtt_ms": 120_000}, {"delay_us": [60e6 + 1]}),
    ({"up": {"rate": {"mbps": 0.001, "queue_bytes": 3000}}}, {"rate": {"bits_per_s": 999.0}}),
    ({"up": {"rate": {"mbps": 100_000}}}, {"rate": {"bits_per_s": 1.01e12}}),
    (
        {"up": {"rate": {"mbps": 1, "queue_bytes": 10**10}}},
        {"rate": {"queue_bytes": 10**10 + 1}},
    ),
    (jitter(sd_ms=60_000, max_ms=60_000), {"jitter": {"scale_us": 60e6 + 1}}),
    (jitter(sd_ms=1, correlation_s=3600), {"jitter": {"correlation_time_s": 3600.1}}),
    (jitter(shape="pareto", mean_ms=1, tail=1.01), {"jitter": {"pareto_shape": 1.009}}),
    (jitter(shape="pareto", mean_ms=1, tail=100), {"jitter": {"pareto_shape": 100.1}}),
    (chain(good_s=1e6, bad_s=1e-4), {"loss": {"good_s": 1e6 + 1}}),
    (chain(good_s=1e-4, bad_s=1e-4, loss_bad=0), {"loss": {"bad_s": 0.9e-4}}),
]


@pytest.mark.parametrize(("asked", "beyond"), LIMITS)
def test_the_program_accepts_every_checked_profile(
    tmp_path: Path, asked: dict[str, Any], beyond: dict[str, Any]
) -> None:
    """The limits of a profile are those of the program, which has no wider ones on either side."""
    program = find_program("slambed-sim")
    link = modeled_link(of_link(**asked), 60.0).as_json()
    content = {"format": "slambed-messages", "version": 1, "seed": 1, "messages": []}
    content["messages"] = [{"sent_s": 0.0, "bytes": 100}]

    def refused() -> str:
        path = tmp_path / "trace.json"
        path.write_text(json.dumps(content | {"link": link}))
        # The longest delays need more virtual time than the program waits for.
        return subprocess.run([program, "--messages", path], capture_output=True, text=True).stderr

    assert "link configuration" not in refused()
    for key, value in beyond.items():
        link["up"][key] = {**link["up"][key], **value} if isinstance(value, dict) else value
    assert "link configuration" in refused()


def test_the_default_queue_is_never_larger_than_the_largest(tmp_path: Path) -> None:
    """A trace of 12 Tbit/s."""
    trace = tmp_path / "fast.up"
    trace.write_text("1\n" * 1_000_000)
    direction = modeled_link(of_link(up={"rate": {"trace": str(trace)}}), 60.0).up
    assert direction.rate is not None and direction.rate.queue_bytes == 10**10


def good_arrival(program: Path, folder: Path, content: dict, message: dict) -> str:
    path = folder / "one.json"
    path.write_text(json.dumps(content | {"messages": [message]}))
    done = subprocess.run([program, "--messages", path], capture_output=True, text=True, check=True)
    return done.stdout
