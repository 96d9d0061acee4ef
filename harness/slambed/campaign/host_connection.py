# SPDX-License-Identifier: Apache-2.0
"""Connection to one host of a campaign: ssh with two forwarded ports, and a worker on the host.

All ports listen on loopback only: worker and scheduler reach each other through the ssh connection.
Both require the campaign's TLS certificate, because Dask's protocol executes code.
"""

import shlex
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from slambed.campaign.host_messages import AskPorts, FreePorts, JoinCampaign, Joined
from slambed.campaign.host_worker import harness_digest
from slambed.errors import PassingError, SlambedError, environment_error
from slambed.process.line_protocol import LineProcess
from slambed.spec.hosts import Host

MODULE = "slambed.campaign.host_worker"
SSH = (
    "ssh", "-T", "-o", "BatchMode=yes", "-o", "ConnectTimeout=20",
    "-o", "ExitOnForwardFailure=yes", "-o", "ServerAliveInterval=10", "-o", "ServerAliveCountMax=3",
)  # fmt: skip
"""Never prompts, and closes the connection after a host has been silent for 30 s."""
FIRST_ANSWER_S = 60.0
JOIN_S = 3600.0
"""Timeout that includes building an image."""
END_S = 40.0
"""Longer than the worker's own timeout for its last run."""


@dataclass(frozen=True)
class Credentials:
    """TLS certificate and key shared by the processes of one campaign."""

    certificate: str
    key: str

    @staticmethod
    def make() -> "Credentials":
        """Creates a self-signed certificate with openssl."""
        with tempfile.TemporaryDirectory() as folder:
            key, certificate = Path(folder) / "key.pem", Path(folder) / "certificate.pem"
            command = [
                "openssl", "req", "-x509", "-newkey", "ec",
                "-pkeyopt", "ec_paramgen_curve:prime256v1",
                "-nodes", "-days", "3650", "-subj", "/CN=slambed",
                "-keyout", str(key), "-out", str(certificate),
            ]  # fmt: skip
            try:
                subprocess.run(command, check=True, capture_output=True)
            except (OSError, subprocess.CalledProcessError) as error:
                raise environment_error(
                    f"openssl makes no certificate for the workers of --hosts: {error}"
                ) from None
            return Credentials(certificate.read_text(), key.read_text())


class HostConnection:
    """One worker on one host, from `join` to `close`."""

    def __init__(self, host: Host, errors: Path) -> None:
        """`errors`: folder for the stderr output of ssh and the worker."""
        self._host = host
        self._errors = errors / f"{host.name}.txt"
        self._process: LineProcess | None = None

    def join(
        self,
        scheduler: str,
        keys: Credentials,
        wait_s: float = 0.0,
        quiet_s: float = 0.0,
        measure: bool = False,
        take: bool = True,
        notify: Callable[[str], None] = lambda line: None,
    ) -> Joined:
        """Makes the host a worker of the scheduler at this address. `notify` is called while it
        waits for another campaign there. Raises PassingError for an unreachable host,
        SlambedError for an unsuitable one."""
        host = self._host
        try:
            ports = self._look()
            if ports.harness != (ours := harness_digest()):
                raise environment_error(
                    f"{host.slambed} there is of another version ({ports.harness}, this one is "
                    f"{ours}); bring both to the same commit"
                )
            forwards: list[str] = []
            port, contact = 0, None
            if not host.is_here:
                near = _free_port()
                port, contact = ports.worker, f"tls://127.0.0.1:{near}"
                forwards = [
                    "-L", f"127.0.0.1:{near}:127.0.0.1:{ports.worker}",
                    "-R", f"127.0.0.1:{ports.scheduler}:{scheduler.removeprefix('tls://')}",
                ]  # fmt: skip
                scheduler = f"tls://127.0.0.1:{ports.scheduler}"
            self._process = LineProcess(_command(host, forwards), "worker", self._errors)
            asked = JoinCampaign(
                name=host.name,
                labels=host.labels,
                engine=host.engine,
                cores=host.cores,
                scheduler=scheduler,
                port=port,
                contact=contact,
                certificate=keys.certificate,
                key=keys.key,
                wait_s=wait_s,
                quiet_s=quiet_s,
                measure=measure,
                take=take,
            )
            return self._process.ask(
                asked,
                Joined,
                JOIN_S + wait_s + quiet_s,
                lambda line: notify(f"host {host.name}: {line}"),
            )
        except SlambedError as error:
            self.close()
            error.args = (f"host {host.name}: {error}",)
            raise

    def _look(self) -> FreePorts:
        """Asks for free ports and the version over a separate connection."""
        process = LineProcess(_command(self._host, []), "worker", self._errors)
        try:
            return process.ask(AskPorts(), FreePorts, FIRST_ANSWER_S)
        except PassingError as error:
            place = "" if self._host.is_here else f" at {self._host.address}"
            raise PassingError(
                f"no slambed in {self._host.slambed}{place} answers: {self.last_words() or error}"
            ) from None
        finally:
            process.close()

    def alive(self) -> bool:
        """Returns False once the worker or the connection has ended."""
        return self._process is not None and self._process.alive()

    def last_words(self) -> str:
        """Returns the last error line of ssh or the worker."""
        try:
            lines = self._errors.read_text(errors="replace").strip().splitlines()
        except OSError:
            return ""
        return lines[-1].strip().removeprefix("error: ") if lines else ""

    def close(self) -> None:
        """Ends the worker and its run; safe to call twice."""
        if self._process is not None:
            self._process.close(END_S)


def _command(host: Host, forwards: list[str]) -> list[str]:
    """Returns the command that starts the worker on the host."""
    settings = [f"{name}={value}" for name, value in host.environment.items()]
    if host.is_here:
        return ["env", *settings, sys.executable, "-m", MODULE]
    there = host.slambed.removeprefix("~/")
    python = f"exec env {shlex.join(settings)} .venv/bin/python -m {MODULE}"
    remote = f"cd {shlex.quote(there)} && {python}"
    return [*SSH, *host.ssh, *forwards, "--", host.address, remote]


def _free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port
