# SPDX-License-Identifier: Apache-2.0
"""The HTTP server: request checks, headers and errors."""

import errno
import hashlib
import sys
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from slambed.errors import environment_error
from slambed.failures import line_and_code
from slambed.serve.answer import Answer, error_page
from slambed.serve.guard import METHODS, is_our_name, parts_of
from slambed.serve.site import Site

ADDRESS = "127.0.0.1"
IDLE_S = 30.0
"""An idle connection is closed after this time."""
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Server(ThreadingHTTPServer):
    """Serves one results folder, with a thread per connection."""

    daemon_threads = True

    def __init__(self, site: Site, port: int) -> None:
        self.site = site
        super().__init__((ADDRESS, port), Handler)

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignores connections that the browser closed."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)  # type: ignore[arg-type]


def open_server(site: Site, port: int) -> Server:
    """Listens on this machine only. Raises SlambedError if the port is in use or not permitted."""
    try:
        return Server(site, port)
    except OSError as refused:
        if refused.errno == errno.EADDRINUSE:
            raise environment_error(
                f"port {port} is in use on this machine; give another one with --port"
            ) from None
        raise environment_error(
            f"cannot listen on port {port}: {refused.strerror}; give another one with --port"
        ) from None


class Handler(BaseHTTPRequestHandler):
    """One request."""

    protocol_version = "HTTP/1.1"
    server_version = "slambed"
    sys_version = ""
    timeout = IDLE_S
    server: Server

    def do_GET(self) -> None:
        """Sends a page or a file."""
        self._send(self._answer())

    def do_HEAD(self) -> None:
        """Sends the headers of a page or a file."""
        self._send(self._answer())

    def _refuse_method(self) -> None:
        # The request's body is not read, so it must not be parsed as the next request.
        self.close_connection = True
        text = f"{self.command} is not answered here: results are only looked at."
        self._send(error_page(HTTPStatus.METHOD_NOT_ALLOWED, text), {"Allow": ", ".join(METHODS)})

    def __getattr__(self, name: str) -> Any:
        """Refuses all other methods in the same way."""
        if name.startswith("do_"):
            return self._refuse_method
        raise AttributeError(name)

    def _answer(self) -> Answer:
        if not is_our_name(self.headers.get("Host"), self.server.server_port):
            return error_page(
                HTTPStatus.MISDIRECTED_REQUEST,
                f"This is for a browser on the same machine: http://localhost:"
                f"{self.server.server_port}/",
            )
        try:
            address = urlsplit(self.path)
        except ValueError:
            return error_page(HTTPStatus.BAD_REQUEST, "This is no address.")
        parts = parts_of(unquote(address.path))
        if parts is None:
            return error_page(HTTPStatus.NOT_FOUND, "There is no such page.")
        try:
            return self.server.site.answer(
                parts, parse_qs(address.query), address.path.endswith("/")
            )
        except Exception as error:
            # Damaged results must not take down the other pages.
            line, _ = line_and_code(error)
            print(f"{address.path}: {line}", file=sys.stderr)
            return error_page(HTTPStatus.INTERNAL_SERVER_ERROR, f"{line}.")

    def _send(self, answer: Answer, further: dict[str, str] | None = None) -> None:
        tag = f'"{hashlib.sha256(answer.body).hexdigest()[:32]}"'
        known = answer.status == HTTPStatus.OK and self.headers.get("If-None-Match") == tag
        self.send_response(HTTPStatus.NOT_MODIFIED if known else answer.status)
        headers = {**HEADERS, **answer.headers, **(further or {}), "ETag": tag}
        if not known:
            headers |= {"Content-Length": str(len(answer.body))}
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if not known and self.command != "HEAD":
            self.wfile.write(answer.body)

    def log_message(self, format: str, *args: object) -> None:
        """Suppresses the request log: the terminal shows the address of the pages."""
