# SPDX-License-Identifier: Apache-2.0
"""Backend netem: a veth pair with the kernel's netem on both ends."""

import contextlib
import functools
import math
import os
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from pyroute2.netlink.exceptions import NetlinkError

from slambed.errors import SlambedError
from slambed.link.bursts import Bursts, all_or_none
from slambed.link.direction_tables import queue_bytes
from slambed.link.facts import LinkDetails
from slambed.link.impairments import Side
from slambed.link.namespaces import by_netlink
from slambed.link.netlink import NetemControl, NetemSettings, kernel_has_netem
from slambed.link.profile import CHECK_FOREVER_S, Profile
from slambed.link.proof import ExtraDelays
from slambed.link.session import DEVICE, LinkOptions, ShaperReport
from slambed.link.veth import VethPair

STEP_S = 0.01
UNLIMITED_BYTES_PER_S = 12_500_000_000
"""100 Gbit/s: 0.12 us per packet, far below the measurement error."""
LIMIT_PACKETS = 100_000
"""Covers the largest delay times the highest rate in use: 1 Gbit/s for 1 s is 83,000 packets of
1,500 bytes."""
PACKET_BYTES = 1500
FIFO_PRIORITY = 20


@functools.cache
def netem_available() -> bool:
    """Returns whether this kernel has sch_netem and we may use it."""
    return kernel_has_netem()


def why_not_netem(profile: Profile) -> str | None:
    """Returns why netem cannot implement the profile; None if it can. Time-based bursts that
    lose all packets are possible by switching the loss on and off, without random numbers."""
    for side in (profile.up, profile.down):
        if side.jitter:
            return "its jitter has no seed; use backend relay"
        if side.loss and not all_or_none(side):
            return "its losses have no seed; use backend relay"
        if side.rate and side.rate.trace:
            return "it has no rate traces; use backend relay"
    return "it has no outages (gaps); use backend relay" if profile.gaps else None


class NetemShaper:
    """Netem on both ends, each delaying its outgoing packets."""

    name = "netem"

    def __init__(
        self, mobile: Path, edge: Path, profile: Profile, seed: int, log_dir: Path, o: LinkOptions
    ) -> None:
        self._profile = profile
        self._rates = [_bytes_per_s(side) for side in (profile.up, profile.down)]
        self._limits = _limits(profile)
        chains = [all_or_none(side) for side in (profile.up, profile.down)]
        self._bursts = [
            Bursts(chain, seed, direction) if chain else None
            for direction, chain in enumerate(chains)
        ]
        self._real_time = o.real_time
        self._pair = VethPair(mobile, edge, o)
        self._ends: list[NetemControl] = []
        self._namespaces: list[int] = []
        """Held, because the drops are read when the nodes have ended."""
        self._applied: list[tuple[int, list[float]]] = []
        """(monotonic time [ns], [delay up [ms], delay down [ms], loss up, loss down]); loss is 0
        or 1."""
        self._failure: str | None = None
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None
        try:
            for path in (mobile, edge):
                self._namespaces.append(os.open(path, os.O_RDONLY | os.O_CLOEXEC))
            self._ends = [NetemControl(mobile, DEVICE), NetemControl(edge, DEVICE)]
            for end, limit, rate in zip(self._ends, self._limits, self._rates, strict=True):
                end.set(NetemSettings(0.0, limit, rate), create=True)
        except BaseException:
            self.abort()
            raise

    def apply(self) -> None:
        """Applies the profile's value at time 0; there are no bursts before the run."""
        self._set(0.0, -1.0)

    def _set(self, run_time_s: float, burst_time_s: float) -> None:
        delays = self._profile.delays_ms(run_time_s)
        lost = [bursts is not None and bursts.lost_at(burst_time_s) for bursts in self._bursts]
        for end, delay_ms, limit, rate, all_lost in zip(
            self._ends, delays, self._limits, self._rates, lost, strict=True
        ):
            end.set(NetemSettings(delay_ms, limit, rate, all_lost))
        self._applied.append((time.monotonic_ns(), [*delays, *map(float, lost)]))

    def start(self, t0_ns: int) -> None:
        """Follows the profile from `t0_ns` on; a constant profile without bursts needs no
        thread."""
        if self._profile.settled_s == 0.0 and not any(self._bursts):
            return
        self._thread = threading.Thread(
            target=self._follow, args=(t0_ns,), name="netem", daemon=True
        )
        self._thread.start()

    def _follow(self, t0_ns: int) -> None:
        if self._real_time:
            # Without the privilege updates may be late, which the log shows.
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))
        end_s = self._profile.settled_s
        step = 0
        try:
            while not self._stopped.is_set():
                # Uses the value in the middle of the coming step, so that a slope has an error of
                # at most half a step.
                now_s = (time.monotonic_ns() - t0_ns) / 1e9
                self._set(max(0.0, now_s + STEP_S / 2), now_s)
                if now_s >= step * STEP_S:
                    step = max(step + 1, int(now_s / STEP_S) + 1)
                next_s = min((b.turns_s for b in self._bursts if b), default=math.inf)
                if end_s is None or now_s <= end_s:
                    next_s = min(next_s, step * STEP_S)
                if next_s == math.inf:
                    return
                self._stopped.wait(max(0.0, t0_ns / 1e9 + next_s - time.monotonic()))
        except SlambedError as error:
            self._failure = str(error)

    def died(self) -> str | None:
        """Returns None while both devices exist and can be configured."""
        if self._failure is None and not all(end.device_there() for end in self._ends):
            self._failure = f"device {DEVICE} went away"
        return self._failure

    def stop(self, t0_ns: int) -> ShaperReport:
        """Removes the pair; reports the applied settings with their times, and the kernel's
        drops."""
        up, down = (_dropped(Path(f"/proc/self/fd/{fd}")) for fd in self._namespaces)
        drops = {"up": up, "down": down}
        self.abort()
        times = np.array([(at - t0_ns) / 1e9 for at, _ in self._applied])
        applied = np.array([values for _, values in self._applied]).reshape(-1, 4)
        series = {
            "applied_up_ms": (times, applied[:, 0]),
            "applied_down_ms": (times, applied[:, 1]),
            "drops_up": (times[-1:], np.array([float(drops["up"])])),
            "drops_down": (times[-1:], np.array([float(drops["down"])])),
        }
        if any(self._bursts):
            series |= {"lost_up": (times, applied[:, 2]), "lost_down": (times, applied[:, 3])}
        end_s = math.inf if self._profile.settled_s is None else self._profile.settled_s
        steps = np.diff(times[(times >= 0) & (times <= end_s)]) * 1e3
        details = LinkDetails(updates=len(self._applied))
        if len(steps):
            longest_ms = round(float(steps.max()), 2)
            details = details.model_copy(update={"longest_step_ms": longest_ms})
        return ShaperReport(series, drops, lambda e: ExtraDelays.none(len(e)), None, details)

    def abort(self) -> None:
        """Removes the pair."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()
        for end in self._ends:
            end.close()
        while self._namespaces:
            os.close(self._namespaces.pop())
        self._pair.remove()


def _bytes_per_s(side: Side) -> int:
    if side.rate is None or side.rate.mbps is None:
        return UNLIMITED_BYTES_PER_S
    return int(side.rate.mbps * 1e6 / 8)


def _limits(profile: Profile) -> list[int]:
    """Returns the packet limit per end; netem's limit also counts packets in flight, so they are
    added to the queue size."""
    t = np.arange(0.0, max(profile.settled_s or 0.0, CHECK_FOREVER_S), 0.1)
    limits = []
    for side, delays_ms in ((profile.up, profile.up_ms(t)), (profile.down, profile.down_ms(t))):
        if side.rate is None:
            limits.append(LIMIT_PACKETS)
            continue
        under_way = _bytes_per_s(side) * float(delays_ms.max()) / 1e3
        limits.append(int((queue_bytes(side.rate, profile) + under_way) / PACKET_BYTES) + 1)
    return limits


def _dropped(namespace: Path) -> int:
    """Returns the packets that netem dropped, by a full queue or a burst."""

    def work(netlink: Any) -> int:
        (index,) = netlink.link_lookup(ifname=DEVICE)
        for qdisc in netlink.get_qdiscs(index):
            if qdisc.get_attr("TCA_KIND") == "netem":
                stats = qdisc.get_attr("TCA_STATS2").get_attr("TCA_STATS_QUEUE")
                return int(stats["drops"])
        return 0

    with contextlib.suppress(NetlinkError, OSError, ValueError, SlambedError):
        return by_netlink(namespace, work)
    return 0
