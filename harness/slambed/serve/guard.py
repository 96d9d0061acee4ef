# SPDX-License-Identifier: Apache-2.0
"""Checks requests, and which files may be served."""

import base64
import hashlib
import re
from pathlib import Path

METHODS = ("GET", "HEAD")
NAMES = ("localhost", "127.0.0.1")
HTTP_PORT = 80
"""Host names of this server for a browser on this machine. A foreign page whose name resolves to
this machine (DNS rebinding) sends that name instead."""
PART = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*\Z")
"""A safe part of a path: no `..`, no hidden file, no separator."""
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
"""Suffixes of files that are served, with their content types."""

_NOTHING = "default-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'"
PAGE_POLICY = (
    f"{_NOTHING}; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'"
)
"""Content security policy of our own pages: nothing from elsewhere, no inline script."""


def report_policy(scripts: list[str]) -> str:
    """Returns the policy of a report, which is one file: only its images and these scripts, by
    digest. No other script in a results folder runs."""
    allowed = " ".join(f"'sha256-{_digest(script)}'" for script in scripts) or "'none'"
    style = "style-src 'unsafe-inline'; img-src 'self' data:"
    return f"{_NOTHING}; script-src {allowed}; {style}"


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def is_our_name(host: str | None, port: int) -> bool:
    """Returns whether the Host header of a request names this server."""
    names = {f"{name}:{port}" for name in NAMES}
    # Browsers leave out the usual port.
    return host is not None and host.lower() in (names | set(NAMES) if port == HTTP_PORT else names)


def parts_of(path: str) -> list[str] | None:
    """Returns the parts of a decoded path; None if one is unsafe."""
    parts = path.strip("/").split("/") if path.strip("/") else []
    return parts if all(PART.match(part) for part in parts) else None


def file_in(root: Path, parts: list[str]) -> Path | None:
    """Returns a file below `root` that may be served; None if it may not, does not exist, or a link
    leads outside."""
    if not parts or not all(PART.match(part) for part in parts):
        return None
    if Path(parts[-1]).suffix not in TYPES:
        return None
    try:
        real, home = root.joinpath(*parts).resolve(strict=True), root.resolve(strict=True)
        return real if real.is_relative_to(home) and real.is_file() else None
    except OSError:
        return None
