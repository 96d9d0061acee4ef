# SPDX-License-Identifier: Apache-2.0
"""The RTT proof tolerates a clock change during a run: kernel timestamps use the time of day,
run time does not."""

import time

import pytest

from slambed.link.probe import ECHO_REPLY, HEADER, PAYLOAD, Pinger

START_NS, MS = 10**18, 1_000_000
IP_HEADER = bytes([0x45]) + bytes(19)


class Clocks:
    """Both clocks of a machine whose time of day may change."""

    def __init__(self) -> None:
        self.now_ns = 5_000 * MS
        self.set_by_ns = 0

    def read(self, clock: int) -> int:
        real = START_NS + self.set_by_ns if clock == time.CLOCK_REALTIME else 0
        return self.now_ns + real


class Silent:
    """A socket that accepts everything."""

    def sendto(self, packet: bytes, target: tuple[str, int]) -> None: ...

    def close(self) -> None: ...


@pytest.mark.parametrize("hours", [-1, 0, 1])
def test_a_clock_that_is_set_changes_no_echo(hours: int, monkeypatch: pytest.MonkeyPatch) -> None:
    clocks = Clocks()
    monkeypatch.setattr("slambed.link.probe.time.clock_gettime_ns", clocks.read)
    monkeypatch.setattr("slambed.link.probe.inside", lambda *_: Silent())
    pinger = Pinger("here", "10.0.0.1")
    began_ns = clocks.now_ns
    for number in range(10):
        pinger.send()
        pinger._kernel_sent[number] = clocks.read(time.CLOCK_REALTIME)
        if number == 5:  # while an echo is in flight
            clocks.set_by_ns = hours * 3600 * 10**9
        clocks.now_ns += 20 * MS
        reply = HEADER.pack(ECHO_REPLY, 0, 0, pinger._identifier, number + 1) + PAYLOAD
        pinger._take_reply(IP_HEADER + reply, clocks.read(time.CLOCK_REALTIME))
        clocks.now_ns += 30 * MS
    echoes = pinger.echoes()
    assert echoes.rtt_ms == pytest.approx([20.0] * 10)
    assert list(echoes.sent_ns - began_ns) == [50 * MS * n for n in range(10)]
