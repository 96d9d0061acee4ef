# SPDX-License-Identifier: Apache-2.0
"""What a request must be to be answered, and which files may be shown."""

import base64
import hashlib
import re
from pathlib import Path

METHODS = ("GET", "HEAD")
NAMES = ("localhost", "127.0.0.1")
"""By which a browser on this machine calls us. A page from elsewhere whose name was made to mean
this machine (DNS rebinding) sends that name."""
PART = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*\Z")
"""Of a path: what we and our results are called. No `..`, nothing hidden, no separator."""
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".json": "application/json",
    ".csv": "text/csv; charset=utf-8",
    ".md": "text/plain; charset=utf-8",
    ".tex": "text/plain; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".pdf": "application/pdf",
    ".parquet": "application/octet-stream",
}
"""What is shown of a results folder."""

_NOTHING = "default-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'"
PAGE_POLICY = (
    f"{_NOTHING}; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'"
)
"""Of our own pages: nothing is loaded from elsewhere, no script stands in a page."""


def report_policy(scripts: list[str]) -> str:
    """Of a report, which is one file: its own scripts, known by their digests, and its pictures;
    whatever else somebody wrote into a results folder does not run."""
    allowed = " ".join(f"'sha256-{_digest(script)}'" for script in scripts) or "'none'"
    style = "style-src 'unsafe-inline'; img-src 'self' data:"
    return f"{_NOTHING}; script-src {allowed}; {style}"


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def is_our_name(host: str | None, port: int) -> bool:
    """Whether the Host header of a request names us."""
    return host is not None and host.lower() in {f"{name}:{port}" for name in NAMES}


def parts_of(path: str) -> list[str] | None:
    """The parts of a request's path, decoded; None where one is none of ours."""
    parts = path.strip("/").split("/") if path.strip("/") else []
    return parts if all(PART.match(part) for part in parts) else None


def file_in(root: Path, parts: list[str]) -> Path | None:
    """A file below `root` that may be shown; None where it is none, or where it really lies
    somewhere else (a link that leads out)."""
    if not parts or not all(PART.match(part) for part in parts):
        return None
    if Path(parts[-1]).suffix not in TYPES:
        return None
    try:
        real, home = root.joinpath(*parts).resolve(strict=True), root.resolve(strict=True)
        return real if real.is_relative_to(home) and real.is_file() else None
    except OSError:
        return None
