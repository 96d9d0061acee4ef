# SPDX-License-Identifier: Apache-2.0
"""The environments of systems with `runtime: python:`: made once per set of requirements, kept in
the cache and read by nodes of every engine (docs/reference/system.md)."""

import hashlib
import json
import platform
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from slambed.data.places import PYTHON, making
from slambed.errors import SlambedError, environment_error
from slambed.files.atomic import replacing
from slambed.native import cache_folder
from slambed.spec.runtime import PythonPackages

LOCK = "installed.txt"
"""Written last: an environment without it is incomplete."""
KEY_DIGITS = 12
INSTALL_LIMIT_S = 1800.0
# -I: packages of the user's PYTHONPATH would count as installed.
PIP = ("-I", "-m", "pip", "--disable-pip-version-check", "--no-input")


@dataclass(frozen=True)
class PythonEnvironment:
    """One environment of the cache."""

    folder: Path
    version: str
    """Minor version of its Python, such as 3.11."""
    lock: str
    """Its packages, a line `name==version` each, sorted; empty before it is made."""

    @property
    def programs(self) -> Path:
        """Folder of its python3."""
        return self.folder / "bin"

    @property
    def packages_inside(self) -> str:
        """Its packages, relative to `folder`."""
        return f"lib/python{self.version}/site-packages"

    @property
    def versions(self) -> dict[str, str]:
        """Package -> version."""
        return dict(line.split("==", 1) for line in self.lock.splitlines() if "==" in line)


def version_of(python: PythonPackages) -> str:
    """Returns the minor version of Python that a system's packages are for."""
    return python.version or f"3.{sys.version_info.minor}"


def find_environment(python: PythonPackages, system: Path) -> PythonEnvironment:
    """Returns the environment of a system, which may not be made yet. `system` is the folder of
    its system.yaml. Raises SlambedError for a missing requirements file."""
    version = version_of(python)
    meaning = {
        "requires": python.requires,
        "requirements": _text_of(python, system),
        "python": version,
        "platform": sysconfig.get_platform(),
        # A binary package fits the libc of its host.
        "libc": "-".join(platform.libc_ver()),
    }
    key = hashlib.sha256(json.dumps(meaning, sort_keys=True).encode()).hexdigest()[:KEY_DIGITS]
    folder = (cache_folder() / PYTHON / key).resolve()
    lock = folder / LOCK
    return PythonEnvironment(folder, version, lock.read_text() if lock.is_file() else "")


def kept_environment(python: PythonPackages, system: Path) -> PythonEnvironment:
    """Returns the environment. Raises SlambedError if it would have to be made."""
    found = find_environment(python, system)
    if not found.lock:
        raise SlambedError(
            f"the Python packages of {system / 'system.yaml'} are not installed yet; "
            "'slambed run' installs them"
        )
    return found


def make_environment(
    python: PythonPackages, system: Path, notify: Callable[[str], None]
) -> PythonEnvironment:
    """Returns the environment, and installs it if it is missing.

    Raises SlambedError in one line if the Python version or a package cannot be had; then nothing
    is kept.
    """
    found = find_environment(python, system)
    if found.lock:
        return found
    what = f"installs the Python packages of {system.name}"
    with making(found.folder.parent, found.folder.name, what, notify):
        found = find_environment(python, system)
        if not found.lock:
            notify(
                f"installing the Python packages of {system.name}: "
                f"{', '.join(python.requires) or python.requirements} (Python {found.version})"
            )
            # An environment holds its own path, so it is made in its final place.
            shutil.rmtree(found.folder, ignore_errors=True)
            try:
                _install(python, system, found)
            except BaseException:
                shutil.rmtree(found.folder, ignore_errors=True)
                raise
    return find_environment(python, system)


def must_have_debian_packages(python: PythonPackages, system: Path) -> None:
    """Raises SlambedError if Debian packages that the system needs are not on this host. A host
    without dpkg is not asked: its packages have other names."""
    if not python.apt or shutil.which("dpkg-query") is None:
        return
    command = ["dpkg-query", "-W", "-f", "${Package} ${db:Status-Status}\n", *python.apt]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    installed = {
        line.split()[0] for line in done.stdout.splitlines() if line.endswith(" installed")
    }
    if missing := [name for name in python.apt if name not in installed]:
        raise environment_error(
            f"system {system.name} needs Debian packages that are not installed: "
            f"{', '.join(missing)}; run 'sudo apt-get install {' '.join(missing)}'"
        )


def _text_of(python: PythonPackages, system: Path) -> str:
    if not python.requirements:
        return ""
    path = system / python.requirements
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise SlambedError(f"{path}: {why}; correct python.requirements") from None


def _install(python: PythonPackages, system: Path, into: PythonEnvironment) -> None:
    _run([_interpreter(into.version, system), "-m", "venv", str(into.folder)], system)
    program = str(into.programs / "python3")
    wanted = (
        ["-r", str(system / python.requirements)] if python.requirements else [*python.requires]
    )
    _run([program, *PIP, "install", *wanted], system)
    installed = _run([program, *PIP, "list", "--format=json"], system)
    lines = {f"{item['name']}=={item['version']}" for item in json.loads(installed)}
    tools = ("pip==", "setuptools==", "wheel==")
    lock = "\n".join(sorted(line for line in lines if not line.startswith(tools))) + "\n"
    with replacing(into.folder / LOCK) as file:
        file.write_text(lock)


def _interpreter(version: str, system: Path) -> str:
    """Returns a Python of this minor version."""
    if version == f"3.{sys.version_info.minor}":
        # An environment of slambed's own environment would keep a link to that one.
        base = Path(sys.base_prefix) / "bin" / f"python{version}"
        return str(base) if base.is_file() else sys.executable
    if (found := shutil.which(f"python{version}")) is None:
        raise environment_error(
            f"system {system.name} needs Python {version}, and there is no python{version} on this "
            "host; install it, or correct python.version of its system.yaml"
        )
    return found


def _run(command: list[str], system: Path) -> str:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=INSTALL_LIMIT_S
        )
    except subprocess.TimeoutExpired:
        raise environment_error(
            f"the Python packages of {system.name} were not installed within "
            f"{INSTALL_LIMIT_S / 60:.0f} minutes; try again"
        ) from None
    if done.returncode != 0:
        raise environment_error(
            f"the Python packages of {system.name} cannot be installed: {_reason(done.stderr)}; "
            "correct python in its system.yaml, or check the network"
        )
    return done.stdout


def _reason(printed: str) -> str:
    """Returns the last error of pip, which names the package."""
    lines = [line.strip() for line in printed.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    return (errors[-1:] or lines[-1:] or ["it printed nothing"])[0]
