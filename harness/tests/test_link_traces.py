# SPDX-License-Identifier: Apache-2.0
"""Recorded RTT and rate: reading, windows, digests, and what is refused."""

from pathlib import Path
from typing import Any

import pytest

from slambed.errors import SlambedError
from slambed.link.profile import Profile, load_profile, parse_profile
from slambed.link.traces import mean_rate_mbps, read_rate_trace


def trace(tmp_path: Path, text: str, **keys: Any) -> Profile:
    file = tmp_path / "recorded.csv"
    file.write_text(text)
    return parse_profile({"rtt_ms": {"trace": {"file": str(file), **keys}}}, "here")


def test_a_csv_begins_at_run_time_zero(tmp_path: Path) -> None:
    profile = trace(tmp_path, "time_s,rtt_ms\n100.0,10\n100.5,20\n101.0,40\n")
    assert [profile.rtt_ms(t) for t in (0, 0.25, 0.5, 1.0, 9.0)] == [10, 15, 20, 40, 40]
    assert profile.duration == 1.0


def test_columns_units_window_and_hold(tmp_path: Path) -> None:
    text = "when(ms) lost delay(us)\n" + "".join(
        f"{1721032372703 + 50 * i} 0 {1000 * i}\n" for i in range(100)
    )
    profile = trace(
        tmp_path, text, time="when(ms)", time_unit="ms", rtt="delay(us)", rtt_unit="us",
        start_s=1.0, length_s=2.0, hold=True,
    )  # fmt: skip
    assert profile.rtt_ms(0) == pytest.approx(20)
    assert profile.rtt_ms(0.049) == pytest.approx(20)
    assert profile.rtt_ms(0.051) == pytest.approx(21)
    assert profile.duration == pytest.approx(2.0)


def test_a_ping_log(tmp_path: Path) -> None:
    text = "PING a (1.2.3.4) 56(84) bytes of data.\n" + "".join(
        f"64 bytes from 1.2.3.4: icmp_seq={i} ttl=57 time={10.0 + i} ms\n" for i in (1, 2, 3)
    )
    assert trace(tmp_path, text, format="ping").rtt_ms(1.0) == pytest.approx(12)


@pytest.mark.parametrize(
    ("text", "keys", "message"),
    [
        ("time_s,rtt_ms\n0,1\n0.5,2\n9,3\n", {}, "gap of 8.5 s in the trace at 0.5 s"),
        ("time_s,rtt_ms\n0,1\n0.5,2\n0.4,3\n", {}, "time does not increase at 0.500 s"),
        ("time_s,rtt_ms\n0,1\n0.5,-2\n", {}, "negative latency -2 ms at 0.500 s"),
        ("time_s,rtt_ms\n0,1\n0.5,nan\n", {}, "RTT is not a number at 0.500 s"),
        ("time_s,rtt_ms\n0,1\nnan,2\n", {}, "time is not a number.*line 3"),
        ("time_s,rtt_ms\n0,1\n0.5\n", {}, "not two numbers.*line 3"),
        ("time_s,rtt\n0,1\n", {}, "no column 'rtt_ms'.*did you mean 'rtt'"),
        ("time_s,rtt_ms\n", {}, "no samples"),
        ("nothing here\n", {"format": "ping"}, "no samples"),
        ("time_s,rtt_ms\n0,1\n0.5,2\n", {"start_s": 60.0}, "no samples between"),
        ("time_s,rtt_ms\n0,1\n", {"rtt_unit": "minutes"}, "rtt_unit"),
        ("time_s,rtt_ms\n0,1\n", {"sha256": "00"}, "not the expected content"),
    ],
)
def test_a_bad_trace_gets_one_clear_line(
    tmp_path: Path, text: str, keys: dict[str, Any], message: str
) -> None:
    with pytest.raises(SlambedError, match=message) as caught:
        trace(tmp_path, text, **keys)
    assert "\n" not in str(caught.value)


def test_a_trace_is_found_beside_its_profile(tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_text("time_s,rtt_ms\n0,5\n1,5\n")
    (tmp_path / "mine.yaml").write_text("rtt_ms: {trace: {file: mine.csv}}\n")
    profile = load_profile(tmp_path / "mine.yaml")
    assert profile.rtt_ms(0.5) == 5
    assert len(profile.content["rtt_ms"]["trace"]["sha256"]) == 64


def test_a_mahimahi_trace(tmp_path: Path) -> None:
    file = tmp_path / "up"
    file.write_text("\n".join(str(ms) for ms in range(2, 1001, 2)) + "\n")
    assert mean_rate_mbps(read_rate_trace(str(file), None)) == pytest.approx(6.0)
    profile = parse_profile({"rtt_ms": 1, "up": {"rate": {"trace": str(file)}}}, "here")
    assert profile.up.rate is not None and profile.down.rate is None
    assert profile.content["rate_sha256"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5\n3\n", "time goes back.*line 2"),
        ("5\nx\n", "'x' is not a whole number.*line 2"),
        ("", "no delivery opportunities"),
    ],
)
def test_a_bad_rate_trace_gets_one_clear_line(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "up"
    file.write_text(text)
    with pytest.raises(SlambedError, match=message):
        read_rate_trace(str(file), None)
