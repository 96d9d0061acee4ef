# SPDX-License-Identifier: Apache-2.0
"""Backend relay: drives slambed-relay, the user-space link (systems/apps/relay)."""

import contextlib
import json
import os
import signal
import subprocess
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from slambed.errors import ExitCode, KilledError, PassingError, SlambedError
from slambed.link.direction import RelayConfig, RelayEnd
from slambed.link.direction_tables import STEP_MS, delay_table_ms, direction_config
from slambed.link.facts import LinkDetails, RelaySummary
from slambed.link.packets import ICMP, PACKET_LOG, SIDES, delivered, lateness_ms, read_packets
from slambed.link.probe import Echoes
from slambed.link.profile import Profile
from slambed.link.proof import ExtraDelays
from slambed.link.session import (
    DEVICE,
    EDGE_ADDRESS,
    MOBILE_ADDRESS,
    PREFIX_LENGTH,
    LinkOptions,
    Series,
    ShaperReport,
)
from slambed.native import find_program
from slambed.process.endings import ended_from_outside, ending
from slambed.process.line_protocol import LineReader, Message, adapter, message_in

READY_TIMEOUT_S = 10.0
STOP_TIMEOUT_S = 5.0
FIFO_PRIORITY = 20
"""Above ordinary processes, below the kernel's own threads (50)."""
BIN_S = 0.05
MATCH_NS = 2_000_000_000
"""Maximum time difference between a record and the echo with the same sequence number."""
MATCH_BACK_NS = 300_000_000_000
"""The same for an echo on its way back, which a queue on its way up may have delayed. Its number
comes again after 54 minutes."""


class RelayReady(Message):
    """slambed-relay has created its devices; no impairment is applied yet."""

    ready: Literal[True]
    """Always true."""
    pid: int
    """Process id of slambed-relay."""
    real_time: bool
    """Whether it got real-time priority."""


class RelayApplied(Message):
    """Answer to `apply`: the profile's value at time 0 is in force."""

    applied: Literal[True]
    """Always true."""


class RelayStarted(Message):
    """Answer to `start N`: run time 0 is N on CLOCK_MONOTONIC."""

    started: Literal[True]
    """Always true."""
    t0_ns: int
    """N of the request."""


A = TypeVar("A", bound=Message)


def relay_config(
    mobile: Path, edge: Path, profile: Profile, seed: int, log_dir: Path, options: LinkOptions
) -> RelayConfig:
    """Returns the configuration of slambed-relay."""
    up_ms, down_ms = delay_table_ms(profile, options.horizon_s)
    return RelayConfig(
        format="slambed-link",
        version=1,
        mobile=RelayEnd(namespace=str(mobile), device=DEVICE, address=MOBILE_ADDRESS),
        edge=RelayEnd(namespace=str(edge), device=DEVICE, address=EDGE_ADDRESS),
        prefix_length=PREFIX_LENGTH,
        mtu=options.mtu,
        tx_queue_packets=options.tx_queue_packets,
        seed=seed,
        step_ms=STEP_MS,
        interpolation="linear",
        up=direction_config(profile, profile.up, up_ms, options.horizon_s),
        down=direction_config(profile, profile.down, down_ms, options.horizon_s),
        spin_us=options.spin_us,
        fifo_priority=FIFO_PRIORITY if options.real_time else 0,
        parent_pid=os.getpid(),
        packet_log=str(log_dir / PACKET_LOG),
        summary=str(log_dir / "relay_summary.json"),
    )


class RelayShaper:
    """A running slambed-relay."""

    name = "relay"

    def __init__(
        self, mobile: Path, edge: Path, profile: Profile, seed: int, log_dir: Path, o: LinkOptions
    ) -> None:
        program = find_program("slambed-relay")
        # Absolute, so that the program finds the files from any working directory.
        self._log_dir = log_dir.resolve()
        self._log_dir.mkdir(parents=True, exist_ok=True)
        config = self._log_dir / "relay.json"
        config.write_text(
            json.dumps(relay_config(mobile, edge, profile, seed, self._log_dir, o).as_json()),
            encoding="utf-8",
        )
        self._errors = self._log_dir / "relay_errors.txt"
        with self._errors.open("wb") as errors:
            self._process = subprocess.Popen(
                [program, "--config", config],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
            )
        try:
            assert self._process.stdout is not None
            self._answers = LineReader(self._process.stdout.fileno())
            self._ready = self._answer(RelayReady, "ready")
        except BaseException:
            self.abort()
            raise

    def apply(self) -> None:
        """Applies the profile's value at time 0."""
        self._command("apply")
        self._answer(RelayApplied, "applied")

    def start(self, t0_ns: int) -> None:
        """Sets run time 0 to `t0_ns` on CLOCK_MONOTONIC."""
        self._command(f"start {t0_ns}")
        self._answer(RelayStarted, "started")

    def died(self) -> str | None:
        """Returns the program's last error line once it has ended; None while it runs."""
        code = self._process.poll()
        return None if code is None else self._last_words(code)

    def stop(self, t0_ns: int) -> ShaperReport:
        """Ends the program and reads its log. Raises if the program could not write its log."""
        worked = self.died() is None
        self._end()
        if worked and self._process.returncode == ExitCode.ENVIRONMENT:
            raise self._failure()
        packets = read_packets(self._log_dir / PACKET_LOG)
        summary = RelaySummary.read(self._log_dir / "relay_summary.json") or RelaySummary()
        kernel = summary.kernel_drops
        during = packets[packets["in_ns"] >= t0_ns]
        return ShaperReport(
            series=_series(during, t0_ns),
            drops={side: _dropped(during, number) for number, side in enumerate(SIDES)},
            extra_delays_of=lambda echoes: extra_delays_of(packets, echoes),
            late_ms=lateness_ms(during),
            details=LinkDetails(
                real_time=self._ready.real_time,
                kernel_drops=0 if kernel is None else sum(vars(kernel).values()),
                relay=summary,
                carried_bytes={side: _carried(during, n) for n, side in enumerate(SIDES)},
            ),
        )

    def abort(self) -> None:
        """Ends the program."""
        self._end()

    def _end(self) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                # Closing flushes a pending command, which fails if the program has ended.
                with contextlib.suppress(OSError):
                    stream.close()

    def _command(self, command: str) -> None:
        stream = self._process.stdin
        assert stream is not None
        try:
            stream.write(command.encode() + b"\n")
            stream.flush()
        except OSError:
            raise self._failure() from None

    def _answer(self, kind: type[A], what: str) -> A:
        try:
            line = self._answers.next(READY_TIMEOUT_S)
        except EOFError:
            raise self._failure() from None
        if line is None:
            raise PassingError(
                f"slambed-relay did not answer '{what}' within {READY_TIMEOUT_S:.0f} s"
            )
        answer: A = message_in(line, adapter(kind), "relay")
        return answer

    def _failure(self) -> SlambedError:
        code = self._process.wait(STOP_TIMEOUT_S)
        words = self._last_words(code)
        if ended_from_outside(code):
            return KilledError(f"{words}: somebody killed it")
        known = code in (ExitCode.BAD_INPUT, ExitCode.ENVIRONMENT)
        return SlambedError(words, ExitCode(code) if known else ExitCode.INTERNAL)

    def _last_words(self, code: int) -> str:
        lines = self._errors.read_text("utf-8", errors="replace").strip().splitlines()
        return (
            lines[-1].removeprefix("error: ") if lines else f"slambed-relay ended, {ending(code)}"
        )


def _series(packets: pd.DataFrame, t0_ns: int) -> Series:
    """Bins the packet log: median delay, maximum queue, cumulative drops."""
    series: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
    for number, side in enumerate(SIDES):
        own = packets[packets["direction"] == number]
        t_s = (own["in_ns"] - t0_ns) / 1e9
        arrived = delivered(packets, number)
        arrived_s = (arrived["in_ns"] - t0_ns) / 1e9
        delay_ms = (arrived["out_ns"] - arrived["in_ns"]) / 1e6
        binned = delay_ms.groupby(np.floor(arrived_s / BIN_S)).median()
        series[f"applied_{side}_ms"] = _centers(binned)
        if (own["queue_bytes"] > 0).any():
            queue = own["queue_bytes"].astype(float).groupby(np.floor(t_s / BIN_S)).max()
            series[f"queue_bytes_{side}"] = _centers(queue)
        dropped_s = t_s[own["fate"] != 0].to_numpy()
        series[f"drops_{side}"] = (dropped_s, np.arange(1.0, len(dropped_s) + 1))
    return series


def _centers(binned: pd.Series) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return (binned.index.to_numpy(dtype=float) + 0.5) * BIN_S, binned.to_numpy(dtype=float)


def _dropped(packets: pd.DataFrame, direction: int) -> int:
    return int(((packets["direction"] == direction) & (packets["fate"] != 0)).sum())


def _carried(packets: pd.DataFrame, direction: int) -> int:
    """Returns the bytes of the nodes' own delivered packets, including IP headers and ACKs."""
    arrived = delivered(packets, direction)
    return int(arrived.loc[arrived["protocol"] != ICMP, "bytes"].sum())


def extra_delays_of(packets: pd.DataFrame, echoes: Echoes) -> ExtraDelays:
    """Returns the relay's delay beyond the profile for each echo: rate, jitter and gaps."""
    pings = packets[(packets["protocol"] == ICMP) & (packets["fate"] == 0)]
    ways = []
    for direction in range(len(SIDES)):
        own = pings[pings["direction"] == direction]
        wait_ms = (own["due_ns"] - own["in_ns"] - own["profile_ns"]).to_numpy() / 1e6
        tags, times = own["tag"].to_numpy(), own["in_ns"].to_numpy()
        places: dict[int, list[int]] = {}
        for place, tag in enumerate(tags):
            places.setdefault(int(tag), []).append(place)
        found = np.zeros(len(echoes))
        for index, (tag, sent) in enumerate(zip(echoes.sequence, echoes.sent_ns, strict=True)):
            own_records = places.get(int(tag), [])
            if direction == 0:
                near = [p for p in own_records if abs(times[p] - sent) < MATCH_NS]
            else:  # it turns when the way up is done, which a queue there may delay
                near = [p for p in own_records if 0 <= times[p] - sent < MATCH_BACK_NS]
            if near:
                found[index] = wait_ms[min(near, key=lambda p: abs(times[p] - sent))]
        ways.append(found)
    return ExtraDelays(up_ms=ways[0], down_ms=ways[1])
