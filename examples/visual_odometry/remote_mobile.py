# SPDX-License-Identifier: Apache-2.0

"""The mobile node of the remote odometry: one picture up, its pose down, the next picture."""

import json
import socket
import time

import cv2
import numpy as np
from slambed_client import Client, Frame, edge_address
from wire import receive, send

CONNECT_S = 20.0


def connect() -> socket.socket:
    """To the edge, which may not listen yet."""
    deadline = time.monotonic() + CONNECT_S
    while True:
        try:
            connection = socket.create_connection(edge_address("pictures"), timeout=1.0)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return connection
        except OSError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.05)


def packed(frame: Frame, quality: int) -> bytes:
    gray = cv2.imencode(".jpg", frame.gray, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    depth = cv2.imencode(".png", frame.depth, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()
    return len(gray).to_bytes(4, "little") + gray + depth


def answer_to(connection: socket.socket, number: int, deadline: float) -> dict | None:
    """The answer to this frame; what comes late for an earlier one is passed over."""
    try:
        while (left := deadline - time.monotonic()) > 0:
            connection.settimeout(left)
            answered, content = receive(connection)
            if answered == number:
                return json.loads(content)
    except TimeoutError:
        pass
    return None


def main() -> None:
    client = Client()
    cv2.setNumThreads(1)
    connection = connect()
    camera = {
        "camera_matrix": client.camera_matrix.tolist(),
        "distortion": client.distortion.tolist(),
        "depth_unit_m": client.depth_unit_m,
    }
    send(connection, 0, json.dumps(camera).encode())
    client.ready()
    for frame in client:
        picture = packed(frame, client.params["jpeg_quality"])
        client.event("picture", bytes=len(picture))
        deadline = time.monotonic() + client.params["answer_s"]
        # A connection that an answer may have been cut out of is read no further.
        try:
            connection.settimeout(client.params["answer_s"])
            send(connection, frame.index, picture)
            answer = answer_to(connection, frame.index, deadline)
        except (OSError, EOFError):
            answer = None
        if answer is None or answer["T_wc"] is None:
            client.lost(frame)
        else:
            client.pose(frame, np.array(answer["T_wc"]), answer["features"], answer["inliers"])
    client.close()


if __name__ == "__main__":
    main()
