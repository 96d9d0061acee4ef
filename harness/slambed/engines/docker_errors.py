# SPDX-License-Identifier: Apache-2.0
"""What a failure of the Docker daemon means for a run: worth another try, or wrong for good."""

from collections.abc import Iterator
from contextlib import contextmanager

from docker.errors import APIError, DockerException
from requests.exceptions import RequestException

from slambed.errors import PassingError, SlambedError, environment_error

DAEMON_ERRORS = (DockerException, RequestException)
"""The library hands on what `requests` raises: refused and lost connections, time-outs."""
GONE, CONFLICT = 404, 409
"""A container that somebody removed, a name that a failed attempt left: both pass."""


@contextmanager
def daemon_failures(doing: str) -> Iterator[None]:
    """Raises SlambedError in the place of the library's errors."""
    try:
        yield
    except DAEMON_ERRORS as error:
        raise docker_error(error, doing) from None


def docker_error(error: Exception, doing: str) -> SlambedError:
    """A request that the daemon understood and refused fails the next time too; that it did not
    answer, or failed itself, may pass."""
    if isinstance(error, APIError):
        code = getattr(error.response, "status_code", 500)
        line = f"Docker refused to {doing}: {error.explanation or error}"
        if code < 500 and code not in (GONE, CONFLICT):
            return environment_error(line)
        return PassingError(line)
    # Of nested connection errors only the innermost says something.
    reason = str(error).strip().splitlines()[:1] or [type(error).__name__]
    return PassingError(f"Docker did not answer, asked to {doing}: {reason[0]}")
