# SPDX-License-Identifier: Apache-2.0
"""sim.json: the world around the nodes of a virtual run."""

from typing import Literal

from slambed.files.json_file import Record
from slambed.link.direction import ModeledLink
from slambed.spec.device import CostModel


class SimDevices(Record):
    """What work costs on each node."""

    mobile: CostModel
    """Its cost model."""
    edge: CostModel | None
    """Exactly where run.json has a network."""


class CacheFile(Record):
    """A file that is made where it is missing, and anew where it has another key."""

    path: str
    """Of the file."""
    key: str
    """Everything that its content depends on."""


class MaskFile(Record):
    """What the segmentation says of every picture, for one threshold ("Mask cache")."""

    n_m: float
    """The threshold."""
    path: str
    """Of the file."""
    key: str
    """Another one in the file, or no file, is an error."""


class SimConfig(Record):
    """The whole file."""

    format: Literal["slambed-sim"]
    """Of the file."""
    version: Literal[1]
    """Of the format."""
    run: str
    """Name of run.json, beside this file."""
    devices: SimDevices
    """What work costs on each node."""
    link: ModeledLink | None
    """Null without an edge."""
    edge_frozen_s: list[tuple[float, float]]
    """Begin and end of each time in which the edge's workers stand still, in the middle of a stage
    too; what arrives waits in its kernel, which acknowledges it."""
    feature_cache: CacheFile | None
    """Features of every frame; of a system that extracts on the edge those of the pictures as they
    were coded (`sequence/feature_cache.hpp`). Made where it is missing or has another key."""
    image_cache: CacheFile | None = None
    """Only of systems with a `jpeg_quality`: the JPEG of every frame; without it each picture is
    coded when it is sent (`sequence/image_source.hpp`). Made likewise."""
    mask_caches: list[MaskFile] | None = None
    """Only of systems that segment: what the segmentation says of those pictures."""
