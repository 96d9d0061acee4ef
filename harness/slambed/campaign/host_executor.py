# SPDX-License-Identifier: Apache-2.0
"""Live runs on several hosts (`slambed run --hosts`), one at a time on each.

Every host is a worker of this campaign's own Dask scheduler. A run goes to the host of its
repetition (`preference`). If that host dies, the attempt is lost, other hosts take over its runs,
and the campaign tries to reconnect. Only this process writes results and ledger, so a host that
dies leaves no partial results.
"""

import random
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from slambed.campaign.executors import Played
from slambed.campaign.host_connection import HostConnection
from slambed.campaign.host_messages import Joined
from slambed.campaign.host_run import HostRun, execute_there, prepare_there
from slambed.campaign.raw_folder import reference_of
from slambed.campaign.remote_result import LostWorkerError, result_of
from slambed.campaign.remote_sequence import unpack
from slambed.engines.result import InterruptedRunError
from slambed.errors import KilledError, SlambedError, environment_error
from slambed.metrics.summary import Summary
from slambed.native import repository_root
from slambed.spec.hosts import Host
from slambed.spec.run_spec import RunSpec

ASK_AGAIN_S = (10.0, 30.0, 60.0)
"""Pauses between attempts to reconnect to a lost host; the last one repeats."""
NONE_LEFT_S = 600.0
"""A campaign ends after all its hosts have been lost for this long."""


@dataclass
class Place:
    """A host of a campaign and its state."""

    host: Host
    connection: HostConnection
    facts: Joined
    state: Literal["idle", "busy", "lost"] = "idle"


Rejoin = Callable[[Host], tuple[HostConnection, Joined]]
"""Reconnects a host; raises SlambedError if it is still unreachable or has changed."""


@dataclass
class HostExecutor:
    """Executes live runs on hosts; `claim` decides which run may start."""

    places: dict[str, Place]
    client: Any
    played: Played
    seed: int
    rejoin: Rejoin
    notify: Callable[[str], None]
    _claims: dict[str, Place] = field(default_factory=dict)
    """Run key -> host reserved for the run or executing it."""
    _all_lost_since_s: float | None = None
    _guard: threading.RLock = field(default_factory=threading.RLock)
    _over: threading.Event = field(default_factory=threading.Event)
    _ready: set[tuple[str, str]] = field(default_factory=set)
    """(host, dataset) pairs whose sequence is already on the host."""

    @property
    def jobs(self) -> int:
        """One run at a time per host."""
        return len(self.places)

    def claim(self, spec: RunSpec) -> bool:
        """Reserves a host for the run if it may start now. Raises SlambedError when no host is
        left."""
        with self._guard:
            for place in self.places.values():
                if place.state == "idle" and not place.connection.alive():
                    self._lose(place)
            living = [
                name
                for name in preference(spec.repetition, list(self.places), self.seed)
                if self.places[name].state != "lost"
            ]
            self._must_live(living)
            if not living or (place := self.places[living[0]]).state != "idle":
                return False
            place.state = "busy"
            self._claims[spec.run_key] = place
            return True

    def release(self, spec: RunSpec) -> None:
        """Releases the host of the run."""
        with self._guard:
            place = self._claims.pop(spec.run_key)
            if place.state == "busy":
                place.state = "idle"

    def host_of(self, spec: RunSpec) -> str | None:
        """Returns the name of a claimed run's host."""
        with self._guard:
            return self._claims[spec.run_key].host.name

    def execute(self, spec: RunSpec, raw: Path, stop: threading.Event, attempt: int = 1) -> Summary:
        """Executes the run on its reserved host. Raises KilledError if the host dies."""
        with self._guard:
            place = self._claims[spec.run_key]
        sequence, played_s = self.played[spec.dataset]
        if (where := (place.host.name, spec.dataset)) not in self._ready:
            self._get(place, stop, prepare_there, spec, sequence.resolve())
            self._ready.add(where)
        run = HostRun(
            spec,
            sequence.resolve(),
            played_s,
            sys.argv,
            attempt,
            repository_root(),
            reference_of(spec),
        )
        summary, files = self._get(place, stop, execute_there, run)
        unpack(files, raw)
        found: Summary = summary
        return found

    def _get(self, place: Place, stop: threading.Event, work: Any, *arguments: Any) -> Any:
        """Returns the result of `work` executed on a host."""
        future = self.client.submit(
            work, *arguments, pure=False, workers=[place.facts.worker], allow_other_workers=False
        )
        try:
            return result_of(future, stop, place.connection.alive)
        except InterruptedRunError:
            # The other threads close their connections in the same way.
            place.connection.close()
            raise
        except LostWorkerError as lost:
            if not lost.killed and place.connection.alive():
                place.connection.close()
        with self._guard:
            line = self._lose(place)
        raise KilledError(line)

    def _lose(self, place: Place) -> str:
        """Marks a host as lost and starts a thread that tries to reconnect."""
        words = place.connection.last_words()
        line = f"host {place.host.name} is gone" + (f" ({words})" if words else "")
        if place.state != "lost":
            place.state = "lost"
            self.notify(f"{line}; the others take its runs, and it is asked again")
            threading.Thread(target=self._ask_again, args=(place,), daemon=True).start()
        return line

    def _ask_again(self, place: Place) -> None:
        place.connection.close()
        times = 0
        while not self._over.wait(ASK_AGAIN_S[min(times, len(ASK_AGAIN_S) - 1)]):
            times += 1
            try:
                place.connection, place.facts = self.rejoin(place.host)
            except SlambedError:
                continue
            with self._guard:
                if self._over.is_set():
                    place.connection.close()
                    return
                place.state = "idle"
                self.notify(f"host {place.host.name} is back and gets its runs")
            return

    def _must_live(self, living: list[str]) -> None:
        if living:
            self._all_lost_since_s = None
            return
        now_s = time.monotonic()
        if self._all_lost_since_s is None:
            self._all_lost_since_s = now_s
            self.notify(
                f"no host is left; waiting up to {NONE_LEFT_S / 60:.0f} min for one to return"
            )
        if now_s - self._all_lost_since_s > NONE_LEFT_S:
            raise environment_error(
                f"hosts {', '.join(self.places)} are all gone; finished runs are kept, the same "
                "command goes on when all are back, with --on NAME those that are"
            )

    def close(self) -> None:
        """Disconnects all hosts and ends the scheduler."""
        self._over.set()
        end_all([place.connection for place in self.places.values()])
        leave(self.client)


def end_all(connections: list[HostConnection]) -> None:
    """Closes all connections in parallel, because each may have to end a run."""
    threads = [threading.Thread(target=each.close) for each in connections]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def leave(client: Any) -> None:
    """Closes the client and ends the campaign's scheduler."""
    cluster = client.cluster
    with suppress(Exception):
        client.close()
        cluster.close()


def preference(repetition: int, hosts: list[str], seed: int) -> list[str]:
    """Returns the host that executes this repetition, followed by its substitutes in order.

    All cells of a repetition run on the same host, and the repetitions of each cell are spread
    evenly over the hosts. Any effect of a host therefore hits all cells equally often, and values
    paired by repetition come from one machine.

    Each block of as many repetitions as hosts uses every host once, in a seeded order. Adding
    repetitions does not change the hosts of earlier ones.
    """
    block, place = divmod(repetition, len(hosts))
    order = list(hosts)
    random.Random(f"{seed}/hosts/{block}").shuffle(order)
    return order[place:] + order[:place]
