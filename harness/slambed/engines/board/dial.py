# SPDX-License-Identifier: Apache-2.0
"""The Docker daemon of another machine as a local socket, like `docker context` over ssh.

Each connection gets its own `docker system dial-stdio` on the other machine, so the Docker library
and the docker command can use that daemon like a local one.
"""

import socket
import subprocess
import threading
from pathlib import Path


class DialStdio:
    """A socket connected to the daemon, until `close`."""

    def __init__(self, path: Path, command: list[str], errors: Path) -> None:
        """`command` is started for each connection, which becomes its stdin and stdout;
        `errors`: file for its stderr."""
        self.path = path
        self._command = command
        self._errors = errors
        self._children: list[subprocess.Popen[bytes]] = []
        self._guard = threading.Lock()
        self._closed = False
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._server.bind(str(path))
        path.chmod(0o600)
        self._server.listen(16)
        threading.Thread(target=self._serve, name="docker-over-ssh", daemon=True).start()

    @property
    def url(self) -> str:
        """Value for DOCKER_HOST."""
        return f"unix://{self.path}"

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._server.accept()
            except OSError:
                return  # closed
            with connection, self._errors.open("ab") as log, self._guard:
                if self._closed:
                    return
                self._children = [child for child in self._children if child.poll() is None]
                self._children.append(
                    subprocess.Popen(
                        self._command,
                        stdin=connection.fileno(),
                        stdout=connection.fileno(),
                        stderr=log,
                        start_new_session=True,
                    )
                )

    def close(self) -> None:
        """Ends all connections; safe to call twice."""
        with self._guard:
            self._closed = True
            children, self._children = self._children, []
        self._server.close()
        self.path.unlink(missing_ok=True)
        for child in children:
            child.kill()
            child.wait()
