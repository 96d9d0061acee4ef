# SPDX-License-Identifier: Apache-2.0
"""A Dask scheduler with workers for a campaign with faults: dead processes are restarted."""

import os
import socket
import subprocess
import sys
import threading
from pathlib import Path

from waiting import LIMIT_S

LOOK_EVERY_S = 0.2


class Cluster:
    """A scheduler at one address and workers without nannies, restarted until `close`."""

    def __init__(self, folder: Path, environment: dict[str, str], workers: int) -> None:
        self._folder = folder
        self._environment = environment
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self._commands = [["scheduler", "--host", "127.0.0.1", "--port", str(port)]]
        for number in range(workers):
            scratch = str(folder / f"worker{number}")
            worker = ["worker", self.address, "--nthreads", "1", "--no-nanny"]
            self._commands.append([*worker, "--local-directory", scratch])
        self._processes: dict[int, subprocess.Popen[bytes]] = {}
        self._over = threading.Event()
        self._keeper = threading.Thread(target=self._keep, daemon=True)
        self._keeper.start()

    def _keep(self) -> None:
        while not self._over.is_set():
            for number, command in enumerate(self._commands):
                process = self._processes.get(number)
                if process is None or process.poll() is not None:
                    self._processes[number] = self._start(number, command)
            self._over.wait(LOOK_EVERY_S)

    def _start(self, number: int, command: list[str]) -> subprocess.Popen[bytes]:
        with (self._folder / f"dask{number}.txt").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "dask", *command, "--no-dashboard"],
                env={**os.environ, **self._environment},
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def close(self) -> None:
        """Ends them all."""
        self._over.set()
        self._keeper.join(LIMIT_S)
        for process in self._processes.values():
            process.kill()
            process.wait()
