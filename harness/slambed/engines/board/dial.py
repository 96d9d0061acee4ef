# SPDX-License-Identifier: Apache-2.0
"""The Docker of another machine as a socket on this one: what `docker context` does over ssh.

Whoever connects gets a `docker system dial-stdio` at the far end of its own, so that the Docker
library and the docker command find that daemon like one of this machine.
"""

import socket
import subprocess
import threading
from pathlib import Path


class DialStdio:
    """A socket that leads to the daemon, from its making to `close`."""

    def __init__(self, path: Path, command: list[str], errors: Path) -> None:
        """`command` becomes the far end, with the connection for input and output; `errors`: a file
        for what it complains of."""
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
        """As DOCKER_HOST has it."""
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
        """Ends every connection; calling it twice is harmless."""
        with self._guard:
            self._closed = True
            children, self._children = self._children, []
        self._server.close()
        self.path.unlink(missing_ok=True)
        for child in children:
            child.kill()
            child.wait()
