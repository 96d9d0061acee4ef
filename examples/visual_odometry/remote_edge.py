# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: N806 - T_wc: camera to world
"""The edge of the remote odometry: places every picture that it gets."""

import contextlib
import json
import os
import socket
from types import SimpleNamespace

import cv2
import numpy as np
from slambed_client import Client, edge_address
from vo import Odometry
from wire import receive, send


def decoded(content: bytes) -> tuple[np.ndarray, np.ndarray]:
    size = int.from_bytes(content[:4], "little")
    gray, depth = content[4 : 4 + size], content[4 + size :]
    return tuple(
        cv2.imdecode(np.frombuffer(part, np.uint8), cv2.IMREAD_UNCHANGED) for part in (gray, depth)
    )


def serve(connection: socket.socket, client: Client) -> None:
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    _, settings = receive(connection)
    camera = {k: np.array(v) if isinstance(v, list) else v for k, v in json.loads(settings).items()}
    odometry = Odometry(SimpleNamespace(**camera), client.params)
    while True:
        number, picture = receive(connection)
        T_wc, features, inliers = odometry.track(*decoded(picture))
        pose = None if T_wc is None else T_wc.tolist()
        answer = {"T_wc": pose, "features": features, "inliers": inliers}
        send(connection, number, json.dumps(answer).encode())


def main() -> None:
    client = Client()
    cv2.setRNGSeed(int(os.environ["SLAMBED_SEED"]))
    with socket.create_server(edge_address("pictures")) as server:
        client.ready()
        connection, _ = server.accept()
        # Until the mobile node has gone.
        with connection, contextlib.suppress(EOFError, OSError):
            serve(connection, client)
    client.next()  # until the run is over
    client.close()


if __name__ == "__main__":
    main()
