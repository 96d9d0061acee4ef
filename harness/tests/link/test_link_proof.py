# SPDX-License-Identifier: Apache-2.0
"""The link's verdict for synthetic echoes; schedules; the packet log."""

from pathlib import Path

import numpy as np
import pytest

from slambed.link.direction_tables import delay_table_ms, direction_config
from slambed.link.packets import RECORD, read_packets
from slambed.link.probe import Echoes
from slambed.link.profile import Profile, parse_profile
from slambed.link.proof import ExtraDelays, LinkProof, LinkTolerance, expected_rtt_ms, judge
from slambed.link.relay import extra_delays_of

T0 = 5_000_000_000
BASE = 0.2


def echoes(profile: Profile, seconds: float, error_ms: float = 0.0, lost: float = 0.0) -> Echoes:
    """20 Hz echoes over this profile, all with error `error_ms`, the last share lost."""
    sent_s = np.arange(0, seconds, 0.05)
    rtt = expected_rtt_ms(profile, sent_s, ExtraDelays.none(len(sent_s))) + BASE + error_ms
    rtt[len(rtt) - int(lost * len(rtt)) :] = np.nan
    return Echoes(
        sequence=np.arange(1, len(rtt) + 1), sent_ns=(sent_s * 1e9).astype(int) + T0, rtt_ms=rtt
    )


def verdict(profile: Profile, seen: Echoes, died: str | None = None) -> LinkProof:
    tolerance = LinkTolerance(median_ms=1.0, p99_ms=3.0)
    end = T0 + 10_000_000_000
    return judge(profile, seen, T0, end, BASE, 20.0, tolerance, died=died)


RAMP = parse_profile("ramp", "here")


def test_a_link_that_does_what_was_asked_is_valid() -> None:
    proof = verdict(RAMP, echoes(RAMP, 10, error_ms=-0.3))
    assert proof.valid and proof.reason == ""
    assert proof.error_ms_median == pytest.approx(0.3)
    assert proof.bias_ms == pytest.approx(-0.3)


@pytest.mark.parametrize(
    ("seen", "died", "reason"),
    [
        (echoes(RAMP, 10, error_ms=1.5), None, "median RTT error 1.50 ms is above 1 ms"),
        (echoes(RAMP, 10, lost=0.5), None, "RTT probes came back"),
        (echoes(RAMP, 4), None, "RTT probes came back"),
        (echoes(RAMP, 10, lost=1.0), None, "RTT probes came back"),
        (echoes(RAMP, 10), "killed", "the link went away: killed"),
        (echoes(parse_profile(0, "other"), 10), None, "median RTT error"),
    ],
)
def test_a_link_that_does_not_is_invalid_with_a_reason(
    seen: Echoes, died: str | None, reason: str
) -> None:
    proof = verdict(RAMP, seen, died)
    assert not proof.valid
    assert reason in proof.reason


def test_outliers_fail_by_the_99th_percentile() -> None:
    seen = echoes(RAMP, 10)
    seen.rtt_ms[10:20] += 8.0
    assert "p99" in verdict(RAMP, seen).reason


def test_asked_losses_are_allowed_for_and_gaps_are_left_out() -> None:
    lossy = parse_profile({"rtt_ms": 20, "loss": {"random": 0.4}}, "here")
    assert verdict(lossy, echoes(lossy, 10, lost=0.6)).valid
    gap = parse_profile({"rtt_ms": 20, "gaps": [{"start_s": 2, "length_s": 1}]}, "here")
    seen = echoes(gap, 10)
    seen.rtt_ms[40:60] += np.linspace(1000, 50, 20)
    proof = verdict(gap, seen)
    assert proof.valid
    assert proof.error_ms_max < 0.01


def test_what_a_cut_takes_is_not_missed() -> None:
    cut = {"rtt_ms": 20, "gaps": [{"start_s": 2, "length_s": 5}], "gap_mode": "drop"}
    profile = parse_profile(cut, "here")
    seen = echoes(profile, 10)
    sent_s = (seen.sent_ns - T0) / 1e9
    seen.rtt_ms[(sent_s > 1.99) & (sent_s < 7)] = np.nan
    assert verdict(profile, seen).valid
    # Other losses still count, and a gap that only delays loses nothing.
    seen.rtt_ms[sent_s > 8] = np.nan
    assert "RTT probes came back" in verdict(profile, seen).reason
    held = parse_profile(cut | {"gap_mode": "hold"}, "here")
    seen = echoes(held, 10)
    seen.rtt_ms[(sent_s > 1.99) & (sent_s < 7)] = np.nan
    assert "RTT probes came back" in verdict(held, seen).reason


def test_an_echo_meets_each_direction_when_it_gets_there() -> None:
    slope = parse_profile({"rtt_ms": {"points": [[0, 0], [10, 1000]]}}, "here")
    (total,) = expected_rtt_ms(slope, np.array([1.0]), ExtraDelays.none(1))
    up = 50.0
    assert total == pytest.approx(up + (50.0 + 50 * 0.05))  # down at 1.05 s
    waited = ExtraDelays(up_ms=np.array([100.0]), down_ms=np.array([0.0]))
    (later,) = expected_rtt_ms(slope, np.array([1.0]), waited)
    assert later > total + 100


def test_a_profile_becomes_a_table_that_ends_where_it_settles() -> None:
    up, down = delay_table_ms(RAMP, 900)
    assert len(up) == len(down) == 2001
    assert up[900] == pytest.approx(42.5)
    assert delay_table_ms(parse_profile(40, "here"), 900) == ([20.0], [20.0])
    wave = {"rtt_ms": {"sine": {"mean_ms": 9, "amplitude_ms": 1, "period_s": 4}}}
    assert len(delay_table_ms(parse_profile(wave, "here"), 30)[0]) == 3001


def test_the_relay_is_given_every_impairment() -> None:
    profile = parse_profile(
        {
            "rtt_ms": 10,
            "rate": {"mbps": 40},
            "loss": {"gilbert_elliott": {"to_bad": 0.01, "to_good": 0.2}},
            "jitter": {"shape": "pareto", "mean_ms": 2, "correlation_s": 0.1},
            "gaps": [{"start_s": 1, "length_s": 0.5, "every_s": 10}],
        },
        "here",
    )
    config = direction_config(profile, profile.up, [5.0], 30).as_json()
    assert config["delay_us"] == [5000.0]
    assert config["rate"] == {"bits_per_s": 40e6, "queue_bytes": 1_000_000}
    assert config["loss"] == {"to_bad": 0.01, "to_good": 0.2, "loss_good": 0.0, "loss_bad": 1.0}
    bursts = parse_profile(
        {"rtt_ms": 10, "loss": {"gilbert_elliott": {"good_s": 4, "bad_s": 1}}}, "here"
    )
    assert direction_config(bursts, bursts.up, [5.0], 30).as_json()["loss"] == {
        "good_s": 4.0,
        "bad_s": 1.0,
        "loss_good": 0.0,
        "loss_bad": 1.0,
    }
    assert bursts.up.loss is not None and bursts.up.loss.mean() == 0.2
    assert config["jitter"]["scale_us"] == 2000
    assert config["gaps_s"] == [[1.0, 1.5], [11.0, 11.5], [21.0, 21.5]]


def test_the_packet_log_says_what_an_echo_waited(tmp_path: Path) -> None:
    records = np.zeros(3, dtype=RECORD)
    records["protocol"] = 1
    records["tag"] = [1, 1, 7]
    records["direction"] = [0, 1, 0]
    records["in_ns"] = [T0, T0 + 30_000_000, T0 + 50_000_000]
    records["profile_ns"] = 20_000_000
    records["due_ns"] = records["in_ns"] + np.array([25_000_000, 20_000_000, 21_000_000])
    file = tmp_path / "packets.bin"
    file.write_bytes(records.tobytes() + b"torn")
    packets = read_packets(file)
    assert len(packets) == 3
    seen = Echoes(np.array([1, 2, 7]), T0 + np.array([0, 25, 50]) * 1_000_000, np.full(3, 50.0))
    extra = extra_delays_of(packets, seen)
    assert list(extra.up_ms) == [5, 0, 1]
    assert list(extra.down_ms) == [0, 0, 0]


def test_an_echo_that_waited_long_on_its_way_up_is_found_on_its_way_back(tmp_path: Path) -> None:
    records = np.zeros(3, dtype=RECORD)
    records["protocol"] = 1
    records["tag"] = 1
    records["direction"] = [1, 0, 1]
    # The first is a ping before the run, which has the same number.
    records["in_ns"] = T0 + np.array([-1, 0, 5]) * 1_000_000_000
    records["profile_ns"] = 20_000_000
    waits_ms = np.array([9, 4_980, 3])
    records["due_ns"] = records["in_ns"] + 20_000_000 + waits_ms * 1_000_000
    file = tmp_path / "packets.bin"
    file.write_bytes(records.tobytes())
    seen = Echoes(np.array([1]), np.array([T0]), np.array([5_023.0]))
    extra = extra_delays_of(read_packets(file), seen)
    assert (list(extra.up_ms), list(extra.down_ms)) == ([4_980], [3])
