# SPDX-License-Identifier: Apache-2.0

"""The mobile node of the remote odometry: one picture up, its pose down, the next picture."""

import json
import select
import socket
import time

import cv2
import numpy as np
from slambed_client import Client, Frame, edge_address
from wire import receive, send

CONNECT_S = 20.0


class Edge:
    """The edge node, connected anew after its connection stood still or broke."""

    def __init__(self, camera: bytes, answer_s: float) -> None:
        self._camera, self._answer_s = camera, answer_s
        self._connection: socket.socket | None = None
        self._connect(CONNECT_S)

    def place(self, number: int, picture: bytes) -> dict | None:
        """The answer to this picture; None where it does not come in time."""
        deadline = time.monotonic() + self._answer_s
        try:
            if self._connection is None:
                self._connect(self._answer_s)
            self._connection.settimeout(self._answer_s)
            send(self._connection, number, picture)
            return answer_to(self._connection, number, deadline)
        except (OSError, EOFError):
            # Half of a message may be under way, and nothing can follow it.
            self.close()
            return None

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._connection = None

    def _connect(self, limit_s: float) -> None:
        """The edge may not listen yet."""
        deadline = time.monotonic() + limit_s
        while self._connection is None:
            try:
                self._connection = socket.create_connection(
                    edge_address("pictures"), min(1.0, limit_s)
                )
            except OSError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.05)
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        send(self._connection, 0, self._camera)


def packed(frame: Frame, quality: int) -> bytes:
    gray = cv2.imencode(".jpg", frame.gray, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    depth = cv2.imencode(".png", frame.depth, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()
    return len(gray).to_bytes(4, "little") + gray + depth


def answer_to(connection: socket.socket, number: int, deadline: float) -> dict | None:
    """The answer to this frame; what comes late for an earlier one is passed over."""
    while (left := deadline - time.monotonic()) > 0 and select.select([connection], [], [], left)[
        0
    ]:
        answered, content = receive(connection)
        if answered == number:
            return json.loads(content)
    return None


def main() -> None:
    client = Client()
    cv2.setNumThreads(1)
    camera = {
        "camera_matrix": client.camera_matrix.tolist(),
        "distortion": client.distortion.tolist(),
        "depth_unit_m": client.depth_unit_m,
    }
    edge = Edge(json.dumps(camera).encode(), client.params["answer_s"])
    client.ready()
    for frame in client:
        picture = packed(frame, client.params["jpeg_quality"])
        client.event("picture", bytes=len(picture))
        answer = edge.place(frame.index, picture)
        if answer is None or answer["T_wc"] is None:
            client.lost(frame)
        else:
            client.pose(frame, np.array(answer["T_wc"]), answer["features"], answer["inliers"])
    edge.close()
    client.close()


if __name__ == "__main__":
    main()
