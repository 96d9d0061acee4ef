# SPDX-License-Identifier: Apache-2.0
"""Prints the compiled units of the product for clang-tidy, one path per line.

    tidy_units.py BUILD_FOLDER [--pattern TEXT] [--since COMMIT]

With `--since` only units that depend on a file which differs from that commit, by ninja's recorded
dependencies. All units if that is unknown: an unknown commit, no git, or a changed configuration of
clang-tidy or of the build.
"""

import argparse
import json
import re
import subprocess
from pathlib import Path

LEFT_OUT = re.compile(r"_test_together/|/(tests|bench|fuzz)/")
OBJECT = re.compile(r" -o (\S+)")
JUDGES = (".clang-tidy", "tools/tidy", "cmake/", "CMakeLists.txt", "requirements-dev.lock")
"""A change of these files can change the findings in any unit."""


def changed_since(commit: str) -> set[Path] | None:
    """Returns files that differ from the commit, committed or not; None: any may have changed."""
    names: list[str] = []
    for command in (
        ["diff", "--name-only", commit, "--"],
        ["ls-files", "-o", "--exclude-standard"],
    ):
        try:
            done = subprocess.run(["git", *command], capture_output=True, text=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            return None
        names += done.stdout.splitlines()
    if any(name.startswith(JUDGES) or name.endswith("CMakeLists.txt") for name in names):
        return None
    return {Path(name).resolve() for name in names}


def dependencies(build: Path) -> dict[str, set[Path]]:
    """Returns the dependencies of each object, by the object's path in the build folder."""
    command = ["ninja", "-C", str(build), "-t", "deps"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found: dict[str, set[Path]] = {}
    for line in printed.splitlines():
        if line and not line.startswith((" ", "ninja:")):
            current = found.setdefault(line.split(":", 1)[0], set())
        elif line.startswith(" "):
            current.add((build / line.strip()).resolve())
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=Path)
    parser.add_argument("--pattern", default="")
    parser.add_argument("--since", default="")
    asked = parser.parse_args()
    commands = json.loads((asked.build / "compile_commands.json").read_text())
    objects = {c["file"]: OBJECT.findall(c["command"])[0] for c in commands}
    units = {unit: made for unit, made in objects.items() if not LEFT_OUT.search(unit)}
    changed = changed_since(asked.since) if asked.since else None
    if changed is not None:
        made_of = dependencies(asked.build)
        units = {u: o for u, o in units.items() if made_of.get(o, changed) & changed}
    print(*sorted(unit for unit in units if asked.pattern in unit), sep="\n")


if __name__ == "__main__":
    main()
