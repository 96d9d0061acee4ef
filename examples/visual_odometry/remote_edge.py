# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: N806 - T_wc: camera to world
"""The edge of the remote odometry: places every picture that it gets."""

import contextlib
import json
import os
import socket
import threading
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


class Placing:
    """Places the pictures of the mobile node, which connects anew after an outage."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._odometry: Odometry | None = None
        self._newest = 0
        self._one_at_a_time = threading.Lock()

    def accept(self, server: socket.socket) -> None:
        """Serves each connection in a thread: an old one may not know yet that it is over."""
        while True:
            connection, _ = server.accept()
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        cv2.setRNGSeed(int(os.environ["SLAMBED_SEED"]))
        # Until the mobile node has gone.
        with connection, contextlib.suppress(EOFError, OSError):
            camera = json.loads(receive(connection)[1])
            while True:
                number, picture = receive(connection)
                if (answer := self._placed(camera, number, picture)) is not None:
                    send(connection, number, json.dumps(answer).encode())

    def _placed(self, camera: dict, number: int, picture: bytes) -> dict | None:
        """The answer; None to a picture older than the last one, from before an outage."""
        with self._one_at_a_time:
            if number < self._newest:
                return None
            self._newest = number
            if self._odometry is None:
                arrays = {k: np.array(v) if isinstance(v, list) else v for k, v in camera.items()}
                self._odometry = Odometry(SimpleNamespace(**arrays), self._client.params)
            T_wc, features, inliers = self._odometry.track(*decoded(picture))
        pose = None if T_wc is None else T_wc.tolist()
        return {"T_wc": pose, "features": features, "inliers": inliers}


def main() -> None:
    client = Client()
    with socket.create_server(edge_address("pictures")) as server:
        threading.Thread(target=Placing(client).accept, args=(server,), daemon=True).start()
        client.ready()
        client.next()  # until the run is over
    client.close()


if __name__ == "__main__":
    main()
