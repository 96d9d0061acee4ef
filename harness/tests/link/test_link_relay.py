# SPDX-License-Identifier: Apache-2.0
"""The relay between two real network namespaces. Accuracy has loose limits on medians because
the machine may be busy; docs/explanation/link.md lists measured values."""

import contextlib
import fcntl
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from link_parts import again_when_late, needs_relay
from waiting import in_background, until

from slambed.errors import ExitCode, SlambedError
from slambed.link.backend import open_link
from slambed.link.packets import PACKET_LOG, read_packets
from slambed.link.profile import parse_profile
from slambed.link.record import SERIES
from slambed.link.relay import RelayShaper
from slambed.link.scratch import two_namespaces
from slambed.link.session import DEVICE, LinkOptions, LinkSession
from slambed.link.traffic import TCPI_RTT_OFFSET, one_way, tcp_throughput_mbps
from slambed.native import find_program
from slambed.process.namespaces import inside

SIOCGIFMTU = 0x8921

pytestmark = needs_relay
Ends = tuple[Path, Path]


@pytest.fixture(name="ends")
def fresh_namespaces() -> Iterator[tuple[Path, Path]]:
    """Two network namespaces (mobile, edge)."""
    with two_namespaces() as paths:
        yield paths


def start(ends: Ends, log_dir: Path, profile: Any, seed: int = 1, **options: Any) -> LinkSession:
    link = open_link("relay", *ends, parse_profile(profile, "test"), seed, log_dir, **options)
    link.start(time.monotonic_ns())
    return link


def devices(namespace: Path) -> list[str]:
    return inside(namespace, lambda: [name for _, name in socket.if_nameindex()])


@pytest.mark.parametrize("rtt_ms", [pytest.param(0, marks=pytest.mark.nightly), 40])
@again_when_late
def test_a_constant_profile_is_delivered_and_proved(
    ends: Ends, tmp_path: Path, rtt_ms: int
) -> None:
    with start(ends, tmp_path, rtt_ms) as link:
        time.sleep(1.5)
        assert link.alive()
        record = link.stop()
    assert record.backend == "relay"
    assert record.proof.valid, record.proof.reason
    assert record.proof.error_ms_median < 1.0
    assert record.proof.measured_ms_mean >= rtt_ms
    assert record.drops == {"up": 0, "down": 0}
    assert set(record.frame["series"]) <= set(SERIES)
    applied = record.frame[record.frame["series"] == "applied_up_ms"]["value"]
    assert applied.median() == pytest.approx(rtt_ms / 2, abs=1.0)
    assert record.details.tcp["mobile"]["net/ipv4/tcp_congestion_control"] == "cubic"


@again_when_late
def test_a_ramp_is_followed(ends: Ends, tmp_path: Path) -> None:
    ramp = {"rtt_ms": {"ramp": {"to_ms": 85, "rise_s": 1, "fall_s": 1}}}
    with start(ends, tmp_path, ramp) as link:
        time.sleep(2.3)
        record = link.stop()
    assert record.proof.valid, record.proof.reason
    probe = record.frame[record.frame["series"] == "probe_rtt_ms"]
    assert probe["value"].max() > 70
    assert record.proof.asked_ms_mean == pytest.approx(probe["value"].mean(), abs=3)


@again_when_late
def test_before_its_start_the_link_stands_at_time_zero(ends: Ends, tmp_path: Path) -> None:
    falling = parse_profile({"rtt_ms": {"points": [[0, 60], [0.2, 0]]}}, "test")
    with open_link("relay", *ends, falling, 1, tmp_path, probe_hz=0) as link:
        before = one_way(*ends, "10.77.0.2", 50, 0.3)
        link.start(time.monotonic_ns())
        time.sleep(0.4)
        after = one_way(*ends, "10.77.0.2", 50, 0.3)
    assert np.nanmedian(before.delay_ms) == pytest.approx(30, abs=1)
    assert np.nanmedian(after.delay_ms) < 1


def test_packets_never_overtake_one_another(ends: Ends, tmp_path: Path) -> None:
    rough = {
        "rtt_ms": {"sine": {"mean_ms": 20, "amplitude_ms": 20, "period_s": 0.2}},
        "jitter": {"sd_ms": 3},
    }
    with start(ends, tmp_path, rough, probe_hz=0):
        samples = one_way(*ends, "10.77.0.2", 2000, 1.0)
    assert np.isfinite(samples.delay_ms).mean() > 0.99
    assert samples.reordered == 0
    assert np.nanmax(samples.delay_ms) - np.nanmin(samples.delay_ms) > 5


def lost_packets(ends: Ends, log_dir: Path, seed: int) -> list[int]:
    log_dir.mkdir(exist_ok=True)
    lossy = {"rtt_ms": 2, "loss": {"gilbert_elliott": {"to_bad": 0.05, "to_good": 0.3}}}
    with start(ends, log_dir, lossy, seed, probe_hz=0):
        samples = one_way(*ends, "10.77.0.2", 500, 0.8)
    return [int(n) for n in np.flatnonzero(np.isnan(samples.delay_ms))]


def test_same_seed_same_drops(ends: Ends, tmp_path: Path) -> None:
    first = lost_packets(ends, tmp_path, 5)
    assert 10 < len(first) < 200
    assert first == lost_packets(ends, tmp_path, 5)
    assert first != lost_packets(ends, tmp_path, 6)


@again_when_late
def test_tcp_knows_the_rtt_although_the_receiver_is_slow(ends: Ends, tmp_path: Path) -> None:
    """The ACK would come with the answer 35 ms later, and tcpi_rtt would be 55 ms."""
    with start(ends, tmp_path, 20, probe_hz=0):
        server = inside(ends[1], lambda: socket.create_server(("10.77.0.2", 4711)))
        client = inside(ends[0], lambda: socket.create_connection(("10.77.0.2", 4711), 5))
        peer, _ = server.accept()
        with server, client, peer:
            for each in (client, peer):
                each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for _ in range(25):
                client.sendall(bytes(64))
                peer.recv(64)
                time.sleep(0.035)
                peer.sendall(bytes(64))
                client.recv(64)
            info = client.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
    assert struct.unpack_from("=I", info, TCPI_RTT_OFFSET)[0] / 1e3 == pytest.approx(20, abs=8)


@again_when_late
def test_a_rate_limits_tcp_and_its_queue_is_logged(ends: Ends, tmp_path: Path) -> None:
    narrow = {"rtt_ms": 10, "rate": {"mbps": 8, "queue_bytes": 30000}}
    with start(ends, tmp_path, narrow) as link:
        mbps = tcp_throughput_mbps(*ends, "10.77.0.2", 2.0)
        record = link.stop()
    assert 5 < mbps < 8
    assert record.drops["up"] > 0
    queue = record.frame[record.frame["series"] == "queue_bytes_up"]["value"]
    assert 15000 < queue.max() <= 30000
    # Echoes wait in the same queue; the proof deducts that by the packet log and stays valid.
    assert record.proof.valid, record.proof.reason


@again_when_late
def test_a_gap_silences_the_link(ends: Ends, tmp_path: Path) -> None:
    silent = {"rtt_ms": 4, "gaps": [{"start_s": 0.4, "length_s": 0.5}]}
    with start(ends, tmp_path, silent) as link:
        time.sleep(1.5)
        record = link.stop()
    assert record.proof.valid, record.proof.reason
    probe = record.frame[record.frame["series"] == "probe_rtt_ms"]
    assert 300 < probe["value"].max() < 600


def test_nothing_is_left_behind(ends: Ends, tmp_path: Path) -> None:
    for _ in range(2):
        with start(ends, tmp_path, 0, probe_hz=0):
            assert DEVICE in devices(ends[0]) and DEVICE in devices(ends[1])
        assert devices(ends[0]) == devices(ends[1]) == ["lo"]


def test_a_link_that_dies_is_noticed_and_reported(ends: Ends, tmp_path: Path) -> None:
    with start(ends, tmp_path, 10) as link:
        shaper = link._shaper
        assert isinstance(shaper, RelayShaper)
        shaper._process.send_signal(signal.SIGKILL)
        shaper._process.wait()
        assert not link.alive()
        record = link.stop()
    assert record.died is not None and "signal 9" in record.died
    assert not record.proof.valid
    assert "the link went away" in record.proof.reason


def test_a_device_removed_in_mid_run_ends_the_relay_with_a_reason(
    ends: Ends, tmp_path: Path
) -> None:
    def delete_device() -> None:
        subprocess.run(["ip", "link", "del", DEVICE], check=True)

    with start(ends, tmp_path, 10, probe_hz=0) as link:
        inside(ends[1], delete_device)
        until(lambda: not link.alive(), "the end of the link", limit_s=5)
        why = link.stop().died
    assert why is not None and "a device of the link went away" in why and "edge side" in why


def test_a_packet_log_on_a_full_disk_is_an_error(ends: Ends, tmp_path: Path) -> None:
    (tmp_path / PACKET_LOG).symlink_to("/dev/full")
    link = start(ends, tmp_path, 0, probe_hz=50)
    time.sleep(0.2)
    with link, pytest.raises(SlambedError, match=r"No space left.*free space") as caught:
        link.stop()
    assert caught.value.code == ExitCode.ENVIRONMENT


def test_the_relay_ends_with_the_harness(ends: Ends, tmp_path: Path) -> None:
    script = f"""
import time
from pathlib import Path
from slambed.link.backend import open_link
from slambed.link.profile import parse_profile
ends = [Path({str(ends[0])!r}), Path({str(ends[1])!r})]
link = open_link("relay", *ends, parse_profile(5, "x"), 1, Path({str(tmp_path)!r}))
print(link._shaper._process.pid, flush=True)
time.sleep(60)
"""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    harness = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, env=environment
    )
    assert harness.stdout is not None
    with harness.stdout:
        relay = int(harness.stdout.readline())
        harness.kill()
        harness.wait()
    until(lambda: devices(ends[0]) == ["lo"], f"the end of relay {relay} with its harness", 5)


def test_two_nodes_in_one_namespace_are_refused(ends: Ends, tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="same network namespace"):
        open_link("relay", ends[0], ends[0], parse_profile(0, "test"), 1, tmp_path)


def test_a_namespace_that_is_not_there_is_named(ends: Ends, tmp_path: Path) -> None:
    with pytest.raises(SlambedError, match="/run/netns/nowhere") as caught:
        open_link("relay", "nowhere", ends[1], parse_profile(0, "test"), 1, tmp_path)
    assert caught.value.code == ExitCode.ENVIRONMENT


def run_relay(config: Path) -> subprocess.CompletedProcess[str]:
    program = find_program("slambed-relay")
    return subprocess.run(
        [program, "--config", config], capture_output=True, text=True, stdin=subprocess.DEVNULL
    )


def relay_config(ends: Ends, **changes: Any) -> dict[str, Any]:
    config: dict[str, Any] = {
        "format": "slambed-link",
        "version": 1,
        "mobile": {"namespace": str(ends[0]), "device": "slam0", "address": "10.77.0.1"},
        "edge": {"namespace": str(ends[1]), "device": "slam0", "address": "10.77.0.2"},
        "up": {"delay_us": [0]},
        "down": {"delay_us": [0]},
    }
    return {**config, **changes}


@pytest.mark.parametrize(
    ("changes", "code", "message"),
    [
        ({"up": {"delay_us": [-1]}}, 2, "negative delay"),
        ({"speed": 1}, 2, "unknown key 'speed'"),
        ({"edge": {"namespace": "/nowhere", "device": "x", "address": "1.2.3.4"}}, 3, "/nowhere"),
        ({"packet_log": "/nowhere/x"}, 3, "packet log"),
        ({"parent_pid": 4194304}, 4, "the harness is gone"),
    ],
)
def test_the_relay_itself_answers_mistakes_with_one_line(
    ends: Ends, tmp_path: Path, changes: dict[str, Any], code: int, message: str
) -> None:
    config = tmp_path / "relay.json"
    config.write_text(json.dumps(relay_config(ends, **changes)))
    result = run_relay(config)
    assert result.returncode == code, result.stderr
    (line,) = result.stderr.splitlines()
    assert line.startswith("error: ") and message in line


def test_a_start_file_reports_time_zero_too(ends: Ends, tmp_path: Path) -> None:
    start_file, log = tmp_path / "start.json", tmp_path / "packets.bin"
    config = tmp_path / "relay.json"
    options = {"start_file": str(start_file), "packet_log": str(log)}
    # No delay for 0.1 s, then 20 ms: time 0 is long past.
    delays = {"delay_us": [0] * 10 + [20000]}
    config.write_text(json.dumps(relay_config(ends, up=delays, down=delays, **options)))
    with subprocess.Popen(
        [find_program("slambed-relay"), "--config", config],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert json.loads(process.stdout.readline())["ready"]
        start_file.write_text(json.dumps({"t0_ns": time.monotonic_ns() - 10 * 10**9}))
        assert json.loads(process.stdout.readline())["started"]
        samples = one_way(*ends, "10.77.0.2", 50, 0.3)
        process.terminate()
        assert process.wait(5) == 0
    assert np.nanmedian(samples.delay_ms) == pytest.approx(20, abs=5)
    assert len(read_packets(log)) == 15


def mtu_of_the_device() -> int:
    """Asks the kernel for the MTU of the link's device in the namespace of this thread."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        request = struct.pack("16si20x", DEVICE.encode(), 0)
        return int(struct.unpack("16si20x", fcntl.ioctl(asking, SIOCGIFMTU, request))[1])


def test_options_reach_the_link(ends: Ends, tmp_path: Path) -> None:
    with start(ends, tmp_path, 0, probe_hz=0, mtu=1400, real_time=False) as link:
        assert link._options == LinkOptions(probe_hz=0, mtu=1400, real_time=False)
        assert [inside(end, mtu_of_the_device) for end in ends] == [1400, 1400]
        assert link.stop().details.real_time is False


def test_a_flood_does_not_deafen_the_relay(ends: Ends, tmp_path: Path) -> None:
    """Signals and commands are handled despite a constant stream of packets."""
    stopped = threading.Event()
    sender = inside(ends[0], lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))

    def flood() -> None:
        # Ends at the latest when the device is removed.
        with contextlib.suppress(OSError):
            while not stopped.is_set():
                sender.sendto(bytes(40), ("10.77.0.2", 9))

    with (
        open_link("relay", *ends, parse_profile(10, "test"), 1, tmp_path, probe_hz=0) as link,
        contextlib.closing(sender),
        in_background(flood, stopped),
        in_background(flood, stopped),
    ):
        link.start(time.monotonic_ns())
        time.sleep(0.5)
        asked = time.monotonic()
        record = link.stop()
        assert time.monotonic() - asked < 4.0
    assert record.details.relay.up.packets > 1000
