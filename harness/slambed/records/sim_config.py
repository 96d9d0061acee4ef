# SPDX-License-Identifier: Apache-2.0
"""sim.json: the simulated environment of the nodes of a virtual run."""

from typing import Literal

from slambed.files.json_file import Record
from slambed.link.direction import ModeledLink
from slambed.spec.device import CostModel


class SimDevices(Record):
    """Cost models of the nodes."""

    mobile: CostModel
    """Cost model of the mobile node."""
    edge: CostModel | None
    """Cost model of the edge; null exactly when run.json has no network."""


class CacheFile(Record):
    """A cache file; it is created if it is missing, and again if its key differs."""

    path: str
    """Path of the file."""
    key: str
    """Hash of everything that the content depends on."""


class MaskFile(Record):
    """Segmentation masks of every picture for one threshold ("Mask cache")."""

    n_m: float
    """The threshold: overlap, 0 to 1, above which two candidates are one person."""
    path: str
    """Path of the file."""
    key: str
    """Expected key; a missing file or one with another key is an error."""


class SimConfig(Record):
    """The whole file."""

    format: Literal["slambed-sim"]
    """Name of the format."""
    version: Literal[1]
    """Version of the format."""
    run: str
    """Name of run.json, in the same folder."""
    devices: SimDevices
    """Cost models of the nodes."""
    link: ModeledLink | None
    """Null without an edge."""
    edge_frozen_s: list[tuple[float, float]]
    """Begin and end of each interval in which the edge's workers are frozen, even in the middle
    of a stage. Its kernel still acknowledges and queues received data."""
    feature_cache: CacheFile | None
    """Features of every frame; for a system that extracts on the edge, those of the decoded JPEG
    pictures (`sequence/feature_cache.hpp`). Created if it is missing or has another key."""
    image_cache: CacheFile | None = None
    """Only for systems with `jpeg_quality`: the JPEG of every frame. Without it each picture is
    encoded when it is sent (`sequence/image_source.hpp`). Created like the feature cache."""
    mask_caches: list[MaskFile] | None = None
    """Only for systems with segmentation: the masks of those pictures."""
    limit_s: float | None = None
    """Virtual time at which a run is stopped that has not ended, for example because its nodes
    never connect. The run has then timed out."""
