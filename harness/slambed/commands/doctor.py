# SPDX-License-Identifier: Apache-2.0
"""The checks of `slambed doctor`: what this machine can do, and what each missing part prevents."""

import os
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from slambed.engines.docker_errors import daemon_failures
from slambed.engines.docker_image import connect, find_image, image_tag
from slambed.engines.docker_kinds import shortcomings
from slambed.engines.python_packages import must_have_debian_packages
from slambed.errors import SlambedError
from slambed.isolation import left_out
from slambed.native import find_program, repository_root
from slambed.process.cpus import own_cpus
from slambed.sampling.cgroup import version as cgroup_version
from slambed.spec.host_speed import cpu_model, load_host_speed
from slambed.spec.library import Library
from slambed.spec.software import host_software

Level = Literal["good", "missing", "fatal"]
MIN_CORES = 2
MIN_FREE_GB = 5
_LIVE = "no live runs"
PROGRAMS = {
    "slambed-node": _LIVE, "slambed-sim": "no virtual runs", "slambed-relay": _LIVE,
    "slambed-pace": _LIVE, "slambed-synth": "no generated sequences",
    "slambed-play": "no runs of your own SLAM system",
}  # fmt: skip
"""Program -> what does not work without it."""


@dataclass(frozen=True)
class Finding:
    """One line of the doctor's table."""

    topic: str
    level: Level
    found: str
    cost: str = ""
    """What does not work without it, and what to do."""


def examine() -> list[Finding]:
    """Returns all findings; a failed check does not stop the others."""
    checks: list[Callable[[], Finding]] = [
        _system,
        _python,
        _cores,
        _speed,
        _privilege,
        _docker,
        _image,
        _programs,
        _cgroups,
        _namespaces,
        _netem,
        _tun,
        _disk,
        _data,
    ]
    return [check() for check in checks] + _own_systems()


def _own_systems() -> list[Finding]:
    """Returns a line for each system in the folders of $SLAMBED_SYSTEMS."""
    library = Library()
    findings = []
    for name in sorted(set(library.known_systems()) - set(library.systems())):
        topic = f"system {name}"
        try:
            system, folder = library.system(name), library.system_file(name).parent
            assert system.runtime is not None
            if system.runtime.python is not None:
                must_have_debian_packages(system.runtime.python, folder)
        except SlambedError as error:
            cost = "no runs of it on engine local"
            findings.append(Finding(topic, "missing", str(error), cost))
        else:
            findings.append(Finding(topic, "good", str(folder)))
    return findings


def can_run(findings: list[Finding]) -> bool:
    """Returns False when no live experiment can run on this machine."""
    return all(finding.level != "fatal" for finding in findings)


def _system() -> Finding:
    name = platform.freedesktop_os_release().get("PRETTY_NAME", "unknown system")
    return Finding("system", "good", f"{name}, kernel {platform.release()}, {cpu_model()}")


def _python() -> Finding:
    found = f"{platform.python_version()} in {sys.prefix}, code in {repository_root()}"
    if not left_out:
        return Finding("python", "good", found)
    cost = f"packages of PYTHONPATH are other software's and are left out: {', '.join(left_out)}"
    return Finding("python", "good", found, cost)


def _cores() -> Finding:
    count = len(own_cpus())
    if count < MIN_CORES:
        cost = "both nodes, link and sampler share one core: timings are not valid"
        return Finding("cores", "missing", f"{count}", cost)
    return Finding("cores", "good", f"{count}")


def _privilege() -> Finding:
    if os.geteuid() == 0:
        return Finding("privilege", "good", "root")
    found = f"user {os.geteuid()}, not root"
    try:
        connect().close()
    except SlambedError:
        cost = (
            "live runs join and shape network namespaces: run 'slambed run' with sudo, or join "
            "the group docker; --engine virtual needs neither"
        )
        return Finding("privilege", "fatal", found, cost)
    cost = "engine docker works, by helper containers; engine local needs sudo"
    return Finding("privilege", "good", f"{found}, but the Docker daemon listens", cost)


def _speed() -> Finding:
    speed = load_host_speed()
    if speed.measured_utc is None:
        cost = "a core is taken for one of the reference host's: 'slambed calibrate --host'"
        return Finding("speed", "missing", "not measured", cost)
    return Finding("speed", "good", f"{speed.speed:.2f} of a core of the reference host")


def _docker() -> Finding:
    try:
        client = connect()
    except SlambedError as error:
        return Finding("docker", "missing", str(error), "engine local is used; same measurements")
    try:
        with daemon_failures("describe itself"):
            info = client.info()
    except SlambedError as error:
        return Finding("docker", "missing", str(error), "engine local is used; same measurements")
    finally:
        client.close()
    found = f"Engine {info.get('ServerVersion')}"
    if lines := shortcomings(info):
        return Finding("docker", "missing", found, "; ".join(lines))
    return Finding("docker", "good", found)


def _image() -> Finding:
    try:
        client = connect()
    except SlambedError:
        return Finding("image", "missing", "no Docker", "engine local needs none")
    try:
        found = find_image(client)
    except SlambedError as error:
        return Finding("image", "missing", str(error), "engine local needs none")
    finally:
        client.close()
    if found is None:
        cost = "built by the next run with engine docker, or by 'slambed images'"
        return Finding("image", "missing", f"{image_tag()} is not built", cost)
    return Finding("image", "good", image_tag())


def _programs() -> Finding:
    costs: dict[str, str] = {}
    for name, cost in PROGRAMS.items():
        try:
            folder = find_program(name).parent
        except SlambedError as error:
            costs.setdefault(cost, str(error))
    if costs:
        return Finding("programs", "missing", next(iter(costs.values())), ", ".join(costs))
    try:
        host_software()
    except SlambedError as error:
        return Finding("programs", "missing", str(error), "no runs, live or virtual")
    return Finding("programs", "good", f"{folder}")


def _cgroups() -> Finding:
    found = cgroup_version()
    if found == "none":
        cost = "no CPU and memory limits, no CPU figures: mount the cgroup file system"
        return Finding("cgroups", "fatal", "no cpu controller", cost)
    return Finding("cgroups", "good", found)


def _namespaces() -> Finding:
    if not Path("/proc/self/ns/net").exists():
        return Finding("namespaces", "fatal", "none", "no live runs: CONFIG_NET_NS is needed")
    return Finding("namespaces", "good", "network namespaces")


def _netem() -> Finding:
    from slambed.link.netem import netem_available

    if netem_available():
        return Finding("netem", "good", "in the kernel")
    cost = "the relay emulates the link instead (same profiles, a few percent of a core)"
    return Finding("netem", "missing", "not in this kernel, or no permission to ask", cost)


def _tun() -> Finding:
    if Path("/dev/net/tun").exists():
        return Finding("tun", "good", "/dev/net/tun")
    cost = "no relay link: 'modprobe tun', or a kernel with netem"
    return Finding("tun", "missing", "no /dev/net/tun", cost)


def _disk() -> Finding:
    free_gb = shutil.disk_usage(Path.cwd()).free / 1e9
    if free_gb < MIN_FREE_GB:
        return Finding("disk", "missing", f"{free_gb:.1f} GB free", f"wants {MIN_FREE_GB} GB")
    return Finding("disk", "good", f"{free_gb:.0f} GB free")


def _data() -> Finding:
    from slambed.data.catalog import Catalog

    try:
        catalog = Catalog.load()
        real = [d for d in catalog.datasets.values() if not d.synthetic and not d.first_of]
        here = [d.id for d in real if catalog.available(d)]
        if catalog.broken:
            raise next(iter(catalog.broken.values()))
    except SlambedError as error:
        return Finding("data", "missing", str(error), "see 'slambed data list'")
    if not here:
        cost = "experiments play synthetic sequences; 'slambed data list' says how to get real ones"
        return Finding("data", "missing", "no recorded sequence found", cost)
    return Finding("data", "good", f"{', '.join(here)} and synthetic ones")
