# SPDX-License-Identifier: Apache-2.0
"""Downloads a file from the first working address, resuming interrupted transfers.

Received data is kept as `.download-*.part` until the file is complete. With a known checksum any
address may resume it; otherwise only the same address, if its server confirms that the file is
unchanged.
"""

from __future__ import annotations

import fcntl
import hashlib
import http.client
import os
import re
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from urllib.parse import urlsplit

from slambed.data.preparation import Progress
from slambed.errors import ExitCode, SlambedError, environment_error

CHUNK_BYTES = 1 << 18
TIMEOUT_S = 60.0
ATTEMPTS = 4
"""Maximum attempts per address; after the first one, they continue only while new data arrives."""
PAUSE_S = 1.0
_LOST = (TimeoutError, ConnectionResetError)
"""Connections that may be better the next time; urlopen() does not turn all into a URLError."""
PART, ORIGIN = ".part", ".from"
_PASSWORD = re.compile(r"//([^/?#:@]*):[^/?#]*@")


class WrongChecksumError(SlambedError):
    """The transfer completed, but the content has the wrong checksum."""


@dataclass(frozen=True)
class Wanted:
    """A file with its addresses and known properties."""

    addresses: tuple[str, ...]
    sha256: str | None
    size_bytes: int | None

    def part(self, folder: Path) -> Path:
        """Returns the path of the partial file, which is different for each recipe."""
        meant = self.sha256 or self.addresses[0]
        return folder / f".download-{hashlib.sha256(meant.encode()).hexdigest()[:16]}{PART}"


class _EndedEarlyError(Exception):
    """The transfer ended before the end of the file, after `came` new bytes."""

    def __init__(self, why: str, came: int) -> None:
        super().__init__(why)
        self.came = came


def shown(address: str) -> str:
    """Returns the address without its password, for messages."""
    return _PASSWORD.sub(r"//\1:***@", address, count=1)


def fetch(wanted: Wanted, folder: Path, progress: Progress | None = None) -> tuple[Path, str]:
    """Returns the file, below `folder`, and its SHA-256; the caller moves or removes it.

    Raises SlambedError: if all addresses give a wrong checksum, nothing is kept. After a network
    failure the partial file is kept, and the next call resumes it.
    """
    for address in wanted.addresses:
        _check(address)
    part = wanted.part(folder)
    with _alone(part):
        failures = []
        for address in wanted.addresses:
            try:
                digest = _from_address(address, wanted, part, progress)
            except SlambedError as refused:
                failures.append(refused)
                continue
            return part, digest
        kept = part.stat().st_size if part.is_file() else 0
        message = "; ".join(str(item) for item in failures)
        if all(isinstance(item, WrongChecksumError) for item in failures):
            raise SlambedError(f"{message}; nothing was kept")
        if all(item.code == ExitCode.BAD_INPUT for item in failures):
            raise SlambedError(message)
        goes_on = f"; {kept} bytes are kept, the same command goes on" if kept else ""
        raise environment_error(f"{message}; check the network{goes_on}")


def _check(address: str) -> None:
    """Raises SlambedError for an address that no network could make work."""
    if not _is_address(address):
        raise SlambedError(
            f"url '{shown(address)}' is no address of a file; expected http://, https://, ftp:// "
            "or file:/// and what follows it, a blank written as %20"
        )
    if _scheme(address) in ("http", "https") and "@" in urlsplit(address).netloc:
        # http.client takes the user and password for a part of the host's name.
        raise SlambedError(
            f"{shown(address)}: a user and password are for ftp:// only; "
            "fetch the file by hand and write its file:/// address"
        )


def _is_address(address: str) -> bool:
    try:
        parts = urlsplit(address)
        if _is_local(address):
            return parts.path.startswith("/")
        host = (parts.hostname or "").encode("idna")
        in_range = parts.port is None or parts.port > 0
    except ValueError:  # brackets, port or host name
        return False
    is_plain = address.isprintable() and " " not in address
    is_known = _scheme(address) in ("http", "https", "ftp")
    is_ascii = (parts.path + parts.query).isascii()
    return is_known and bool(host) and in_range and is_plain and is_ascii


def _scheme(address: str) -> str:
    """Unlike urlsplit() it does not ignore blanks, as urlopen() does not either."""
    return address.partition(":")[0].lower()


def _is_local(address: str) -> bool:
    return _scheme(address) == "file"


def _from_address(address: str, wanted: Wanted, part: Path, progress: Progress | None) -> str:
    """Downloads again from the start if a resumed file is wrong: its old part may be the cause."""
    resumed = _usable(part, address, wanted) > 0
    if resumed and wanted.sha256 is not None and _digest(part) == wanted.sha256:
        return wanted.sha256  # an earlier call could not unpack it
    _transfer(address, wanted, part, progress)
    digest = _digest(part)
    if wanted.sha256 in (None, digest):
        return digest
    forget(part)
    if resumed:
        _transfer(address, wanted, part, progress)
        digest = _digest(part)
        if wanted.sha256 == digest:
            return digest
        forget(part)
    raise WrongChecksumError(f"{shown(address)}: sha256 is {digest}, not {wanted.sha256}")


def _transfer(address: str, wanted: Wanted, part: Path, progress: Progress | None) -> None:
    """Transfers until the file is complete; gives up a server that sends no new data."""
    for attempt in range(1, ATTEMPTS + 1):
        try:
            _once(address, wanted, part, progress)
            return
        except _EndedEarlyError as early:
            if attempt == ATTEMPTS or (attempt > 1 and not early.came):
                raise environment_error(f"{shown(address)}: {early}") from early
            time.sleep(PAUSE_S)
        except (*_LOST, urllib.error.URLError, ValueError, http.client.HTTPException) as refused:
            # A refusal is final; a lost connection may be temporary.
            final = isinstance(refused, urllib.error.HTTPError | ValueError)
            if final or attempt == ATTEMPTS or _is_no_place(refused):
                raise _refusal(address, refused) from refused
            time.sleep(PAUSE_S)


def _is_no_place(refused: Exception) -> bool:
    """Returns whether the address is invalid: unknown host or file, or connection refused."""
    return not isinstance(getattr(refused, "reason", refused), _LOST)


def _refusal(address: str, refused: Exception) -> SlambedError:
    line = f"{shown(address)}: {_reason(refused)}"
    if _is_local(address):
        return SlambedError(f"{line}; name a file that can be read")
    return environment_error(line)


def _reason(refused: Exception) -> str:
    """Returns why, without the number and the brackets that Python puts around it."""
    cause: object = refused
    if type(refused) is urllib.error.URLError:  # an HTTPError tells its number itself
        is_text = isinstance(refused.reason, str)  # of ftp it is the code of its cause
        cause = (is_text and refused.__cause__) or refused.reason
    return getattr(cause, "strerror", None) or str(cause) or type(cause).__name__


def _once(address: str, wanted: Wanted, part: Path, progress: Progress | None) -> None:
    begin = _usable(part, address, wanted)
    if begin and begin == wanted.size_bytes:
        return
    request = urllib.request.Request(address)
    if begin:
        request.add_header("Range", f"bytes={begin}-")
        if wanted.sha256 is None:
            request.add_header("If-Range", _validator(part))
    try:
        answer = urllib.request.urlopen(request, timeout=TIMEOUT_S)
    except urllib.error.HTTPError as refused:
        if refused.code != http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE or not begin:
            raise
        forget(part)  # it has no more data than we have, or less
        raise _EndedEarlyError("the part that was there is not of this file", 1) from refused
    with answer:
        if begin and not _goes_on(answer, begin):
            begin = 0
        if not begin:
            forget(part)
            _remember(part, address, answer)
        length = answer.headers.get("Content-Length")
        total = begin + int(length) if length else wanted.size_bytes
        with part.open("ab") as file:
            came = _copy(answer, file, begin, total or wanted.size_bytes or 0, progress)
    whole = wanted.size_bytes or total
    size = begin + came
    if not whole or size == whole:
        return
    if _is_local(address):
        forget(part)
        raise SlambedError(f"{address}: has {size} bytes, not {whole}; correct size_bytes")
    if size < whole:
        raise _EndedEarlyError(f"it ended after {size} of {whole} bytes", came)
    forget(part)
    raise environment_error(f"{shown(address)}: {size} bytes came, not {whole}")


def _copy(answer: Any, file: IO[bytes], begin: int, total: int, progress: Progress | None) -> int:
    came = 0
    while True:
        try:
            chunk = answer.read(CHUNK_BYTES)
        except (OSError, http.client.HTTPException) as cut:
            file.flush()
            raise _EndedEarlyError(f"the connection was cut ({_reason(cut)})", came) from cut
        if not chunk:
            return came
        file.write(chunk)
        came += len(chunk)
        if progress:
            progress(begin + came, max(total, begin + came))


def _goes_on(answer: Any, begin: int) -> bool:
    """Returns True if the answer continues the file; a server without range support sends all of
    it."""
    if getattr(answer, "status", None) != http.HTTPStatus.PARTIAL_CONTENT:
        return False
    return str(answer.headers.get("Content-Range", "")).startswith(f"bytes {begin}-")


def _usable(part: Path, address: str, wanted: Wanted) -> int:
    """Returns the number of existing bytes that can be resumed from."""
    if not part.is_file():
        return 0
    if wanted.sha256 is None:
        from_address = _origin(part)[0] == shown(address)
        return part.stat().st_size if from_address and _validator(part) else 0
    return part.stat().st_size


def _origin(part: Path) -> tuple[str, str]:
    """Returns the address of the partial file, and the validator (ETag or date) of its server."""
    try:
        address, validator = part.with_suffix(ORIGIN).read_text().splitlines()[:2]
    except (OSError, ValueError):
        return "", ""
    return address, validator


def _validator(part: Path) -> str:
    return _origin(part)[1]


def _remember(part: Path, address: str, answer: Any) -> None:
    tag = answer.headers.get("ETag", "")
    # A weak ETag guarantees equivalent content, but not identical bytes (RFC 9110, 8.8.1).
    validator = tag if tag and not tag.startswith("W/") else answer.headers.get("Last-Modified", "")
    part.with_suffix(ORIGIN).write_text(f"{shown(address)}\n{validator}\n")


def forget(part: Path) -> None:
    """Removes the partial file and its origin."""
    for path in (part, part.with_suffix(ORIGIN)):
        path.unlink(missing_ok=True)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def _alone(part: Path) -> Iterator[None]:
    """Prevents two calls from writing the same file."""
    lock = part.with_suffix(".lock")
    with lock.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # The previous holder may have deleted the lock file that we opened.
            ours = lock.stat().st_ino == os.fstat(file.fileno()).st_ino
        except (BlockingIOError, FileNotFoundError):
            ours = False
        if not ours:
            raise environment_error(f"{part}: another slambed downloads this file now; repeat")
        try:
            yield
        finally:
            lock.unlink()
