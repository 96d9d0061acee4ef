# SPDX-License-Identifier: Apache-2.0
"""A stand-in for a machine of hosts.yaml: sshd on a loopback port, in its own PID and mount
namespaces, with its own /run (and so its own host lock) and CPU.

Kernel, files and clock are this machine's. Killing it simulates a power failure: the kernel ends
every process in its PID namespace.
"""

import contextlib
import os
import shlex
import shutil
import socket
import subprocess
import time
from pathlib import Path

from slambed.engines.cgroups import V1_LARGEST_SHARES
from slambed.native import repository_root

SSHD = shutil.which("sshd", path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
V1 = ("cpu", "cpuacct", "cpuset", "memory")
UP_S = 30.0


class StandInHost:
    """Runs from `start` to `close`; `kill` and `start` may be repeated."""

    def __init__(self, name: str, folder: Path, cpu: int | None = None) -> None:
        """`folder`: for its keys and logs; `cpu`: its only CPU, None: all."""
        assert SSHD is not None, "no sshd: tools/setup.sh test"
        self.name, self.folder = name, folder / name
        self.folder.mkdir(parents=True)
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.port = server.getsockname()[1]
        for key in ("host_key", "key"):
            make = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(self.folder / key)]
            subprocess.run(make, check=True)
        self._config = self.folder / "sshd_config"
        self._config.write_text(
            f"Port {self.port}\nListenAddress 127.0.0.1\nHostKey {self.folder}/host_key\n"
            f"AuthorizedKeysFile {self.folder}/key.pub\nPermitRootLogin yes\nStrictModes no\n"
            "UsePAM no\nPasswordAuthentication no\nPidFile none\n"
        )
        self._cpu = str(cpu) if cpu is not None else ",".join(map(str, os.sched_getaffinity(0)))
        mounts = [Path("/sys/fs/cgroup") / name for name in V1]
        self._groups = [
            mount / f"stand-in-{os.getpid()}-{name}"
            for mount in mounts
            if (mount / "tasks").is_file()
        ]
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Boots; returns when sshd answers."""
        inside = ["mount -t tmpfs none /run", "mkdir -p /run/lock /run/sshd"]
        for group in self._groups:
            group.mkdir(exist_ok=True)
            if group.parent.name == "cpuset":
                (group / "cpuset.mems").write_text((group.parent / "cpuset.mems").read_text())
                (group / "cpuset.cpus").write_text(self._cpu)
            if group.parent.name == "cpu":
                # Nodes have priority over other work, as on a separate machine.
                (group / "cpu.shares").write_text(str(V1_LARGEST_SHARES))
            inside.append(f"mount --bind {group} {group.parent}")
        inside.append(f"exec {SSHD} -D -e -f {self._config}")
        enter = [f"echo $$ > {group}/tasks" for group in self._groups]
        unshare = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc", "sh"]
        script = [*enter, f"exec {shlex.join([*unshare, '-ec', '; '.join(inside)])}"]
        with (self.folder / "sshd.txt").open("ab") as log:
            self._process = subprocess.Popen(
                ["taskset", "-c", self._cpu, "sh", "-ec", "; ".join(script)],
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
            )
        deadline = time.monotonic() + UP_S
        while True:
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port)):
                return
            assert time.monotonic() < deadline, (self.folder / "sshd.txt").read_text()
            time.sleep(0.05)

    def kill(self) -> None:
        """Simulates a power failure."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def close(self) -> None:
        """Removes everything."""
        self.kill()
        remove_groups(self._groups)

    def entry(self, **more: object) -> dict[str, object]:
        """Its entry in hosts.yaml."""
        known = self.folder / "known_hosts"
        options = [
            "-p", str(self.port), "-i", str(self.folder / "key"), "-F", "none",
            "-o", f"UserKnownHostsFile={known}", "-o", "StrictHostKeyChecking=accept-new",
        ]  # fmt: skip
        entry: dict[str, object] = {
            "name": self.name,
            "address": "root@127.0.0.1",
            "slambed": str(repository_root()),
            "engine": "local",
            "ssh": options,
        }
        return entry | more


def remove_groups(groups: list[Path]) -> None:
    """Removes cgroups and their children once their processes have gone."""
    for group in groups:
        for inner in sorted(group.rglob("*"), key=lambda path: -len(path.parts)):
            if inner.is_dir():
                _remove(inner)
        _remove(group)


def _remove(group: Path) -> None:
    """Processes end with the namespace, shortly after its first process."""
    deadline = time.monotonic() + UP_S
    while group.is_dir():
        try:
            group.rmdir()
        except OSError:
            assert time.monotonic() < deadline, f"{group} stays"
            time.sleep(0.05)
