# SPDX-License-Identifier: Apache-2.0
"""A user without root privileges but with access to a Docker daemon, and a Python for that user."""

import shutil
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

NOBODY = 65534
SYSTEM_PYTHON = "/usr/bin/python3"


@dataclass(frozen=True)
class User:
    """A user whose campaigns need helper containers."""

    python: str
    uid: int = NOBODY
    gid: int = NOBODY

    def own(self, path: Path) -> None:
        """Makes the user the owner."""
        shutil.chown(path, self.uid, self.gid)


def python_of_everybody(folder: Path) -> str:
    """Returns this Python if others can execute it, else one with the same packages in `folder`."""
    if all(path.stat().st_mode & 0o001 for path in Path(sys.executable).resolve().parents):
        return sys.executable
    subprocess.run([SYSTEM_PYTHON, "-m", "venv", "--without-pip", str(folder)], check=True)
    packages = next(folder.glob("lib/python3*/site-packages"))
    packages.rmdir()
    subprocess.run(["cp", "-al", sysconfig.get_path("purelib"), str(packages)], check=True)
    return str(folder / "bin" / "python3")
