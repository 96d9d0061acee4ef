# SPDX-License-Identifier: Apache-2.0
"""The agent as a program for `python3 -c`, together with all modules that it imports."""

import base64
import io
import zipfile
from pathlib import Path

import slambed

LEAST_PYTHON = (3, 10)
AGENT = "slambed.engines.board.agent"
SHIPPED = (
    "errors", "process.namespaces", "engines.lock_file", "engines.board.agent",
    "sampling.cgroup", "sampling.kept_files", "sampling.tasks", "sampling.tcp_info",
)  # fmt: skip
"""Modules that need only the standard library."""
START = """\
import sys
if sys.version_info < {least}:
    sys.exit("error: Python {least_text} is needed there, this is " + sys.version.split()[0])
import base64, runpy, tempfile
held = tempfile.NamedTemporaryFile(suffix=".zip")
held.write(base64.b64decode("{packed}"))
held.flush()
sys.path.insert(0, held.name)
runpy.run_module("{agent}", run_name="__main__")
"""


def agent_source() -> str:
    """Returns the program; it leaves no files on the board."""
    packed = io.BytesIO()
    root = Path(slambed.__file__).parent
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for package in ("", "engines/", "engines/board/", "process/", "sampling/"):
            archive.writestr(f"slambed/{package}__init__.py", "")
        for module in SHIPPED:
            name = module.replace(".", "/") + ".py"
            archive.writestr(f"slambed/{name}", (root / name).read_text(encoding="utf-8"))
    return START.format(
        least=LEAST_PYTHON,
        least_text=".".join(map(str, LEAST_PYTHON)),
        packed=base64.b64encode(packed.getvalue()).decode(),
        agent=AGENT,
    )
