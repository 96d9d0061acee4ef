# SPDX-License-Identifier: Apache-2.0
"""How fast a core of this host is: measured by `slambed calibrate --host`, kept in the cache."""

import json
import os
import platform
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from slambed.data.places import cache_folder
from slambed.errors import environment_error
from slambed.files.atomic import replacing
from slambed.files.json_file import read_object

FORMAT = "slambed-host-speed"
FILE = "host_speed.json"


@dataclass(frozen=True)
class HostSpeed:
    """Speed of one core; 1 is the reference host's (docs/explanation/limits.md)."""

    speed: float
    spread: float | None = None
    """Largest minus smallest of the measurements, relative; None when nothing was measured."""
    measured_utc: str | None = None


UNKNOWN = HostSpeed(1.0)
"""Without a calibration a core is taken for one of the reference host's."""


def host_identity() -> dict[str, str | int | None]:
    """What a measured speed belongs to."""
    try:
        machine = Path("/etc/machine-id").read_text(encoding="ascii").strip()[:12]
    except OSError:
        machine = None
    return {"machine": machine, "cpu": cpu_model(), "cores": os.cpu_count()}


@cache
def cpu_model() -> str:
    """As the kernel names it."""
    for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model"):
            return value.strip()
    return platform.machine()


def load_host_speed(folder: Path | None = None) -> HostSpeed:
    """What was measured on this host; UNKNOWN when nothing was, or on another host."""
    path = (folder or cache_folder()) / FILE
    content = read_object(path) or {}
    if content.get("format") != FORMAT or content.get("host") != host_identity():
        return UNKNOWN
    try:
        speed = HostSpeed(**content["measured"])
    except (KeyError, TypeError):
        return UNKNOWN
    return speed if speed.speed > 0 else UNKNOWN


def save_host_speed(speed: HostSpeed, folder: Path | None = None) -> Path:
    """Keeps it for the engines, by one rename."""
    path = (folder or cache_folder()) / FILE
    content = {"format": FORMAT, "host": host_identity(), "measured": asdict(speed)}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as out:
            out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise environment_error(f"cannot write {path}: {error.strerror}") from None
    return path
