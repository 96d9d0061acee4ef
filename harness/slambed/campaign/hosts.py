# SPDX-License-Identifier: Apache-2.0
"""From hosts.yaml to a campaign's hosts: joined, and fit to execute the same runs."""

import tempfile
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
from slambed.errors import SlambedError, environment_error
from slambed.spec.experiment import Experiment
from slambed.spec.hosts import Host
from slambed.spec.software import host_software, image_software

WAIT_S = 1e9
"""For another campaign on a host, with --wait."""
REJOIN_WAIT_S = 60.0
"""The same of a host that comes back: its last worker may be ending."""


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
        """`wait`: for other campaigns on them; `quiet_s`: how long to wait for each to become
        quiet; `measure`: limits will follow from their speed; `take`: they will execute runs, not
        only say what they are."""
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
            with ThreadPoolExecutor(len(hosts)) as threads, _ending(connections):
                work = {
                    host.name: threads.submit(
                        self._join, connections[host.name], WAIT_S if wait else 0.0
                    )
                    for host in hosts
                }
                for host in hosts:
                    facts = work[host.name].result()
                    self.places[host.name] = Place(host, connections[host.name], facts)
                    self._notify(_about(host, facts))
            self.software = self._one_software()
        except BaseException:
            end_all(list(connections.values()))
            self._leave()
            raise

    @property
    def engine(self) -> str:
        """Of all of them."""
        return next(iter(self.places.values())).host.engine

    @property
    def netem(self) -> bool:
        """Whether all kernels have it: a link is the same wherever a run is executed."""
        return all(place.facts.netem for place in self.places.values())

    def foreign(self, experiment: Experiment) -> dict[str, str]:
        """Tags of systems that are programs of their own. Raises SlambedError where a host has
        another one than the others."""
        found: dict[str, dict[str, str]] = {}
        for name, place in self.places.items():
            found[name] = self._client.submit(
                foreign_there,
                experiment,
                self.software,
                pure=False,
                workers=[place.facts.worker],
            ).result()
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
        """What executes the plan's runs on them."""
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
        """That of this checkout: the plan is made of its files."""
        ours = image_software()
        if self.engine == "local":
            with suppress(SlambedError):  # not built here, where no run is made
                ours = host_software()
        for name, place in self.places.items():
            if place.facts.software != ours:
                raise environment_error(
                    f"host {name} makes runs of {place.facts.software}, this checkout of {ours}; "
                    "bring both to the same commit and run 'make build' there"
                )
        return ours


@contextmanager
def _ending(connections: dict[str, HostConnection]) -> Iterator[None]:
    """Whatever goes wrong, or Ctrl-C, ends those that are still waiting for their host: their
    threads would be waited for."""
    try:
        yield
    except BaseException:
        end_all(list(connections.values()))
        raise


def _own_scheduler(keys: Credentials) -> Any:
    """A client of a scheduler in this process, on the loopback, that has no worker yet."""
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
