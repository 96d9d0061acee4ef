# SPDX-License-Identifier: Apache-2.0
"""Comparison of two machines' clocks, and the corrections based on it."""

import random

import pytest

from slambed.errors import PassingError
from slambed.link.clocks import MOST_RATE, ClockComparison, Clocks, Exchange, compare
from slambed.metrics.board_clock import on_one_clock
from slambed.metrics.events import EventLog

MS = 1_000_000
S = 1_000_000_000


def exchanges(
    offset_ns: int, up_ms: float, down_ms: float, drawn: random.Random, rate: float = 0.0
) -> list[Exchange]:
    """Forty exchanges, each way at least this long and often longer; the board's clock is
    `offset_ns` ahead at the first one, and gains."""
    found = []
    now = drawn.randrange(1 << 40)
    began = now
    for _ in range(40):
        sent = now
        arrived = sent + round(MS * (up_ms + drawn.expovariate(1 / (0.3 * up_ms))))
        answered = arrived + drawn.randrange(200_000)
        back = answered + round(MS * (down_ms + drawn.expovariate(1 / (0.3 * down_ms))))

        def there(here: int) -> int:
            return here + offset_ns + round((here - began) * rate)

        found.append(Exchange(sent, there(arrived), there(answered), back))
        now = back
    return found


@pytest.mark.parametrize("offset_ns", [0, 5_000 * S, -3 * MS, 17])
@pytest.mark.parametrize(("up_ms", "down_ms"), [(0.2, 0.2), (0.2, 20.0), (40.0, 1.0)])
def test_the_true_offset_is_within_the_error_however_unequal_the_ways_are(
    offset_ns: int, up_ms: float, down_ms: float
) -> None:
    for seed in range(50):
        found = compare(exchanges(offset_ns, up_ms, down_ms, random.Random(seed)), "udp")
        assert abs(found.offset_ns - offset_ns) <= found.error_ns
        assert found.exchanges == 40
        assert found.traveled_us_min >= 1e3 * (up_ms + down_ms)


def test_what_is_symmetric_is_known_far_better_than_the_error_says_and_what_is_not_is_not() -> None:
    even = compare(exchanges(7 * MS, 5.0, 5.0, random.Random(1)), "udp")
    uneven = compare(exchanges(7 * MS, 1.0, 9.0, random.Random(1)), "udp")
    assert abs(even.offset_ns - 7 * MS) < 0.2 * MS
    assert abs(uneven.offset_ns - 7 * MS) > 3.5 * MS
    # The bound does not know the asymmetry: it is half of the total delay in both cases.
    assert 5 * MS < even.error_ns < 6 * MS and 5 * MS < uneven.error_ns < 6 * MS


@pytest.mark.parametrize("rate", [MOST_RATE, -MOST_RATE, 5e-5])
def test_clocks_that_run_apart_meanwhile_are_still_within_the_error(rate: float) -> None:
    for seed in range(50):
        asked = exchanges(S, 0.05, 0.05, random.Random(seed), rate)
        found = compare(asked, "udp")
        middle = (asked[0].sent_ns + asked[-1].back_ns) // 2
        true_ns = S + (middle - asked[0].sent_ns) * rate
        assert abs(found.offset_ns - true_ns) <= found.error_ns


def test_a_clock_that_is_set_in_the_middle_is_no_measurement() -> None:
    first = exchanges(0, 1.0, 1.0, random.Random(1))[:20]
    later = exchanges(50 * MS, 1.0, 1.0, random.Random(1))[20:]
    with pytest.raises(PassingError, match="one of them was set"):
        compare([*first, *later], "udp")
    with pytest.raises(PassingError, match="no exchange came back"):
        compare([], "udp")


def comparison(at_s: float, offset_ns: int, error_ns: int = 1000) -> ClockComparison:
    return ClockComparison(
        at_ns=round(at_s * S),
        offset_ns=offset_ns,
        error_ns=error_ns,
        exchanges=40,
        traveled_us_min=2.0,
        over="udp",
    )


def drifting(gained_ns: int) -> Clocks:
    """Clocks compared at 100 s and 203 s, with run time 0 at 103 s."""
    ahead = 5_000 * S
    return Clocks(
        t0_ns=103 * S, before=comparison(100, ahead), after=comparison(203, ahead + gained_ns, 4000)
    )


def test_times_of_the_board_are_found_on_our_clock_in_spite_of_drift() -> None:
    clocks = drifting(gained_ns=103 * 50_000)  # 50 ppm
    assert clocks.drift_ppm == pytest.approx(50.0)
    assert clocks.error_ms == pytest.approx(0.004)
    for here_s in (100.0, 103.0, 150.5, 203.0):
        here_ns = round(here_s * S)
        board_ns = here_ns + 5_000 * S + round((here_s - 100) * 50_000)
        assert abs(clocks.here_ns(board_ns) - here_ns) <= 1


def test_a_run_that_never_ended_has_no_drift_and_the_first_error() -> None:
    clocks = Clocks(t0_ns=103 * S, before=comparison(100, 7, 2_000_000))
    assert clocks.drift_ppm == 0.0 and clocks.error_ms == 2.0
    assert clocks.here_ns(150 * S) == 150 * S - 7


def test_events_of_both_nodes_stand_on_one_clock() -> None:
    """A message each way with a delay of 10 ms, 50 s into a run in which the board's clock gains
    100 us per second."""
    rate = 1e-4
    clocks = drifting(gained_ns=round(103 * S * rate))
    gained = round(53 * S * rate)  # since the comparison at 100 s
    sent, received = 50 * S, 50 * S + 10 * MS
    up = {
        "node": "edge", "type": "message", "direction": "up", "t_ns": received,
        "queued_ns": sent + gained, "sent_ns": sent + gained, "received_ns": received,
    }  # fmt: skip
    down = {
        "node": "mobile", "type": "message", "direction": "down", "t_ns": received + gained,
        "queued_ns": sent, "sent_ns": sent, "received_ns": received + gained,
    }  # fmt: skip
    applied = {
        "node": "mobile", "type": "update_applied", "t_ns": received + gained,
        "t_me_ms": 10 - gained / MS, "t_em_ms": 10 + gained / MS, "t_lm_ms": 3.0,
        "t_total_ms": 23.0,
    }  # fmt: skip
    edge = {"node": "edge", "type": "keyframe_mapped", "t_ns": sent, "keyframe": 3}
    log = on_one_clock(EventLog([edge, up, down, applied]), clocks)
    slack_ns = MS * rate * 100  # clock gain over some ms
    for message in log.of("message"):
        assert message["received_ns"] - message["sent_ns"] == pytest.approx(10 * MS, abs=slack_ns)
        assert message["t_ns"] == pytest.approx(received, abs=slack_ns)
    (update,) = log.of("update_applied")
    assert update["t_me_ms"] == pytest.approx(10, abs=2e-3)
    assert update["t_em_ms"] == pytest.approx(10, abs=2e-3)
    assert (update["t_lm_ms"], update["t_total_ms"]) == (3.0, 23.0)
    assert log.of("keyframe_mapped") == [edge]
    times = [event["t_ns"] for event in log.events]
    assert times == sorted(times)
