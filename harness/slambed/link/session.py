# SPDX-License-Identifier: Apache-2.0
"""The lifecycle of a link: set up, base measured, profile applied, started, proved, removed."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from slambed.errors import PassingError, environment_error
from slambed.link.facts import LinkDetails
from slambed.link.namespaces import check_privilege, different, tune_tcp
from slambed.link.probe import Echoes, Probe, measure_base_ms
from slambed.link.profile import Profile
from slambed.link.proof import ExtraDelays, LinkTolerance, compare, judge
from slambed.link.record import ASKED_STEP_S, LinkRecord, series_frame
from slambed.link.route import acknowledge_at_once
from slambed.process.namespaces import namespace_path

MOBILE_ADDRESS, EDGE_ADDRESS, PREFIX_LENGTH = "10.77.0.1", "10.77.0.2", 30
NETWORK = "10.77.0.0/30"
DEVICE = "slam0"
"""Name of the device in both namespaces."""
DYING_S = 1.0
"""Longer than a killed process takes to disappear, even on a busy host."""

Series = Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]


@dataclass(frozen=True)
class LinkOptions:
    """Settings that do not change the meaning of the link."""

    horizon_s: float = 900.0
    """Maximum duration of the run; a profile that never settles is frozen afterwards."""
    probe_hz: float = 20.0
    """Rate of the proof's echoes; 0 disables the proof."""
    mtu: int = 1500
    tx_queue_packets: int = 10_000
    """Per device; the usual 500 or 1000 drops packets silently when a whole window is sent at
    once."""
    real_time: bool = True
    """Requests SCHED_FIFO; without permission the relay runs without it."""
    spin_us: float = 60.0
    """Relay: how long before a packet is due it wakes up and starts polling."""
    tolerance: LinkTolerance = field(default_factory=LinkTolerance)


@dataclass(frozen=True)
class ShaperReport:
    """Final report of a backend."""

    series: Series
    """applied_*, drops_*, queue_bytes_* over run time."""
    drops: dict[str, int]
    extra_delays_of: Callable[[Echoes], ExtraDelays]
    """Returns the backend's delay beyond the profile for each echo, if known."""
    late_ms: NDArray[np.float64] | None
    details: LinkDetails


class Shaper(Protocol):
    """A backend: devices in both namespaces, and delay, rate and loss of packets between them."""

    name: str

    def apply(self) -> None:
        """Applies the profile's value at time 0."""

    def start(self, t0_ns: int) -> None:
        """Sets run time 0 to `t0_ns` on CLOCK_MONOTONIC."""

    def died(self) -> str | None:
        """Returns why the link failed; None while it works."""

    def stop(self, t0_ns: int) -> ShaperReport:
        """Removes all devices and processes; reports on the run that began at t0."""

    def abort(self) -> None:
        """Removes all devices and processes; never raises."""


def _dies(shaper: Shaper) -> str | None:
    """Returns why the link is failing; None if it works. A killed relay removes its devices
    before its parent learns of its end, so this waits."""
    deadline = time.monotonic() + DYING_S
    while (died := shaper.died()) is None and time.monotonic() < deadline:
        time.sleep(0.01)
    return died


class LinkSession:
    """An open link, as a context manager; leaves no device, process or address behind."""

    def __init__(
        self,
        shaper: Callable[[Path, Path, Profile, int, Path, LinkOptions], Shaper],
        mobile_ns: str | Path,
        edge_ns: str | Path,
        profile: Profile,
        seed: int,
        log_dir: Path,
        options: LinkOptions,
    ) -> None:
        check_privilege("a link between two network namespaces")
        different(mobile_ns, edge_ns)
        self.profile = profile
        self._options = options
        self._mobile = namespace_path(mobile_ns)
        self._tcp = {"mobile": tune_tcp(mobile_ns), "edge": tune_tcp(edge_ns)}
        self._t0_ns: int | None = None
        self._record: LinkRecord | None = None
        self._probe: Probe | None = None
        self._shaper: Shaper | None = shaper(
            self._mobile, namespace_path(edge_ns), profile, seed, log_dir, options
        )
        self.backend = self._shaper.name
        try:
            for namespace, address in ((mobile_ns, MOBILE_ADDRESS), (edge_ns, EDGE_ADDRESS)):
                acknowledge_at_once(namespace_path(namespace), DEVICE, NETWORK, address)
            self.base_ms = measure_base_ms(self._mobile, EDGE_ADDRESS)
            if not np.isfinite(self.base_ms):
                raise environment_error(
                    f"no echo comes through the {self.backend} link, {mobile_ns} to {edge_ns}; "
                    "is a firewall in one of the namespaces?"
                )
            self._shaper.apply()
            if options.probe_hz > 0:
                # Opened while both nodes wait: one that crashes at once takes its namespace along.
                self._probe = Probe(self._mobile, EDGE_ADDRESS, options.probe_hz)
        except BaseException as error:
            is_explained = isinstance(error, PassingError) or not isinstance(error, Exception)
            died = None if is_explained else _dies(self._shaper)
            self.close()
            if died is not None:
                # The failed link explains any other error of the setup.
                raise PassingError(f"the link went away while it was set up: {died}") from error
            raise

    def start(self, t0_ns: int) -> None:
        """Sets run time 0 of the profile on CLOCK_MONOTONIC; it may be in the future."""
        assert self._shaper is not None, "the link is closed"
        self._t0_ns = t0_ns
        self._shaper.start(t0_ns)
        if self._probe is not None:
            self._probe.start()

    def alive(self) -> bool:
        """Returns False once the link has failed."""
        return self._shaper is not None and self._shaper.died() is None

    def stop(self) -> LinkRecord:
        """Takes the link down and returns its record. Calling it again returns the same record."""
        if self._record is None:
            self._record = self._finish()
        return self._record

    def _finish(self) -> LinkRecord:
        assert self._shaper is not None, "the link is closed"
        end_ns = time.monotonic_ns()
        t0_ns = self._t0_ns if self._t0_ns is not None else end_ns
        died = self._shaper.died()
        try:
            echoes = self._last_echoes(wait=died is None)
            report = self._shaper.stop(t0_ns)
        finally:
            self.close()
        extra = report.extra_delays_of(echoes)
        proof = judge(
            self.profile,
            echoes,
            t0_ns,
            end_ns,
            self.base_ms,
            self._options.probe_hz,
            self._options.tolerance,
            extra,
            report.late_ms,
            died,
        )
        seen = compare(self.profile, echoes, t0_ns, end_ns, self.base_ms, extra)
        asked_t = np.arange(0.0, max(0.0, (end_ns - t0_ns) / 1e9), ASKED_STEP_S)
        back = np.isfinite(echoes.rtt_ms)
        series = {
            "asked_rtt_ms": (asked_t, self.profile.rtt_series_ms(asked_t)),
            "probe_rtt_ms": ((echoes.sent_ns[back] - t0_ns) / 1e9, echoes.rtt_ms[back]),
            "probe_error_ms": (seen.sent_s[seen.usable], seen.error_ms),
            **report.series,
        }
        return LinkRecord(
            backend=self.backend,
            frame=series_frame(series),
            drops=report.drops,
            proof=proof,
            died=died,
            details=report.details.model_copy(update={"tcp": self._tcp, "base_ms": self.base_ms}),
        )

    def _last_echoes(self, wait: bool) -> Echoes:
        if self._probe is None:
            empty = np.array([], dtype=np.int64)
            return Echoes(empty, empty, np.array([], dtype=float))
        now_s = 0.0 if self._t0_ns is None else (time.monotonic_ns() - self._t0_ns) / 1e9
        longest_s = self.profile.rtt_ms(now_s) / 1e3 + 0.05
        probe, self._probe = self._probe, None
        return probe.stop(min(longest_s, 2.0) if wait else 0.0)

    def close(self) -> None:
        """Removes the link without a report; harmless after `stop`."""
        if self._probe is not None:
            self._probe.stop(0.0)
            self._probe = None
        if self._shaper is not None:
            self._shaper.abort()
            self._shaper = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
