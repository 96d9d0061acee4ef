# SPDX-License-Identifier: Apache-2.0
"""Time-based bursts on backend netem: the same chain as relay and simulation, switched on time."""

import struct
from pathlib import Path

import pytest

from slambed.link import netem
from slambed.link.bursts import Bursts, all_or_none
from slambed.link.impairments import GilbertElliott
from slambed.link.netem import NetemShaper, why_not_netem
from slambed.link.netlink import NetemSettings
from slambed.link.profile import parse_profile
from slambed.link.session import LinkOptions

CHAIN = GilbertElliott(good_s=2, bad_s=0.2)
TURNS_NS = {
    0: [80247019, 180761820, 1320400379, 1457263917, 1673072515, 1851620767],
    1: [889268368, 1483319504, 4201529243, 4355098889, 6842238566, 7003469677],
}
"""For seed 3, starting in the good state. BurstsInTimeAreThoseOfTheHarness (systems/core/link)
has the same numbers."""


@pytest.mark.parametrize("direction", TURNS_NS)
def test_the_chain_turns_when_the_relays_does(direction: int) -> None:
    bursts, lost = Bursts(CHAIN, 3, direction), False
    for turn_ns in TURNS_NS[direction]:
        assert round(bursts.turns_s * 1e9) == turn_ns
        assert bursts.lost_at(turn_ns / 1e9 - 1e-8) is lost
        lost = not lost
        assert bursts.lost_at(turn_ns / 1e9 + 1e-8) is lost


def test_there_is_no_burst_before_the_run() -> None:
    bursts = Bursts(GilbertElliott(good_s=1e-4, bad_s=1e6), 1, 0)
    assert not bursts.lost_at(-1.0)
    assert bursts.lost_at(0.01)


def test_the_share_of_time_and_the_length_are_those_asked_for() -> None:
    bursts, end_s = Bursts(CHAIN, 7, 0), 4000.0
    lost_s, count, at_s = 0.0, 0, 0.0
    while at_s < end_s:
        lost = bursts.lost_at(at_s)
        count += lost
        lost_s += lost * (bursts.turns_s - at_s)
        at_s = bursts.turns_s + 1e-9
    assert lost_s / count == pytest.approx(0.2, rel=3 / 1800**0.5)
    assert lost_s / at_s == pytest.approx(0.2 / 2.2, rel=3 * (2 / 1800) ** 0.5)


@pytest.mark.parametrize(
    ("chain", "netem_can"),
    [
        ({"good_s": 5, "bad_s": 0.1}, True),
        ({"good_s": 5, "bad_s": 0.1, "loss_good": 1, "loss_bad": 0}, True),
        ({"good_s": 5, "bad_s": 0.1, "loss_bad": 0.5}, False),
        ({"to_bad": 0.01, "to_good": 0.3}, False),
    ],
)
def test_netem_takes_bursts_that_need_no_random_number(
    chain: dict[str, float], netem_can: bool
) -> None:
    profile = parse_profile({"rtt_ms": 5, "loss": {"gilbert_elliott": chain}}, "test")
    assert (all_or_none(profile.up) is not None) is netem_can
    assert (why_not_netem(profile) is None) is netem_can


def test_in_a_burst_the_kernel_is_set_to_lose_all() -> None:
    options = NetemSettings(5.0, 77, 10**9, lost=True).options()
    assert struct.unpack_from("=6I", options) == (0, 77, 0xFFFFFFFF, 0, 0, 0)


class SimulatedTime:
    """A clock for netem's thread that advances only in its waits; ends after some seconds."""

    def __init__(self, end_s: float) -> None:
        self.now_ns, self._end_ns = 10**9, 10**9 + round(end_s * 1e9)

    def monotonic_ns(self) -> int:
        return self.now_ns

    def monotonic(self) -> float:
        return self.now_ns / 1e9

    def wait(self, seconds: float) -> None:
        # A thread wakes up late, but never early.
        self.now_ns += round(seconds * 1e9) + 50_000

    def is_set(self) -> bool:
        return self.now_ns >= self._end_ns

    def set(self) -> None: ...


class RecordingEnd:
    """Records the settings of one device's netem with their times."""

    def __init__(self, clock: SimulatedTime) -> None:
        self.reported: list[tuple[int, NetemSettings]] = []
        self._clock = clock

    def set(self, settings: NetemSettings, create: bool = False) -> None:
        self.reported.append((self._clock.now_ns, settings))

    def close(self) -> None: ...

    def turns_s(self, t0_ns: int) -> list[float]:
        """Returns the times at which loss was switched on or off."""
        steps = zip(self.reported, self.reported[1:], strict=False)
        return [(at - t0_ns) / 1e9 for (_, old), (at, new) in steps if new.lost != old.lost]


class NoPair:
    def __init__(self, *_: object) -> None: ...

    def remove(self) -> None: ...


@pytest.mark.parametrize("rtt", [40, {"ramp": {"to_ms": 80, "rise_s": 0.2, "fall_s": 0.2}}])
def test_losses_are_switched_at_the_chains_times(
    rtt: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A constant profile is followed only for its bursts, which also continue after a ramp."""
    clock = SimulatedTime(30.0)
    ends: list[RecordingEnd] = []

    def end(*_: object) -> RecordingEnd:
        ends.append(RecordingEnd(clock))
        return ends[-1]

    monkeypatch.setattr(netem, "time", clock)
    monkeypatch.setattr(netem, "VethPair", NoPair)
    monkeypatch.setattr(netem, "NetemControl", end)
    monkeypatch.setattr(netem, "_dropped", lambda _: 0)
    chain = GilbertElliott(good_s=1, bad_s=0.3)
    loss = {"gilbert_elliott": chain.model_dump(exclude_none=True)}
    profile = parse_profile({"rtt_ms": rtt, "loss": loss}, "test")
    shaper = NetemShaper(tmp_path, tmp_path, profile, 3, tmp_path, LinkOptions(real_time=False))
    monkeypatch.setattr(shaper, "_stopped", clock)
    shaper.apply()
    assert not any(settings.lost for each in ends for _, settings in each.reported)
    t0_ns = clock.now_ns
    shaper._follow(t0_ns)
    outcome = shaper.stop(t0_ns)
    for direction, each in enumerate(ends):
        bursts, wanted = Bursts(chain, 3, direction), []
        while bursts.turns_s < 29.9:
            wanted.append(bursts.turns_s)
            bursts.lost_at(bursts.turns_s + 1e-9)
        assert len(wanted) > 20
        assert each.turns_s(t0_ns)[: len(wanted)] == pytest.approx(wanted, abs=2e-4)
        at_s, lost = outcome.series["lost_up" if direction == 0 else "lost_down"]
        assert set(lost) == {0.0, 1.0} and at_s[-1] > 28
    changes = len(ends[0].reported)
    assert changes < 200 if rtt == 40 else changes > 100
    assert outcome.details.longest_step_ms is None or outcome.details.longest_step_ms < 11
