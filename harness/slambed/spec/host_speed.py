# SPDX-License-Identifier: Apache-2.0
"""Core speed of this host: measured by `slambed calibrate --host` and kept in the cache."""

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
    """Speed of one core; 1 is a core of the reference host (docs/explanation/limits.md)."""

    speed: float
    spread: float | None = None
    """(Maximum - minimum) of the measurements, relative; None when nothing was measured."""
    measured_utc: str | None = None


UNKNOWN = HostSpeed(1.0)
"""Assumed without a calibration: a core is as fast as one of the reference host."""


def host_identity() -> dict[str, str | int | None]:
    """Identifies the host that a measured speed belongs to."""
    try:
        machine = Path("/etc/machine-id").read_text(encoding="ascii").strip()[:12]
    except OSError:
        machine = None
    return {"machine": machine, "cpu": cpu_model(), "cores": os.cpu_count()}


@cache
def cpu_model() -> str:
    """CPU model as the kernel reports it."""
    for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model"):
            return value.strip()
    return platform.machine()


def load_host_speed(folder: Path | None = None) -> HostSpeed:
    """Returns the speed measured on this host; UNKNOWN without a measurement or on another host."""
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
    """Stores the speed in the cache for the engines, atomically."""
    path = (folder or cache_folder()) / FILE
    content = {"format": FORMAT, "host": host_identity(), "measured": asdict(speed)}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as out:
            out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise environment_error(f"cannot write {path}: {error.strerror}") from None
    return path
