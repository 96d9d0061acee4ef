# SPDX-License-Identifier: Apache-2.0
"""What both nodes of the remote odometry say: numbered messages over one connection."""

import socket
import struct

HEADER = struct.Struct("<QI")


def send(connection: socket.socket, number: int, content: bytes) -> None:
    connection.sendall(HEADER.pack(number, len(content)) + content)


def receive(connection: socket.socket) -> tuple[int, bytes]:
    """Number and content; EOFError when the other side has gone."""
    number, size = HEADER.unpack(_exactly(connection, HEADER.size))
    return number, _exactly(connection, size)


def _exactly(connection: socket.socket, size: int) -> bytes:
    content = b""
    while len(content) < size:
        if not (part := connection.recv(size - len(content))):
            raise EOFError
        content += part
    return content
