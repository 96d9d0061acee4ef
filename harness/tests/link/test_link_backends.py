# SPDX-License-Identifier: Apache-2.0
"""Backend choice, the plain pair, and netem if the kernel has it (or `make test-netem`)."""

import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from link_parts import again_when_late, needs_root
from waiting import until

from slambed.errors import ExitCode, SlambedError
from slambed.link import netem
from slambed.link.backend import open_link
from slambed.link.bursts import Bursts
from slambed.link.choice import choose_backend
from slambed.link.impairments import GilbertElliott
from slambed.link.netem import netem_available, why_not_netem
from slambed.link.netlink import NetemSettings
from slambed.link.profile import Profile, parse_profile
from slambed.link.record import LinkRecord
from slambed.link.scratch import two_namespaces
from slambed.link.session import LinkOptions
from slambed.link.traffic import TcpRttProbe, one_way
from slambed.process.namespaces import inside

Ends = tuple[Path, Path]


@pytest.fixture(name="ends")
def fresh_namespaces() -> Iterator[tuple[Path, Path]]:
    """Two network namespaces (mobile, edge)."""
    with two_namespaces() as paths:
        yield paths


PURE = parse_profile("ramp", "test")
LOSSY = parse_profile({"rtt_ms": 5, "loss": {"random": 0.1}}, "test")
JITTERY = parse_profile({"rtt_ms": 5, "jitter": {"sd_ms": 1}}, "test")


@pytest.mark.parametrize(
    ("profile", "has_netem", "chosen"),
    [
        (PURE, True, "netem"),
        (PURE, False, "relay"),
        (LOSSY, True, "relay"),
        (LOSSY, False, "relay"),
    ],
)
def test_auto_takes_netem_unless_chance_must_be_seeded(
    monkeypatch: pytest.MonkeyPatch, profile: object, has_netem: bool, chosen: str
) -> None:
    monkeypatch.setattr(netem, "netem_available", lambda: has_netem)
    assert choose_backend("auto", profile) == chosen  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("backend", "profile", "message"),
    [
        ("netem", LOSSY, "backend netem cannot do.*its losses have no seed"),
        ("netem", JITTERY, "backend netem cannot do.*its jitter has no seed; use backend relay"),
        ("none", PURE, "backend none adds nothing"),
        ("nettem", PURE, "unknown link backend 'nettem'"),
    ],
)
def test_a_backend_that_cannot_do_the_profile_is_refused(
    backend: str, profile: object, message: str
) -> None:
    with pytest.raises(SlambedError, match=message):
        choose_backend(backend, profile)  # type: ignore[arg-type]


def test_what_netem_cannot_do_is_known() -> None:
    assert why_not_netem(PURE) is None
    assert why_not_netem(parse_profile({"rtt_ms": 5, "rate": {"mbps": 9}}, "test")) is None
    for keys in (
        {"jitter": {"sd_ms": 1}},
        {"gaps": [{"start_s": 1, "length_s": 1}]},
    ):
        assert why_not_netem(parse_profile({"rtt_ms": 5, **keys}, "test"))


def test_netem_is_given_nanoseconds_limit_and_rate() -> None:
    options = NetemSettings(delay_ms=12.5, limit_packets=77, rate_bytes_per_s=10**10).options()
    assert struct.unpack_from("=6I", options) == (0, 77, 0, 0, 0, 0)
    found = {}
    place = 24
    while place < len(options):
        size, kind = struct.unpack_from("=HH", options, place)
        found[kind] = options[place + 4 : place + size]
        place += size + -size % 4
    assert struct.unpack("=q", found[10]) == (12_500_000,)
    assert struct.unpack("=Q", found[8]) == (10**10,)
    # The rate counts IP packets, without the header of Ethernet.
    assert struct.unpack("=IiIi", found[6]) == (0xFFFFFFFF, -14, 0, 0)


class RecordingEnd:
    """Stands in for the netem of one device."""

    def __init__(self, namespace: Path, device: str) -> None:
        self.delays_ms: list[float] = []

    def set(self, settings: NetemSettings, create: bool = False) -> None:
        self.delays_ms.append(settings.delay_ms)

    def close(self) -> None: ...


class NoPair:
    def __init__(self, mobile: Path, edge: Path, options: LinkOptions) -> None: ...

    def remove(self) -> None: ...


def test_netem_follows_the_curves_beyond_the_duration(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """`duration_s` is of lists and plots, and the relay follows them too."""
    ends: list[RecordingEnd] = []

    def end(namespace: Path, device: str) -> RecordingEnd:
        ends.append(RecordingEnd(namespace, device))
        return ends[-1]

    monkeypatch.setattr(netem, "VethPair", NoPair)
    monkeypatch.setattr(netem, "NetemControl", end)
    rising = {"rtt_ms": {"points": [[0, 10], [0.2, 50]]}, "duration_s": 0.05}
    options = LinkOptions(real_time=False)
    shaper = netem.NetemShaper(
        tmp_path, tmp_path, parse_profile(rising, "test"), 1, tmp_path, options
    )
    shaper.apply()
    shaper.start(time.monotonic_ns())
    until(lambda: ends[0].delays_ms[-1] == 25.0, "the end of the curve")
    shaper.abort()
    assert ends[1].delays_ms[:2] == [0.0, 5.0] and ends[1].delays_ms[-1] == 25.0


def proved(backend: str, ends: Ends, profile: Profile, log_dir: Path, seconds: float) -> LinkRecord:
    """Returns the record of a link after some seconds."""
    with open_link(backend, *ends, profile, 1, log_dir) as link:
        link.start(time.monotonic_ns())
        time.sleep(seconds)
        return link.stop()


def measured_ms(record: LinkRecord) -> float:
    return float(record.frame[record.frame["series"] == "probe_rtt_ms"]["value"].median())


@needs_root
@again_when_late
def test_the_plain_pair_adds_nothing(ends: Ends, tmp_path: Path) -> None:
    record = proved("none", ends, parse_profile("none", "test"), tmp_path, 1.0)
    assert record.proof.valid, record.proof.reason
    assert measured_ms(record) < 1.0
    assert inside(ends[0], lambda: [name for _, name in socket.if_nameindex()]) == ["lo"]


@needs_root
@pytest.mark.skipif(netem_available(), reason="this kernel has netem")
def test_without_netem_one_line_says_so(ends: Ends, tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match=r"no netem.*relay") as caught:
        open_link("netem", *ends, PURE, 1, tmp_path)
    assert caught.value.code == ExitCode.ENVIRONMENT
    assert inside(ends[0], lambda: [name for _, name in socket.if_nameindex()]) == ["lo"]


@needs_root
@pytest.mark.skipif(not netem_available(), reason="this kernel has no netem: make test-netem")
class TestNetem:
    """The kernel's emulation, judged by medians: a late wake-up of this machine is not netem's
    error."""

    @again_when_late
    def test_a_constant_profile_is_delivered_and_proved(self, ends: Ends, tmp_path: Path) -> None:
        record = proved("netem", ends, parse_profile(40, "test"), tmp_path, 2.0)
        assert record.backend == "netem"
        assert record.proof.valid, record.proof.reason
        assert measured_ms(record) == pytest.approx(40.5, abs=1.0)

    @again_when_late
    def test_a_ramp_is_followed_and_logged(self, ends: Ends, tmp_path: Path) -> None:
        ramp = parse_profile({"rtt_ms": {"ramp": {"to_ms": 85, "rise_s": 2, "fall_s": 2}}}, "test")
        record = proved("netem", ends, ramp, tmp_path, 4.5)
        applied = record.frame[record.frame["series"] == "applied_up_ms"]
        assert applied["value"].max() > 40
        wanted = ramp.up_ms(applied["t_s"].to_numpy())
        assert np.median(np.abs(applied["value"] - wanted)) < 0.5
        assert record.proof.error_ms_median < 2.0

    def test_packets_keep_their_order_when_the_delay_falls(
        self,
        ends: Ends,
        tmp_path: Path,
    ) -> None:
        falling = parse_profile(
            {"rtt_ms": {"repeat": {"period_s": 0.2, "of": {"points": [[0, 60], [0.2, 0]]}}}}, "test"
        )
        with open_link("netem", *ends, falling, 1, tmp_path, probe_hz=0) as link:
            link.start(time.monotonic_ns())
            samples = one_way(*ends, "10.77.0.2", 1000, 1.0)
        assert samples.reordered == 0
        assert np.isfinite(samples.delay_ms).mean() > 0.99

    @again_when_late
    def test_bursts_lose_what_comes_in_them_and_nothing_else(
        self, ends: Ends, tmp_path: Path
    ) -> None:
        chain = GilbertElliott(good_s=0.4, bad_s=0.15)
        loss = {"gilbert_elliott": chain.model_dump(exclude_none=True)}
        profile = parse_profile({"rtt_ms": 10, "up": {"loss": loss}}, "test")
        with open_link("netem", *ends, profile, 3, tmp_path, probe_hz=0) as link:
            t0_ns = time.monotonic_ns()
            link.start(t0_ns)
            samples = one_way(*ends, "10.77.0.2", 500, 3.0)
        bursts, wanted, near = Bursts(chain, 3, 0), [], []
        for at_s in (samples.sent_ns - t0_ns) / 1e9:
            wanted.append(bursts.lost_at(at_s))
            near.append(bursts.turns_s - at_s < 0.02)
        apart = ~np.array(near)
        agree = np.isnan(samples.delay_ms) == np.array(wanted)
        assert 0.05 < np.mean(wanted) < 0.8
        assert agree[apart].mean() > 0.95

    @again_when_late
    def test_a_rate_counts_ip_packets_as_the_relay_does(self, ends: Ends, tmp_path: Path) -> None:
        packet_bytes = 64 + 8 + 20
        narrow = {"rtt_ms": 0, "rate": {"mbps": packet_bytes * 8 / 5e-3 / 1e6}}
        profile = parse_profile(narrow, "test")
        with open_link("netem", *ends, profile, 1, tmp_path, probe_hz=0) as link:
            link.start(time.monotonic_ns())
            # 30 packets: more of them would fill the queue, which holds 0.2 s.
            samples = one_way(*ends, "10.77.0.2", 1000, 0.03)
        arrived_ms = samples.sent_ns / 1e6 + samples.delay_ms
        # 5 ms each; with the Ethernet header it would be 5.76 ms.
        assert np.median(np.diff(arrived_ms)) == pytest.approx(5.0, abs=0.3)

    @again_when_late
    def test_tcp_sees_the_delay(self, ends: Ends, tmp_path: Path) -> None:
        with open_link("netem", *ends, parse_profile(60, "test"), 1, tmp_path) as link:
            link.start(time.monotonic_ns())
            with TcpRttProbe(*ends, "10.77.0.2") as follower:
                time.sleep(1.5)
        rtt_ms = np.median([rtt_ms for _, rtt_ms in follower.samples])
        assert rtt_ms == pytest.approx(60.5, abs=5)
