# SPDX-License-Identifier: Apache-2.0
"""Messages through the modelled link, and the same ones through the relay."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from harness_parts import needs_root
from virtual_parts import needs_programs

from slambed.errors import ExitCode
from slambed.link.messages import HEADER_BYTES, Trace, bench_profile, compare, virtual_ms
from slambed.native import find_program

pytestmark = needs_programs
SEGMENT = 1448


def test_a_small_message_takes_half_the_rtt() -> None:
    found = virtual_ms(bench_profile(40.0, None), Trace.of((1_000,), 3))
    assert found == pytest.approx([20.0] * 3, abs=0.01)


def test_slow_start_costs_a_round_trip_per_doubling() -> None:
    """10, 20, 40 segments of a fresh connection: half, one and a half, two and a half RTTs."""
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


def test_a_rate_serialises() -> None:
    (took,) = virtual_ms(bench_profile(0.25, 10.0), Trace.of((640_000,), 1))
    packets = 640_000 / SEGMENT
    wire_bytes = 640_000 + packets * 52
    serial_ms = wire_bytes * 8 / 10e6 * 1e3
    # The queue overflows once: some segments are sent twice.
    assert serial_ms < took < 1.05 * serial_ms


@needs_root
@pytest.mark.skipif(not Path("/dev/net/tun").exists(), reason="needs /dev/net/tun")
def test_the_relay_shows_the_same_shape() -> None:
    """Not how fast this machine is: only what is far beyond any load."""
    table = compare([(80.0, None)], (1_000, 160_000), repetitions=3)
    small, large = table["live_ms"]
    assert small >= 39.0 and large >= small + 2 * 80.0
    assert (table["virtual_ms"] <= table["live_ms"] * 1.25).all()


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


def good_arrival(program: Path, folder: Path, content: dict, message: dict) -> str:
    path = folder / "one.json"
    path.write_text(json.dumps(content | {"messages": [message]}))
    done = subprocess.run([program, "--messages", path], capture_output=True, text=True, check=True)
    return done.stdout
