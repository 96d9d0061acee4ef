# SPDX-License-Identifier: Apache-2.0
"""The HTTP side: which requests are answered, and with which headers."""

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
"""A connection on which nothing comes is closed."""
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Server(ThreadingHTTPServer):
    """Answers for one results folder, a thread per connection."""

    daemon_threads = True

    def __init__(self, site: Site, port: int) -> None:
        self.site = site
        super().__init__((ADDRESS, port), Handler)

    def handle_error(self, request: object, client_address: object) -> None:
        """A browser that goes away in the middle is no error worth a word."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)  # type: ignore[arg-type]


def open_server(site: Site, port: int) -> Server:
    """Listens on this machine alone; SlambedError where the port is taken or may not be had."""
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
        """A page or a file."""
        self._send(self._answer())

    def do_HEAD(self) -> None:
        """The same without what it says."""
        self._send(self._answer())

    def _refuse_method(self) -> None:
        # What the request brings is not read: it must not become the next one.
        self.close_connection = True
        text = f"{self.command} is not answered here: results are only looked at."
        self._send(error_page(HTTPStatus.METHOD_NOT_ALLOWED, text), {"Allow": ", ".join(METHODS)})

    def __getattr__(self, name: str) -> Any:
        """Whatever other method is asked for is refused in the same way."""
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
        address = urlsplit(self.path)
        parts = parts_of(unquote(address.path))
        if parts is None:
            return error_page(HTTPStatus.NOT_FOUND, "There is no such page.")
        try:
            return self.server.site.answer(
                parts, parse_qs(address.query), address.path.endswith("/")
            )
        except Exception as error:
            # Results may be broken in any way; the other pages are there all the same.
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
        """Requests are not reported: the terminal says where the pages are."""
