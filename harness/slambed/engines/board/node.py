# SPDX-License-Identifier: Apache-2.0
"""The mobile node in a container on a board: its files are transferred through the board's
Docker."""

import contextlib
import io
import json
import os
import tarfile
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from docker.errors import DockerException, NotFound

from slambed.engines.base import LABEL, NODE_UID, NodePlan, netns
from slambed.engines.board.connection import LAST_S, BoardConnection
from slambed.engines.board.messages import Watching, WatchNode
from slambed.engines.board.shipping import PLACE
from slambed.engines.docker import OUTPUT, PIDS_LIMIT, START_BARRIER, WAIT_AT_BARRIER, is_paused
from slambed.engines.docker_errors import DAEMON_ERRORS, docker_error
from slambed.errors import KilledError, SlambedError
from slambed.sampling.cgroup import Granted
from slambed.spec.system import Role

LOOK_EVERY_S = 0.05
BLOCK_BYTES = 1 << 20
PUT = 'printf %s "$1" >"$0.new" && mv "$0.new" "$0"'
"""Another process must never see an incomplete file."""
CONFIG = "run.json"


class BoardNode:
    """A container on a board, from the start barrier to its end. Its output files are copied to
    this machine before its end is reported."""

    role: Role = "mobile"

    def __init__(
        self,
        connection: BoardConnection,
        image_id: str,
        volume: str,
        plan: NodePlan,
        ports: list[int],
    ) -> None:
        """`volume`: volume with the sequence; `ports`: ports of the edge, whose connections are
        sampled."""
        self._connection = connection
        self.namespace = netns(os.getpid())
        self._folder = plan.run_dir / self.role
        self._folder.mkdir(parents=True, exist_ok=True)
        self._code: int | None = None
        self._lost: SlambedError | None = None
        self._oom = False
        self._removed = threading.Event()
        self._output = f"{LABEL}-{plan.run_key}-out"
        self._container: Any = None
        try:
            self._create(image_id, volume, plan)
            watching = connection.ask(WatchNode(pid=self.pid, ports=ports), Watching)
        except BaseException as error:
            if isinstance(error, DAEMON_ERRORS):
                connection.must_live(LAST_S)
            self.remove()
            if isinstance(error, DAEMON_ERRORS):
                doing = f"start the mobile node on board {connection.name}"
                raise docker_error(error, doing) from None
            raise
        self.granted = Granted(**watching.granted.model_dump())
        threading.Thread(target=self._follow, name="board-node", daemon=True).start()

    def _create(self, image_id: str, volume: str, plan: NodePlan) -> None:
        client = self._connection.docker
        labels = {LABEL: plan.run_key, f"{LABEL}.role": self.role}
        client.volumes.create(self._output, labels=labels)
        self._container = client.containers.create(
            image_id,
            entrypoint=["/bin/sh", "-c", WAIT_AT_BARRIER, "slambed-node"],
            command=["--role", self.role, "--config", f"{OUTPUT}/{CONFIG}"],
            name=f"{LABEL}-{plan.run_key}-{self.role}",
            labels=labels,
            network_mode="host",
            user=f"{NODE_UID}:{NODE_UID}",
            read_only=True,
            cap_drop=["ALL"],
            security_opt=["no-new-privileges"],
            pids_limit=PIDS_LIMIT,
            volumes={
                volume: {"bind": PLACE, "mode": "ro"},
                self._output: {"bind": OUTPUT, "mode": "rw"},
            },
        )
        self._container.put_archive(OUTPUT, _to_begin_with(plan.run_dir, self.role))
        self._container.start()
        self._container.reload()
        self.pid = int(self._container.attrs["State"]["Pid"])
        if self.pid == 0:
            raise KilledError("the container of the mobile node ended at once; somebody killed it")

    def release(self) -> None:
        """Opens the start barrier."""
        self._put(START_BARRIER, "")

    def send_start(self, t0_ns: int) -> None:
        """Sends run time 0, in the board's CLOCK_MONOTONIC."""
        self._put(f"{OUTPUT}/start.json", json.dumps({"t0_ns": t0_ns}))

    def _put(self, path: str, content: str) -> None:
        doing = "write a file"
        try:
            # The folder belongs to root; the container's root has no further rights.
            code, output = self._container.exec_run(
                ["/bin/sh", "-c", PUT, path, content], user="0:0"
            )
        except DAEMON_ERRORS as error:
            self._connection.must_live(LAST_S)
            raise docker_error(error, f"{doing} on board {self._connection.name}") from None
        if code != 0 and self.exit_code() is None:
            words = output.decode(errors="replace").strip()
            raise KilledError(f"board {self._connection.name} could not {doing}: {words}")

    def exit_code(self) -> int | None:
        """Returns None while it runs. Raises KilledError once the board is lost."""
        if self._code is None:
            self._connection.must_live(0.0 if self._lost is None else LAST_S)
            if self._lost is not None:
                raise self._lost
        return self._code

    def out_of_memory(self) -> bool:
        """Returns the verdict of the board's daemon."""
        return self._oom

    def ask_to_stop(self) -> None:
        with contextlib.suppress(*DAEMON_ERRORS):
            self._container.kill("SIGTERM")

    def kill(self) -> None:
        """Sends SIGKILL and waits for the end."""
        if self._code is None and self._lost is None and self._connection.alive():
            with contextlib.suppress(*DAEMON_ERRORS):
                self._container.kill("SIGKILL")
                self._container.wait(timeout=10)

    def freeze(self, frozen: bool) -> None:
        """Freezes or continues its processes."""
        with contextlib.suppress(*DAEMON_ERRORS):
            (self._container.pause if frozen else self._container.unpause)()

    def is_frozen(self) -> bool:
        """Asks the board's daemon."""
        return is_paused(self._container)

    def remove(self) -> None:
        """Removes container and volume; on a lost board they are removed when it is back."""
        if self._removed.is_set():
            return
        self._removed.set()
        if not self._connection.alive():
            return
        client = self._connection.docker
        with contextlib.suppress(*DAEMON_ERRORS):
            if self._container is not None:
                with contextlib.suppress(NotFound):
                    self._container.remove(force=True, v=True)
            with contextlib.suppress(NotFound):
                client.volumes.get(self._output).remove()

    def _follow(self) -> None:
        """Thread with its own client: waits for the node's end and copies its files."""
        try:
            client = self._connection.client()
            container = client.containers.get(self._container.id)
            self._await_ready(container)
            code = int(container.wait(timeout=None)["StatusCode"])
            if self._removed.is_set():
                return
            container.reload()
            self._oom = bool(container.attrs["State"]["OOMKilled"])
            self._fetch(container)
            (self._folder / "log.txt").write_bytes(container.logs())
            self._code = code
        except (DockerException, *DAEMON_ERRORS, OSError, tarfile.TarError) as error:
            self._lost = KilledError(f"board {self._connection.name}: the mobile node: {error}")

    def _await_ready(self, container: Any) -> None:
        """Copies the node's ready.json shortly after it was written."""
        path = f"{OUTPUT}/{self.role}/ready.json"
        while not self._removed.is_set():
            try:
                container.get_archive(path)
            except NotFound:
                container.reload()
                if container.status != "running":
                    return
                time.sleep(LOOK_EVERY_S)
                continue
            (self._folder / "ready.json").write_text("{}")
            return

    def _fetch(self, container: Any) -> None:
        """Copies its output folder, through a temporary file because logs may be large."""
        with tempfile.TemporaryFile() as kept:
            pieces, _ = container.get_archive(f"{OUTPUT}/{self.role}", chunk_size=BLOCK_BYTES)
            for piece in pieces:
                kept.write(piece)
            kept.seek(0)
            with tarfile.open(fileobj=kept) as archive:
                archive.extractall(self._folder.parent, filter="data")


def _to_begin_with(run_dir: Path, role: str) -> bytes:
    """Returns the node's initial files: configuration, input files, and a folder that it owns."""
    made = io.BytesIO()
    with tarfile.open(fileobj=made, mode="w") as archive:
        own = tarfile.TarInfo(role)
        own.type, own.mode, own.uid, own.gid = tarfile.DIRTYPE, 0o755, NODE_UID, NODE_UID
        archive.addfile(own)
        for path in [run_dir / CONFIG, *(run_dir / "inputs").glob("*")]:
            entry = archive.gettarinfo(path, path.relative_to(run_dir).as_posix())
            entry.mode, entry.uid, entry.gid = 0o644, 0, 0
            with path.open("rb") as file:
                archive.addfile(entry, file)
    return made.getvalue()
