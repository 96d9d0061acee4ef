# SPDX-License-Identifier: Apache-2.0
"""A campaign's own Docker daemon, which can be killed, stopped and restarted without affecting
the host's daemon and containers."""

import contextlib
import json
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import docker
import psutil
from docker.errors import DockerException
from pyroute2 import IPRoute
from requests.exceptions import RequestException
from waiting import LIMIT_S

from slambed.engines.base import LABEL

DAEMON_ERRORS = (DockerException, RequestException)
STARTS_WITHIN_S = 60.0
STOPS_WITHIN_S = 30.0
LOOK_EVERY_S = 0.1
AWAY_S = 1.0
"""Time without a daemon before its restart: about that of an init system."""


class Daemon:
    """dockerd with containerd, with its own data, socket and cgroup names; restarted whenever it
    ends, until `close`."""

    def __init__(self, folder: Path, group: int) -> None:
        """`group` may use its socket. Raises SlambedError or OSError without dockerd."""
        self._folder = folder
        folder.mkdir()
        self.socket = folder / "docker.sock"
        self.cgroup = f"slambed-chaos-{os.getpid()}"
        self._config = folder / "daemon.json"
        self._bridge = f"slambed{os.getpid()}"
        _add_bridge(self._bridge)
        settings = {
            "data-root": str(folder / "data"),
            "exec-root": str(folder / "exec"),
            "pidfile": str(folder / "docker.pid"),
            "hosts": [f"unix://{self.socket}"],
            "group": str(group),
            # Not "none": a daemon without a bridge would remove docker0 of the host's daemon.
            "bridge": self._bridge,
            "iptables": False,
            "ip-masq": False,
            "cgroup-parent": f"/{self.cgroup}",
            "storage-driver": _docker_output("info", "--format", "{{.Driver}}"),
        }
        self._config.write_text(json.dumps(settings))
        self._over = threading.Event()
        self._process = self._start()
        self.client = self._connected()
        self._keeper = threading.Thread(target=self._keep, daemon=True)
        self._keeper.start()

    @property
    def environment(self) -> dict[str, str]:
        """Environment of its clients."""
        return {"DOCKER_HOST": f"unix://{self.socket}"}

    def _start(self) -> subprocess.Popen[bytes]:
        # From a killed daemon. The process ids may be reused, or belong to a containerd zombie, for
        # which the new daemon would wait 15 s.
        for pid in ("docker.pid", "exec/containerd/containerd.pid"):
            (self._folder / pid).unlink(missing_ok=True)
        with (self._folder / "log.txt").open("ab") as log:
            return subprocess.Popen(
                ["dockerd", "--config-file", str(self._config)],
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def _connected(self) -> docker.DockerClient:
        deadline = time.monotonic() + STARTS_WITHIN_S
        while True:
            try:
                client = docker.DockerClient(f"unix://{self.socket}", timeout=20)
                client.ping()
                return client
            except DAEMON_ERRORS:
                if time.monotonic() > deadline:
                    raise
                time.sleep(LOOK_EVERY_S)

    def _keep(self) -> None:
        while not self._over.wait(LOOK_EVERY_S):
            if self._process.poll() is not None and not self._over.wait(AWAY_S):
                self._process = self._start()

    def copy(self, image: str) -> None:
        """Copies an image from the host's daemon."""
        saved = subprocess.Popen(["docker", "save", image], stdout=subprocess.PIPE)
        subprocess.run(
            ["docker", "load", "--quiet"],
            stdin=saved.stdout,
            stdout=subprocess.DEVNULL,
            env=os.environ | self.environment,
            check=True,
        )
        if saved.wait() != 0:
            raise RuntimeError(f"docker save {image} failed")

    def processes(self) -> dict[str, psutil.Process]:
        """Returns the daemon and its containerd by name."""
        found = {}
        with contextlib.suppress(psutil.Error):
            found["dockerd"] = daemon = psutil.Process(self._process.pid)
            for child in daemon.children():
                if child.name() == "containerd":
                    found["containerd"] = child
        return found

    def container(self, role: str) -> Any | None:
        """Returns the running container with this role."""
        with contextlib.suppress(*DAEMON_ERRORS):
            filters = {"label": f"{LABEL}.role={role}", "status": "running"}
            for found in self.client.containers.list(filters=filters):
                return found
        return None

    def ready(self) -> None:
        """Waits until it answers again."""
        self._connected().close()

    def close(self) -> None:
        """Ends it and removes everything."""
        self._over.set()
        self._keeper.join(LIMIT_S)
        with contextlib.suppress(*DAEMON_ERRORS):
            for container in self.client.containers.list(all=True):
                container.remove(force=True, v=True)
        self.client.close()
        self._process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(STOPS_WITHIN_S)
        # A killed daemon leaves the shims of its containers.
        for process in self._ours():
            with contextlib.suppress(psutil.Error):
                process.kill()
        for mount in sorted(_mounts_below(self._folder), reverse=True):
            subprocess.run(["umount", "--lazy", mount], check=False)
        shutil.rmtree(self._folder, ignore_errors=True)
        _remove_bridge(self._bridge)
        # Cgroups of containers are nested, wherever the daemon left them.
        for group in Path("/sys/fs/cgroup").glob(f"**/{self.cgroup}"):
            below = [path for path in group.rglob("*") if path.is_dir()]
            for path in [*sorted(below, reverse=True), group]:
                with contextlib.suppress(OSError):
                    path.rmdir()

    def _ours(self) -> Iterator[psutil.Process]:
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                if str(self._folder) in " ".join(process.cmdline()):
                    yield process


def _add_bridge(name: str) -> None:
    """Creates a bridge with an address, which dockerd requires, but no route: containers have no
    network."""
    with IPRoute() as route:
        route.link("add", ifname=name, kind="bridge")
        index = route.link_lookup(ifname=name)[0]
        route.addr("add", index=index, address="198.18.77.1", prefixlen=24)
        route.link("set", index=index, state="up")


def _remove_bridge(name: str) -> None:
    with IPRoute() as route:
        for index in route.link_lookup(ifname=name):
            route.link("del", index=index)


def _mounts_below(folder: Path) -> list[str]:
    lines = Path("/proc/self/mounts").read_text().splitlines()
    return [line.split()[1] for line in lines if line.split()[1].startswith(f"{folder}/")]


def _docker_output(*arguments: str) -> str:
    done = subprocess.run(["docker", *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()
