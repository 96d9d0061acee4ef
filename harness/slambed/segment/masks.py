# SPDX-License-Identifier: Apache-2.0
"""Mask caches: made once per sequence, network and n_m, from the JPEGs that runs send."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from slambed.data.model import GrayImage
from slambed.data.places import cache_folder, making, no_cache
from slambed.data.preparation import Progress
from slambed.data.prepared import PreparedSequence
from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.segment import TRUTH
from slambed.segment.frame_file import MASKS, encode_frames
from slambed.segment.mask_cache import LABELS_FILE, LABELS_KEY, MaskCache, encode_frame
from slambed.segment.network import Network, load_network
from slambed.segment.segmenter import SEGMENT_VERSION, Segmenter


def mask_key(sequence: PreparedSequence, network: str, quality: int, n_m: float) -> str:
    """Returns everything that the masks depend on; its digest is part of a run's key."""
    if network == TRUTH:
        labels = sequence.info.source.get("labels_sha256")
        if not labels:
            raise SlambedError(
                f"{sequence.info.id} has no true masks; only generated sequences with "
                "'labels: true' have"
            )
        return f"truth of {sequence.checksum} labels {labels}"
    found = load_network(network)
    return (
        f"{found.id} {found.sha256} decoder {found.decoder} {SEGMENT_VERSION} "
        f"opencv {cv2.__version__} n_m {n_m:g} of {sequence.checksum} jpeg {quality}"
    )


def mask_file(key: str) -> Path:
    digest = hashlib.sha256(key.encode()).hexdigest()
    return cache_folder() / "masks" / f"{digest[:20]}.masks"


def is_made(key: str) -> bool:
    return mask_file(key).is_file()


def mask_cache(
    sequence: PreparedSequence,
    network: str,
    quality: int,
    n_m: float,
    progress: Progress | None = None,
    notify: Callable[[str], None] = lambda line: None,
) -> Path:
    """Returns the file with the masks of a sequence, and creates it if it is missing. Notifies
    before it waits for another process that creates it."""
    key = mask_key(sequence, network, quality, n_m)
    path = mask_file(key)
    with making(path.parent, path.stem, "makes these masks", notify):
        if path.is_file():
            MaskCache.open(path, key)
            return path
        if network == TRUTH:
            content = _truth(sequence, key)
        else:
            content = _segmented(sequence, load_network(network), quality, n_m, key, progress)
        try:
            with replacing(path) as out:
                out.write_bytes(content)
        except OSError as refused:
            raise no_cache(path.parent, refused) from refused
    return path


def _truth(sequence: PreparedSequence, key: str) -> bytes:
    file = sequence.path / LABELS_FILE
    labels = MaskCache.open(file, LABELS_KEY)
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    if digest != sequence.info.source["labels_sha256"] or len(labels) != len(sequence):
        raise SlambedError(f"{file} does not fit sequence.json; delete the folder, prepare again")
    return encode_frames(MASKS, key, [encode_frame(labels.frame(i)) for i in range(len(labels))])


def encode_jpeg(gray: GrayImage, quality: int) -> bytes:
    """Encodes an image as it is sent over the link."""
    done, jpeg = cv2.imencode(".jpg", np.asarray(gray), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise SlambedError(f"a picture of {gray.shape[1]}x{gray.shape[0]} cannot be coded as JPEG")
    return bytes(jpeg)


def _segmented(
    sequence: PreparedSequence,
    network: Network,
    quality: int,
    n_m: float,
    key: str,
    progress: Progress | None,
) -> bytes:
    segmenter = Segmenter(network)
    blocks = []
    for i in range(len(sequence)):
        found = segmenter.segment(encode_jpeg(sequence.gray(i), quality), n_m)
        blocks.append(encode_frame(found))
        if progress:
            progress(i + 1, len(sequence))
    return encode_frames(MASKS, key, blocks)
