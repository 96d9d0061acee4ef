# SPDX-License-Identifier: Apache-2.0
"""Classifies failures of the Docker daemon: worth another try, or permanent."""

from collections.abc import Iterator
from contextlib import contextmanager

from docker.errors import APIError, DockerException
from requests.exceptions import RequestException

from slambed.errors import PassingError, SlambedError, environment_error

DAEMON_ERRORS = (DockerException, RequestException)
"""The library passes on errors of `requests`: refused and lost connections, timeouts."""
GONE, CONFLICT = 404, 409
"""Temporary errors: a container that was removed, or a name in use by a failed attempt."""


@contextmanager
def daemon_failures(doing: str) -> Iterator[None]:
    """Converts the library's errors to SlambedError."""
    try:
        yield
    except DAEMON_ERRORS as error:
        raise docker_error(error, doing) from None


def no_docker_command(what: str) -> SlambedError:
    """Returns the error for a host whose daemon is there without the command."""
    return environment_error(
        f"{what} needs the command docker, which is not on this host; install docker.io or "
        "docker-cli"
    )


def docker_error(error: Exception, doing: str) -> SlambedError:
    """A request that the daemon refused will fail again; a missing answer or an error of the
    daemon may be temporary."""
    if isinstance(error, APIError):
        code = getattr(error.response, "status_code", 500)
        line = f"Docker refused to {doing}: {error.explanation or error}"
        if code < 500 and code not in (GONE, CONFLICT):
            return environment_error(line)
        return PassingError(line)
    # Only the innermost of nested connection errors is informative.
    reason = str(error).strip().splitlines()[:1] or [type(error).__name__]
    return PassingError(f"Docker did not answer, asked to {doing}: {reason[0]}")
