# SPDX-License-Identifier: Apache-2.0
"""The hosts of a campaign: joined, and checked to execute identical runs."""

import tempfile
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from slambed.campaign.cluster import imported
from slambed.campaign.executors import Played
from slambed.campaign.host_connection import Credentials, HostConnection
from slambed.campaign.host_executor import HostExecutor, Place, end_all, leave
from slambed.campaign.host_messages import Joined
from slambed.campaign.host_run import foreign_there
from slambed.campaign.remote_result import LostWorkerError, result_of
from slambed.errors import SlambedError, environment_error
from slambed.spec.experiment import Experiment
from slambed.spec.hosts import Host
from slambed.spec.software import host_software, image_software

WAIT_S = 1e9
"""Timeout for another campaign on a host with --wait: practically infinite."""
REJOIN_WAIT_S = 60.0
"""The same timeout for a host that comes back: its last worker may still be ending."""


class JoinedHosts:
    """The hosts of one campaign, from before its plan to its end."""

    def __init__(
        self,
        hosts: list[Host],
        notify: Callable[[str], None],
        wait: bool = False,
        quiet_s: float = 0.0,
        measure: bool = False,
        take: bool = True,
    ) -> None:
        """`wait`: wait for other campaigns on the hosts; `quiet_s`: how long to wait for each
        host to become quiet; `measure`: limits will be derived from their speed; `take`: they
        will execute runs instead of only reporting facts."""
        self._notify = notify
        self._quiet_s = quiet_s
        self._measure = measure
        self._take = take
        self._errors = tempfile.TemporaryDirectory(prefix="slambed-hosts-")
        self._client = _own_scheduler(keys := Credentials.make())
        self._keys = keys
        self.places: dict[str, Place] = {}
        connections = {host.name: self._connection(host) for host in hosts}
        try:
            # Two campaigns that wait for the same hosts must take them in the same order, or each
            # would hold what the other one waits for.
            order = sorted(hosts, key=lambda host: host.address) if wait else hosts
            at_once = 1 if wait else len(hosts)
            with ThreadPoolExecutor(at_once) as threads, _ending(connections, threads):
                work = {
                    host.name: threads.submit(
                        self._join, connections[host.name], WAIT_S if wait else 0.0
                    )
                    for host in order
                }
                for host in order:
                    facts = work[host.name].result()
                    self.places[host.name] = Place(host, connections[host.name], facts)
                    self._notify(_about(host, facts))
            # Which host makes which repetition depends on the order in the file.
            self.places = {host.name: self.places[host.name] for host in hosts}
            self.software = self._one_software()
        except BaseException:
            end_all(list(connections.values()))
            self._leave()
            raise

    @property
    def engine(self) -> str:
        """The common engine of the hosts."""
        return next(iter(self.places.values())).host.engine

    @property
    def netem(self) -> bool:
        """Whether all kernels have netem: a link must be the same on all hosts."""
        return all(place.facts.netem for place in self.places.values())

    def foreign(self, experiment: Experiment) -> dict[str, str]:
        """Returns the tags of systems with their own programs. Raises SlambedError if hosts
        differ."""
        found: dict[str, dict[str, str]] = {}
        for name, place in self.places.items():
            future = self._client.submit(
                foreign_there,
                experiment,
                self.software,
                pure=False,
                workers=[place.facts.worker],
            )
            try:
                found[name] = result_of(future, threading.Event(), place.connection.alive)
            except LostWorkerError:
                words = place.connection.last_words()
                raise environment_error(
                    f"host {name} is gone" + (f" ({words})" if words else "")
                ) from None
        first, *others = found
        for name in others:
            for system, tag in found[name].items():
                if tag != found[first][system]:
                    raise environment_error(
                        f"system {system} is another one on host {name} than on {first}: {tag}, "
                        f"{found[first][system]}; bring the same image or files to both"
                    )
        return found[first]

    def executor(self, played: Played, seed: int) -> HostExecutor:
        """Returns the executor of the plan's runs."""
        return HostExecutor(self.places, self._client, played, seed, self._rejoin, self._notify)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        end_all([place.connection for place in self.places.values()])
        self._leave()

    def _leave(self) -> None:
        leave(self._client)
        self._errors.cleanup()

    def _connection(self, host: Host) -> HostConnection:
        return HostConnection(host, Path(self._errors.name))

    def _join(self, connection: HostConnection, wait_s: float) -> Joined:
        scheduler = self._client.scheduler.address
        return connection.join(
            scheduler, self._keys, wait_s, self._quiet_s, self._measure, self._take, self._notify
        )

    def _rejoin(self, host: Host) -> tuple[HostConnection, Joined]:
        connection = self._connection(host)
        facts = self._join(connection, REJOIN_WAIT_S)
        before = self.places[host.name].facts
        if facts.software != before.software or (self.netem and not facts.netem):
            connection.close()
            raise environment_error(f"host {host.name} came back as another one")
        return connection, facts

    def _one_software(self) -> str:
        """Returns the software tag of this checkout, whose files make up the plan. Raises if a
        host has another one."""
        ours = image_software()
        if self.engine == "local":
            with suppress(SlambedError):  # may not be built on this machine, which executes no run
                ours = host_software()
        for name, place in self.places.items():
            if place.facts.software != ours:
                raise environment_error(
                    f"host {name} makes runs of {place.facts.software}, this checkout of {ours}; "
                    "bring both to the same commit and run 'make build' there"
                )
        return ours


@contextmanager
def _ending(connections: dict[str, HostConnection], threads: ThreadPoolExecutor) -> Iterator[None]:
    """On an error or Ctrl-C, ends connections that still wait for their host: otherwise the exit
    would wait for their threads."""
    try:
        yield
    except BaseException:
        threads.shutdown(wait=False, cancel_futures=True)
        end_all(list(connections.values()))
        raise


def _own_scheduler(keys: Credentials) -> Any:
    """Returns a client of a new scheduler in this process, on loopback, without workers."""
    distributed = imported("distributed", "--hosts")
    security = imported("distributed.security", "--hosts").Security(
        tls_ca_file=keys.certificate,
        tls_client_cert=keys.certificate,
        tls_client_key=keys.key,
        tls_scheduler_cert=keys.certificate,
        tls_scheduler_key=keys.key,
        require_encryption=True,
    )
    cluster = distributed.LocalCluster(
        n_workers=0,
        processes=False,
        host="127.0.0.1",
        protocol="tls://",
        dashboard_address=None,
        security=security,
        silence_logs=50,
    )
    return distributed.Client(cluster)


def _about(host: Host, facts: Joined) -> str:
    measured = facts.speed_measured_utc is not None
    speed = f", {facts.speed:.2f} of a core of the reference host" if measured else ""
    tidied = f"; removed what a killed campaign left: {facts.tidied}" if facts.tidied else ""
    cpus = f"{len(facts.cpus)} CPU" + ("s" if len(facts.cpus) > 1 else "")
    what = f"host {host.name}: {cpus} ({facts.cpu_model}), engine {host.engine}{speed}"
    return f"{what}{tidied}; {facts.load}"
