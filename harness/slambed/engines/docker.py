# SPDX-License-Identifier: Apache-2.0
"""Engine `docker`: two containers of one image, without network access."""

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import docker
import psutil
from docker.errors import APIError, NotFound

from slambed.engines.base import (
    LABEL,
    NODE_UID,
    Node,
    NodePlan,
    ProcessWatch,
    SegmenterSidecar,
    config_name,
    is_stopped,
    netns,
)
from slambed.engines.cgroups import V1_LARGEST_SHARES, put_before_others
from slambed.engines.docker_errors import DAEMON_ERRORS, daemon_failures, docker_error
from slambed.engines.docker_gpu import must_give_gpu
from slambed.engines.docker_image import connect, find_image, image_tag
from slambed.engines.docker_limits import limits_of, parent_group, writing_limits
from slambed.engines.docker_log import FollowedLog
from slambed.engines.docker_python import (
    build_python_image,
    image_name,
    is_made_here,
    must_have_python,
    python_volume,
)
from slambed.engines.docker_segmenter import start_segmenter
from slambed.engines.foreign import container_options, player_volumes
from slambed.engines.helper import NAMESPACES, Helper, direct_command, is_root
from slambed.engines.python_packages import version_of
from slambed.engines.this_host import ThisHostEngine
from slambed.errors import KilledError, SlambedError, environment_error
from slambed.records.manifest import EngineFacts
from slambed.sampling.cgroup import CgroupReader, paths_of
from slambed.spec.runtime import Runtime
from slambed.spec.system import Role

OUTPUT, SEQUENCE = "/out", "/sequence"
START_BARRIER = "/out/go"
# The shell waits for the start barrier, then replaces itself with the program.
WAIT_AT_BARRIER = f'until [ -e {START_BARRIER} ]; do sleep 0.02; done; exec "$0" "$@"'
PIDS_LIMIT = 256
KILL_TIMEOUT_S = 10


class DockerNode:
    """A running container whose shell waits at the start barrier and then becomes the node."""

    def __init__(
        self,
        role: Role,
        container: Any,
        run_dir: Path,
        pid: int,
        namespace: Path,
        keeper: Any | None = None,
        limit_bytes: int | None = None,
        *,
        several_processes: bool = False,
    ) -> None:
        self.role = role
        self.pid = pid
        self.namespace = namespace
        self.sandbox = str((keeper or container).attrs["NetworkSettings"]["SandboxKey"])
        """File through which the daemon holds the network namespace."""
        self.container = container
        self.several_processes = several_processes
        """True for a system with its own program, which runs next to slambed-play."""
        self.keeper = keeper
        """The container whose network this one uses, if it will be killed."""
        self._run_dir = run_dir
        self._watch = ProcessWatch(pid)
        self.reader = CgroupReader(paths_of(pid))
        self.granted = self.reader.granted()
        self._code: int | None = None
        self._removed = False
        self._log = FollowedLog(container, run_dir / role / "log.txt", limit_bytes)

    def release(self) -> None:
        """Opens the start barrier of both containers, which share the output folder."""
        (self._run_dir / "go").touch()

    def exit_code(self) -> int | None:
        """Returns None while it runs; asks the daemon only once the process has ended."""
        if self._code is None and not self._watch.alive():
            # An unknown exit code does not count as a result of the node: the error propagates.
            self._code = int(self.container.wait(timeout=KILL_TIMEOUT_S)["StatusCode"])
            self._log.whole(KILL_TIMEOUT_S)
        return self._code

    def out_of_memory(self) -> bool:
        """Returns the daemon's verdict."""
        self.container.reload()
        return bool(self.container.attrs["State"]["OOMKilled"])

    def ask_to_stop(self) -> None:
        with contextlib.suppress(APIError):
            self.container.kill("SIGTERM")

    def kill(self) -> None:
        if self._watch.alive():
            with contextlib.suppress(APIError):
                self.container.kill("SIGKILL")
            self._watch.wait(KILL_TIMEOUT_S)

    def freeze(self, frozen: bool) -> None:
        """Sends SIGSTOP or SIGCONT. Several processes would receive it one after the other, so
        these are frozen by the kernel's freezer."""
        with contextlib.suppress(APIError):
            if self.several_processes:
                (self.container.pause if frozen else self.container.unpause)()
            else:
                self.container.kill("SIGSTOP" if frozen else "SIGCONT")

    def is_frozen(self) -> bool:
        """Asks the daemon about a paused container: its processes do not count as stopped."""
        return is_paused(self.container) if self.several_processes else is_stopped(self.pid)

    def remove(self) -> None:
        """Removes the container, and the one that held its network."""
        if self._removed:
            return
        self._removed = True
        with contextlib.ExitStack() as removals:
            removals.callback(self._watch.close)
            for container in filter(None, (self.keeper, self.container)):
                removals.callback(_remove, container)
        self._log.whole(KILL_TIMEOUT_S)

    def give_up(self) -> None:
        """Hands the container over to another node object."""
        self._removed = True
        self._log.whole(KILL_TIMEOUT_S)
        self._watch.close()


class DockerEngine(ThisHostEngine):
    """Runs nodes in containers of a daemon on this host. Without root privileges this needs
    membership in the group docker; helper containers then set up the link and thread limits."""

    name = "docker"

    def __init__(
        self,
        client: docker.DockerClient | None = None,
        image: Any | None = None,
        program: str = "slambed-node",
        for_questions: bool = False,
    ) -> None:
        """`for_questions`: it only answers queries and needs no image."""
        self._client = client or connect()
        self.unprivileged = not is_root()
        self._parent: str | None = None
        """Parent cgroup of all nodes, once the daemon has confirmed that it can create it."""
        self._program = program
        self._nodes: dict[Role, DockerNode] = {}
        self._ids: dict[str, str] = {}
        """Image name -> id of the systems' own images, when the campaign began."""
        self._with_python: set[tuple[str, str]] = set()
        """Ids of users' images that have the Python of their packages, with its version."""
        self._run_key = ""
        self._for_questions = for_questions
        self._image = image or find_image(self._client)
        if self._image is None and not for_questions:
            raise environment_error(f"image {image_tag()} is not built; run 'slambed images'")

    def sequence_path(self, sequence: Path, role: Role) -> str:
        """Mount point of the sequence."""
        return SEQUENCE

    def output_path(self, run_dir: Path, role: Role) -> str:
        """Mount point of the run folder."""
        return OUTPUT

    def describe(self) -> EngineFacts:
        """Tag and id of the image."""
        assert self._image is not None
        return EngineFacts(image=next(iter(self._image.tags), None), image_id=self._image.id)

    def image_ids(self, runtime: Runtime, system: str) -> dict[str, str]:
        """Returns current ids: a name may refer to another image later."""
        found: dict[str, str] = {}
        roles: tuple[Role, ...] = ("mobile",) if runtime.edge is None else ("mobile", "edge")
        for role in roles:
            if not (name := image_name(runtime, role, system)):
                raise SlambedError(
                    f"system {system} names no image for engine docker; write runtime.image, or "
                    "use --engine local"
                )
            found[role] = self._ids[name] = self._id_of(name, runtime, role, system)
        # A query starts no container, which would be needed to test for a GPU.
        for gpu in runtime.gpus if not self._for_questions else ():
            assert self._image is not None
            must_give_gpu(self._client, str(self._image.id), gpu, system)
        return found

    def _id_of(self, name: str, runtime: Runtime, role: Role, system: str) -> str:
        """Returns the id of an image, which is made now if it is slambed's own."""
        made_here = is_made_here(runtime, role)
        with daemon_failures(f"look for image {name}"):
            try:
                image = self._client.images.get(name)
            except NotFound:
                if not made_here:
                    raise environment_error(
                        f"system {system}: there is no image {name} on this host; build it as the "
                        "system's README says"
                    ) from None
                if self._for_questions:
                    raise environment_error(
                        f"system {system}: its image {name} is not made yet; 'slambed run' makes it"
                    ) from None
                assert runtime.python is not None
                build_python_image(runtime.python, name, system)
                image = self._client.images.get(name)
            if runtime.python is not None and not made_here and not self._for_questions:
                asked = (str(image.id), version_of(runtime.python))
                if asked not in self._with_python:
                    must_have_python(self._client, name, asked[1], system)
                    self._with_python.add(asked)
            return str(image.id)

    def start(self, plan: NodePlan) -> Node:
        """Creates a container at the start barrier."""
        role_dir = plan.run_dir / plan.role
        role_dir.mkdir(parents=True, exist_ok=True)
        foreign_user = plan.runtime is not None and bool(plan.runtime.of(plan.role).user)
        if self.unprivileged or foreign_user:
            role_dir.chmod(0o777)
        else:
            os.chown(role_dir, NODE_UID, NODE_UID)
        if plan.run_key != self._run_key:
            self._nodes, self._run_key = {}, plan.run_key
        made: list[Any] = []
        try:
            if plan.dies:
                made.append(self._create_keeper(plan))
                _started(made[0])
            made.append(self._create(plan, made[0] if made else None))
            return self._node(plan, made[-1], made[0] if plan.dies else None)
        except BaseException as error:
            with contextlib.suppress(*DAEMON_ERRORS):
                for container in reversed(made):
                    _remove(container)
            if isinstance(error, DAEMON_ERRORS):
                raise docker_error(error, f"start the {plan.role} node") from None
            raise

    def start_again(self, plan: NodePlan, dead: Node) -> Node:
        """Restarts the same container: its start barrier is open, and its network still exists."""
        assert isinstance(dead, DockerNode)
        with daemon_failures(f"start the {plan.role} node again"):
            # Until the daemon knows that it has ended, it would not start it.
            dead.exit_code()
            node = self._node(plan, dead.container, dead.keeper)
        dead.give_up()
        return node

    def start_segmenter(self, plan: NodePlan, edge: Node, network: str) -> SegmenterSidecar:
        """Starts a container next to the edge's."""
        with daemon_failures("start the segmenter"):
            return start_segmenter(self._client, self._image, plan, edge.pid, network)

    def _node(self, plan: NodePlan, container: Any, keeper: Any | None) -> DockerNode:
        try:
            return self._waiting(plan, container, keeper)
        except OSError:
            # A container at the start barrier is a waiting shell, which only ends if it is killed.
            raise KilledError(f"the container of the {plan.role} node was killed") from None

    def _waiting(self, plan: NodePlan, container: Any, keeper: Any | None) -> DockerNode:
        pid = _started(container)
        if self._parent is not None:
            put_before_others(paths_of(pid))
        inside = netns(pid if keeper is None else int(keeper.attrs["State"]["Pid"]))
        namespace = NAMESPACES / plan.role if self.unprivileged else inside
        node = DockerNode(
            plan.role,
            container,
            plan.run_dir,
            pid,
            namespace,
            keeper,
            plan.limit_bytes,
            several_processes=plan.runtime is not None,
        )
        self._nodes[plan.role] = node
        return node

    def sidecar_command(
        self, module: str, writable: list[Path], readable: Sequence[Path] = ()
    ) -> list[str]:
        """Returns a child process command for root, otherwise a helper container."""
        if not self.unprivileged:
            return direct_command(module)
        assert self._image is not None
        namespaces = {str(role): node.sandbox for role, node in self._nodes.items()}
        helper = Helper(str(self._image.id), self._run_key, namespaces)
        self._clear(helper.container(module))
        return helper.command(module, writable, readable)

    def _clear(self, name: str) -> str:
        """Makes the name available: the daemon may have been unreachable when a failed attempt
        ended."""
        with contextlib.suppress(NotFound):
            self._client.containers.get(name).remove(force=True, v=True)
        return name

    def _create_keeper(self, plan: NodePlan) -> Any:
        """Creates a container that only holds a network namespace."""
        assert self._image is not None
        return self._client.containers.create(
            self._image.id,
            entrypoint=["/bin/sleep", "infinity"],
            name=self._clear(f"{LABEL}-{plan.run_key}-{plan.role}-network"),
            labels={LABEL: plan.run_key, f"{LABEL}.role": "network"},
            network_mode="none",
            user=f"{NODE_UID}:{NODE_UID}",
            read_only=True,
            cap_drop=["ALL"],
            security_opt=["no-new-privileges"],
            pids_limit=1,
        )

    def _create(self, plan: NodePlan, keeper: Any | None) -> Any:
        assert self._image is not None
        if self._parent is None and not self.unprivileged:
            self._parent = parent_group(self._client)
        parent: dict[str, Any] = {"cgroup_parent": self._parent} if self._parent else {}
        return self._client.containers.create(
            **(self._our_program(plan) if plan.runtime is None else self._foreign_program(plan)),
            name=self._clear(f"{LABEL}-{plan.run_key}-{plan.role}"),
            labels={LABEL: plan.run_key, f"{LABEL}.role": plan.role},
            network_mode=_network(plan, keeper),
            read_only=True,
            cap_drop=["ALL"],
            security_opt=["no-new-privileges"],
            pids_limit=PIDS_LIMIT,
            cpu_shares=V1_LARGEST_SHARES,
            **parent,
            **limits_of(plan),
            **writing_limits(plan),
        )

    def _our_program(self, plan: NodePlan) -> dict[str, Any]:
        assert self._image is not None
        return {
            "image": self._image.id,
            "entrypoint": ["/bin/sh", "-c", WAIT_AT_BARRIER, self._program],
            "command": ["--role", plan.role, "--config", f"{OUTPUT}/{config_name(plan)}"],
            "user": f"{NODE_UID}:{NODE_UID}",
            "volumes": _volumes(plan),
        }

    def _foreign_program(self, plan: NodePlan) -> dict[str, Any]:
        assert plan.runtime is not None
        name = image_name(plan.runtime, plan.role, str(plan.system_folder))
        config = f"{OUTPUT}/{config_name(plan)}"
        program = container_options(plan, self._ids.get(name, name), config, START_BARRIER)
        volumes = _volumes(plan) | player_volumes(plan) | python_volume(plan)
        return program | {"volumes": volumes}


def _network(plan: NodePlan, keeper: Any | None) -> str:
    if keeper is not None:
        return f"container:{keeper.id}"
    return "host" if plan.host_network else "none"


def _volumes(plan: NodePlan) -> dict[str, dict[str, str]]:
    return {
        str(plan.sequence.resolve()): {"bind": SEQUENCE, "mode": "ro"},
        str(plan.run_dir.resolve()): {"bind": OUTPUT, "mode": "rw"},
    }


def is_paused(container: Any) -> bool:
    """Returns whether the kernel's freezer holds the processes of a container; False if it has
    gone, or its daemon has."""
    try:
        container.reload()
    except DAEMON_ERRORS:
        return False
    return bool(container.attrs["State"]["Paused"])


def _remove(container: Any) -> None:
    with contextlib.suppress(NotFound):
        container.remove(force=True, v=True)


def _started(container: Any) -> int:
    """Starts the container; returns its process id on this host."""
    container.start()
    container.reload()
    pid = int(container.attrs["State"]["Pid"])
    if pid == 0:
        raise KilledError(f"container {container.short_id} ended at once; somebody killed it")
    if not psutil.pid_exists(pid):
        raise environment_error(
            f"container {container.short_id} has no process on this host; "
            "slambed needs a daemon on the same machine"
        )
    return pid
