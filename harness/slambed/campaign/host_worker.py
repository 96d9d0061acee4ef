# SPDX-License-Identifier: Apache-2.0
"""A host's side of a campaign on several hosts: `python -m slambed.campaign.host_worker`.

The campaign starts it by ssh, or as a child if the host is `here`. It answers the messages of
`host_messages`, one per line. After the second one it is a worker of the campaign's Dask scheduler
and holds the lock of the host. It ends with its input, even if the campaign or the connection dies,
and ends the nodes of its run.
"""

import asyncio
import hashlib
import logging
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rich.console import Console

import slambed
from slambed.campaign import server_folder
from slambed.campaign.cluster import imported
from slambed.campaign.host_messages import AskPorts, FreePorts, JoinCampaign, Joined, Request
from slambed.campaign.host_run import ThisHost, begin
from slambed.engines.host_lock import host_lock
from slambed.errors import environment_error
from slambed.failures import line_and_code
from slambed.process.cpus import own_cpus
from slambed.process.line_protocol import (
    Failure,
    LineReader,
    Message,
    Note,
    adapter,
    last_answer,
    message_in,
    send,
)
from slambed.records.manifest import RunHost
from slambed.spec.host_speed import HostSpeed, cpu_model, load_host_speed

SCRATCH = "slambed-host-"
"""Name prefix of the scratch folders of runs; a killed worker leaves its folder behind."""
LOST_S = 60.0
"""A scheduler that is silent for this long is considered gone."""
LAST_RUN_S = 30.0
"""Time for the last run to clean up after it was told to end."""


def harness_digest() -> str:
    """Returns a digest of the harness's Python files: pickled objects need identical code on
    both sides."""
    root = Path(slambed.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:12]


def main() -> None:
    """Answers up to two requests, then works until the input ends."""
    # Output of libraries must not mix with the answers.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    requests = LineReader(sys.stdin.fileno())
    answer = partial(send, answers)
    with last_answer(answer, _described):
        while (line := requests.next(None)) is not None:
            request = message_in(line, adapter(Request), "campaign")
            if isinstance(request, AskPorts):
                scheduler, worker = _free_ports()
                answer(FreePorts(scheduler=scheduler, worker=worker, harness=harness_digest()))
            else:
                _work(request, requests, answer)
                return


def _described(error: Exception) -> Failure:
    line, code = line_and_code(error)
    return Failure(error=line, code=code)


def _free_ports() -> tuple[int, int]:
    with socket.socket() as one, socket.socket() as other:
        one.bind(("127.0.0.1", 0))
        other.bind(("127.0.0.1", 0))
        return one.getsockname()[1], other.getsockname()[1]


def _work(asked: JoinCampaign, requests: LineReader, answer: Callable[[Message], None]) -> None:
    # Importing containers and links takes 0.5 s, which a request for ports does not need.
    from slambed.campaign.choose import check_privilege, choose_engine
    from slambed.campaign.quiet import wait_for_quiet
    from slambed.engines.docker_image import build_image
    from slambed.engines.reaper import mark_children, reap
    from slambed.link.helper_link import HelperLinkOpener
    from slambed.link.netem import netem_available
    from slambed.link.run_link import open_for_run

    check_privilege(asked.engine)
    cpus = _choose_cpus(asked.cores)
    with ExitStack() as until_the_end:
        tidied, load = "", "not taken, only asked"
        notice = partial(_note, answer)
        # If the waiting campaign ends, so does the input.
        ended = partial(requests.next, 0.0)
        if asked.take:
            purpose = f"runs of a campaign that calls this host {asked.name}"
            until_the_end.enter_context(
                host_lock(purpose, wait_s=asked.wait_s, notify=notice, meanwhile=ended)
            )
            until_the_end.enter_context(mark_children())
            tidied = str(reap())
        build = build_image if asked.take else None
        engine, software = choose_engine(asked.engine, Console(stderr=True), build)
        speed = _speed(asked.measure)
        if asked.take:
            load = str(wait_for_quiet(asked.quiet_s, threading.Event(), notice, ended))
        server_folder.sweep(SCRATCH)
        scratch = Path(tempfile.mkdtemp(prefix=SCRATCH))
        # Nodes may leave what only root can remove.
        until_the_end.callback(shutil.rmtree, scratch, ignore_errors=True)
        until_the_end.callback(os.close, server_folder.locked(scratch))
        scratch.chmod(0o755)  # nodes run as another user and need access
        facts = RunHost(
            name=asked.name,
            labels=asked.labels,
            cpus=cpus,
            speed=speed.speed,
            speed_measured_utc=speed.measured_utc,
        )
        open_link = HelperLinkOpener(engine) if engine.unprivileged else open_for_run
        host = ThisHost(engine, open_link, facts, scratch)
        begin(host)

        def joined(worker: str) -> None:
            answer(
                Joined(
                    worker=worker,
                    software=software,
                    netem=netem_available(),
                    cpu_model=cpu_model(),
                    cpus=cpus,
                    speed=speed.speed,
                    speed_measured_utc=speed.measured_utc,
                    load=load,
                    tidied=tidied,
                )
            )

        asyncio.run(_serve(asked, host, requests, joined))


def _note(answer: Callable[[Message], None], line: str) -> None:
    answer(Note(line=line))


def _choose_cpus(cores: int | None) -> list[int]:
    """Restricts this process and its children, which include the runs, to these CPUs."""
    cpus = own_cpus()
    if cores is None:
        return cpus
    if cores > len(cpus):
        raise environment_error(f"it has {len(cpus)} CPUs, and shall give runs {cores}")
    os.sched_setaffinity(0, cpus[:cores])
    return cpus[:cores]


def _speed(measure: bool) -> HostSpeed:
    """Returns the speed of this host, measured now if that is required and missing."""
    speed = load_host_speed()
    if measure and speed.measured_utc is None:
        command = [sys.executable, "-c", "from slambed.commands.main import main; main()"]
        done = subprocess.run(
            [*command, "calibrate", "--host"], capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            line = (done.stderr.strip().splitlines() or [str(done.returncode)])[-1]
            raise environment_error(f"its speed cannot be measured: {line}")
        speed = load_host_speed()
    return speed


async def _serve(
    asked: JoinCampaign, host: ThisHost, requests: LineReader, joined: Callable[[str], None]
) -> None:
    """Runs a worker with one thread until the campaign or its scheduler has gone."""
    distributed = imported("distributed", "--hosts")
    security = imported("distributed.security", "--hosts").Security(
        tls_ca_file=asked.certificate,
        tls_worker_cert=asked.certificate,
        tls_worker_key=asked.key,
        require_encryption=True,
    )
    # ssh or the answer already reports everything that matters.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    worker = distributed.Worker(
        asked.scheduler,
        nthreads=1,
        name=asked.name,
        host="127.0.0.1",
        port=asked.port,
        contact_address=asked.contact,
        protocol="tls",
        security=security,
        local_directory=str(host.scratch),
        dashboard=False,
        memory_limit=0,
        death_timeout=LOST_S,
    )
    await worker
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def end() -> None:
        host.stop.set()
        ended.set()

    def listen() -> None:
        try:
            while requests.next(None) is not None:
                pass
        except EOFError:
            loop.call_soon_threadsafe(end)

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        loop.add_signal_handler(number, end)
    threading.Thread(target=listen, daemon=True).start()
    joined(worker.contact_address or worker.address)
    waiting = {asyncio.create_task(work) for work in (ended.wait(), worker.finished())}
    await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
    end()
    # The current run first removes its nodes, link and cgroups.
    if await asyncio.to_thread(host.busy.acquire, timeout=LAST_RUN_S):
        host.busy.release()
    await worker.close(timeout=5)


if __name__ == "__main__":
    main()
