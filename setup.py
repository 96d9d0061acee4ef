# SPDX-License-Identifier: Apache-2.0
"""What pyproject.toml cannot say: a wheel has in slambed/checkout what runs need of a checkout.

With SLAMBED_WHEEL_BUILD=FOLDER (tools/wheel.sh) it also has the programs of FOLDER, in
slambed/checkout/build, and is for one platform: this machine's, or SLAMBED_WHEEL_MACHINE.
"""

import os
import platform
import shutil
import subprocess
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
KEPT = (
    "CMakeLists.txt", "LICENSE", "catalog", "cmake", "docker", "examples", "experiments",
    "netem_profiles", "papers", "systems",
    "tools/base_image.sh", "tools/build.sh", "tools/build_image.sh", "tools/environment.sh",
    "tools/programs.sh", "tools/retry.sh", "tools/setup.sh", "tools/space.sh",
)  # fmt: skip
"""What is looked up by name, and the sources of the programs with what builds them."""
LEFT_OUT = {"tests", "bench", "__pycache__", "bin", "runs.tar.xz"}
"""Folders that no program is built of, and the kept runs of papers, which are large."""
PROGRAMS = os.environ.get("SLAMBED_WHEEL_BUILD")
# Debian 12's glibc, the oldest that wheels are tested on. The programs are static and need none.
MACHINE = os.environ.get("SLAMBED_WHEEL_MACHINE", platform.machine())
PLATFORM = f"manylinux_2_36_{MACHINE}"


def kept_files() -> list[str]:
    """Those that git knows; of an unpacked archive all that lie there."""
    try:
        listed = subprocess.run(
            ["git", "-C", ROOT, "ls-files", "-z", "--", *KEPT], capture_output=True, check=True
        ).stdout.decode()
        found = [name for name in listed.split("\0") if name]
    except (OSError, subprocess.CalledProcessError):
        places = [ROOT / name for name in KEPT]
        files = [f for p in places for f in ([p] if p.is_file() else p.rglob("*")) if f.is_file()]
        found = [str(file.relative_to(ROOT)) for file in files]
    return sorted(name for name in found if not LEFT_OUT.intersection(Path(name).parts))


def commit() -> str:
    """The state of the checkout, for the manifests of runs; nothing outside of git."""
    git = ["git", "-C", str(ROOT)]
    if not (ROOT / ".git").exists():
        kept = ROOT / "commit"
        return kept.read_text() if kept.is_file() else ""
    head = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True).stdout
    changed = subprocess.run([*git, "diff", "--quiet", "HEAD"], capture_output=True).returncode
    return head.strip() + (" changed" if changed else "")


class WithCheckout(build_py):
    """Copies it beside the package; an editable install finds the checkout itself."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        target = Path(self.build_lib) / "slambed" / "checkout"
        shutil.rmtree(target, ignore_errors=True)
        for name in kept_files():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, target / name)
        (target / "commit").write_text(commit())
        if PROGRAMS:
            shutil.copytree(PROGRAMS, target / "build")


class ForOnePlatform(bdist_wheel):
    """A wheel with programs, for any Python 3 of this platform."""

    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", PLATFORM


class WithPrograms(Distribution):
    """Its files belong where a platform's packages are."""

    def has_ext_modules(self) -> bool:
        return True


of_wheel = {"cmdclass": {"build_py": WithCheckout}}
if PROGRAMS:
    of_wheel["cmdclass"]["bdist_wheel"] = ForOnePlatform
    of_wheel["distclass"] = WithPrograms
# build/ is where the C++ programs lie.
setup(**of_wheel, options={"build": {"build_base": "build/wheel"}})
