# SPDX-License-Identifier: Apache-2.0
"""A stand-in for a board on this machine: sshd and its own Docker daemon at the other end of a
veth, in separate network, time, PID, mount and UTS namespaces.

It has its own images, containers, lock, address and CLOCK_MONOTONIC. Kernel, files and CPUs are
this machine's. Killing it simulates a power failure: its first process takes all others with it.
"""

import contextlib
import itertools
import json
import os
import pwd
import shlex
import shutil
import subprocess
import time
from pathlib import Path

import psutil
from stand_in_host import SSHD, UP_S, remove_groups

from slambed.engines.docker_image import connect

CLOCK_AHEAD_S = 5000
"""Its CLOCK_MONOTONIC is this far ahead of ours, as if it had booted earlier."""
NUMBERS = itertools.count()
CABLE = "sb{:d}-{:d}"
NETWORK = "10.78.{:d}.{:d}"
SETTINGS = {
    "exec-root": "/run/docker",
    "pidfile": "/run/docker.pid",
    "hosts": ["unix:///run/docker.sock"],
    "bridge": "none",
    "iptables": False,
    "ip-masq": False,
    "exec-opts": ["native.cgroupdriver=cgroupfs"],
}
"""Nodes use the board's own network, so the daemon needs none."""


class StandInBoard:
    """Runs from `start` to `close`; `kill` and `start` may be repeated."""

    def __init__(
        self, folder: Path, name: str = "board", machine: str = "", docker: bool = True
    ) -> None:
        """`folder`: for its disk, keys and logs; `machine`: the architecture that it reports
        instead of ours; `docker`: whether it has a daemon."""
        assert SSHD is not None, "no sshd: tools/setup.sh test"
        self.name, self.folder = name, folder / name
        self.folder.mkdir(parents=True)
        number = next(NUMBERS)
        self.cable = CABLE.format(os.getpid(), number)
        self.here = NETWORK.format(os.getpid() % 250, 4 * number + 1)
        self.address = NETWORK.format(os.getpid() % 250, 4 * number + 2)
        self._machine, self._has_docker = machine, docker
        for key in ("host_key", "key"):
            make = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(self.folder / key)]
            subprocess.run(make, check=True)
        (self.folder / "sshd_config").write_text(
            f"Port 22\nListenAddress {self.address}\nHostKey {self.folder}/host_key\n"
            f"AuthorizedKeysFile {self.folder}/key.pub\nPermitRootLogin yes\nStrictModes no\n"
            "UsePAM no\nPasswordAuthentication no\nPidFile none\n"
        )
        client = connect()
        driver = client.info()["Driver"]
        client.close()
        disk = {"data-root": str(self.folder / "docker"), "storage-driver": driver}
        (self.folder / "daemon.json").write_text(json.dumps(SETTINGS | disk))
        hierarchies = [path for path in Path("/sys/fs/cgroup").iterdir() if path.is_mount()]
        self._groups = [
            path.resolve() / f"stand-in-{os.getpid()}-{name}"
            for path in hierarchies
            if not path.is_symlink() and (path / "tasks").is_file()
        ]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Boots; returns when sshd and Docker answer."""
        inside = [
            "mount -t tmpfs none /run",
            "mkdir -p /run/lock /run/sshd",
            # Its own home, so that its logins cannot damage this machine's.
            f"mount -t tmpfs none {pwd.getpwuid(0).pw_dir}",
            *(f"mount --bind {group} {group.parent}" for group in self._groups),
            f"hostname {self.name}",
            "ip link set lo up",
            "until ip link set eth0 up 2>/dev/null; do sleep 0.05; done",
            f"ip address add {self.address}/30 dev eth0",
            self._services(),
        ]
        for group in self._groups:
            group.mkdir(exist_ok=True)
            if group.parent.name == "cpuset":
                for file in ("cpuset.mems", "cpuset.cpus"):
                    (group / file).write_text((group.parent / file).read_text())
        enter = [f"echo $$ > {group}/tasks" for group in self._groups]
        unshare = [
            "unshare", "--mount", "--pid", "--net", "--uts", "--cgroup", "--time",
            "--monotonic", str(CLOCK_AHEAD_S), "--boottime", str(CLOCK_AHEAD_S),
            "--fork", "--kill-child", "--mount-proc", "sh",
        ]  # fmt: skip
        script = [*enter, f"exec {shlex.join([*unshare, '-ec', '; '.join(inside)])}"]
        with (self.folder / "boot.txt").open("ab") as log:
            self._process = subprocess.Popen(
                ["sh", "-ec", "; ".join(script)], stdout=log, stderr=log, stdin=subprocess.DEVNULL
            )
        self._plug_in()
        self._await_services()

    def _services(self) -> str:
        sshd = f"exec {SSHD} -D -e -f {self.folder}/sshd_config"
        if self._machine:
            sshd = sshd.replace("exec", f"exec setarch {self._machine}")
        if not self._has_docker:
            return sshd
        dockerd = f"dockerd --config-file {self.folder}/daemon.json"
        return f"{dockerd} >{self.folder}/dockerd.txt 2>&1 & {sshd}"

    def _plug_in(self) -> None:
        """Creates the veth from our namespace to the board's."""
        assert self._process is not None
        deadline = time.monotonic() + UP_S
        while not (children := psutil.Process(self._process.pid).children()):
            assert time.monotonic() < deadline, (self.folder / "boot.txt").read_text()
            time.sleep(0.02)
        far = ["peer", "name", "eth0", "netns", str(children[0].pid)]
        _ip("link", "add", self.cable, "type", "veth", *far)
        _ip("address", "add", f"{self.here}/30", "dev", self.cable)
        _ip("link", "set", self.cable, "up")

    def _await_services(self) -> None:
        deadline = time.monotonic() + UP_S
        command = ["docker", "version"] if self._has_docker else ["true"]
        while self.over_ssh(*command).returncode != 0:
            reported = [self.folder / name for name in ("boot.txt", "dockerd.txt")]
            text = "\n".join(path.read_text() for path in reported if path.exists())
            assert time.monotonic() < deadline, text
            time.sleep(0.2)

    def over_ssh(self, *command: str) -> "subprocess.CompletedProcess[str]":
        """Runs a command on the board."""
        ssh = ["ssh", *self.ssh, f"root@{self.address}", shlex.join(command)]
        return subprocess.run(ssh, capture_output=True, text=True)

    @property
    def ssh(self) -> list[str]:
        """Further arguments of ssh."""
        return [
            "-i", str(self.folder / "key"), "-F", "none", "-o", "ConnectTimeout=5",
            "-o", f"UserKnownHostsFile={self.folder}/known_hosts",
            "-o", "StrictHostKeyChecking=accept-new",
        ]  # fmt: skip

    def role(self, **more: object) -> dict[str, object]:
        """`roles.mobile` of an experiment."""
        return {
            "host": f"root@{self.address}",
            "over": "ssh",
            "name": self.name,
            "ssh": self.ssh,
        } | more

    def kill(self) -> None:
        """Simulates a power failure."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        with contextlib.suppress(subprocess.CalledProcessError):
            # The kernel removes a network namespace, and the veth in it, with a delay.
            _ip("link", "delete", self.cable)

    def close(self) -> None:
        """Removes everything."""
        self.kill()
        remove_groups(self._groups)
        shutil.rmtree(self.folder / "docker", ignore_errors=True)


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)
