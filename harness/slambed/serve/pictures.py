# SPDX-License-Identifier: Apache-2.0
"""Images of prepared sequences on this machine."""

import threading
from functools import lru_cache

import cv2

from slambed.data import places
from slambed.data.cache import SequenceCache
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError

WIDEST_PX = 960
JPEG_QUALITY = 85
NOT_HERE = (
    "No pictures: the sequence is not prepared on this machine; 'slambed data prepare ID' makes it."
)


class Pictures:
    """Finds sequences by the checksum in a run's manifest."""

    def __init__(self) -> None:
        self._found: dict[str, PreparedSequence] = {}
        self._lock = threading.Lock()

    def sequence(self, checksum: str | None) -> PreparedSequence | None:
        """Returns the played sequence; None if it is not on this machine. One that is prepared
        later is found then."""
        if not checksum:
            return None
        with self._lock:
            if (known := self._found.get(checksum)) is not None:
                return known
            try:
                found = SequenceCache(places.prepared_folder()).of_checksum(checksum)
            except SlambedError:  # no permission to read the cache
                return None
            if found is not None:
                self._found[checksum] = found
            return found

    def jpeg(self, checksum: str | None, frame: int) -> bytes | None:
        """Returns a frame as gray JPEG; None if its sequence is not on this machine."""
        sequence = self.sequence(checksum)
        if sequence is None or not 0 <= frame < len(sequence) or not sequence.path.is_dir():
            return None
        return _jpeg(sequence, frame)


@lru_cache(maxsize=64)
def _jpeg(sequence: PreparedSequence, frame: int) -> bytes:
    gray = sequence.gray(frame)
    if gray.shape[1] > WIDEST_PX:
        height = round(gray.shape[0] * WIDEST_PX / gray.shape[1])
        small = cv2.resize(gray, (WIDEST_PX, height), interpolation=cv2.INTER_AREA)
        gray = small.astype(gray.dtype, copy=False)
    whole, data = cv2.imencode(".jpg", gray, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert whole
    return data.tobytes()
