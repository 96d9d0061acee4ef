# SPDX-License-Identifier: Apache-2.0
"""The models of catalog/datasets/*.yaml. Unknown keys are errors."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from slambed.data.lens import PLAIN_COUNT, Lens, coefficients_of, model_of
from slambed.data.model import LARGEST_SIDE, Camera, Sensor
from slambed.errors import SlambedError
from slambed.older_names import RECIPES, keys_today

UNVERIFIED = "unverified here"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class CameraRecipe(_Strict):
    """Camera of the source images; left out where the dataset brings its own calibration."""

    width: int = Field(gt=0, le=LARGEST_SIDE)
    height: int = Field(gt=0, le=LARGEST_SIDE)
    fx: float = Field(gt=0)
    fy: float = Field(gt=0)
    cx: float
    cy: float
    bf: float = Field(ge=0, description="fx times baseline, px m")
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """k1 k2 p1 p2 [k3 [k4 k5 k6]] as OpenCV has them, or k1 k2 k3 k4 of `equidistant`."""
    distortion_model: str = "radial-tangential"
    """What a node cannot take out (equidistant, k4 and more) is taken out when preparing."""

    @model_validator(mode="after")
    def _known_distortion(self) -> Self:
        try:
            self.lens()
        except SlambedError as refused:
            raise ValueError(str(refused)) from None
        return self

    def lens(self) -> Lens:
        """With what distorts the source images."""
        model = model_of(self.distortion_model, "distortion_model")
        matrix = np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])
        return Lens(matrix, coefficients_of(self.distortion, model, "distortion"), model)

    @property
    def is_straightened(self) -> bool:
        """True where the distortion is taken out when preparing."""
        lens = self.lens()
        return lens.model == "equidistant" or bool(lens.coefficients[PLAIN_COUNT:].any())

    def camera(self) -> Camera:
        """Of the frames as prepared, without the image size."""
        left = () if self.is_straightened else self.distortion[:PLAIN_COUNT]
        k1, k2, p1, p2, k3 = (*left, *[0.0] * (PLAIN_COUNT - len(left)))
        pinhole = self.model_dump(exclude={"width", "height", "distortion", "distortion_model"})
        return Camera(**pinhole, distortion=(k1, k2, p1, p2, k3))


class DatasetPlayback(_Strict):
    """What an experiment uses when it does not say otherwise."""

    fps: float | None = Field(default=None, gt=0)
    start_s: float = Field(default=0.0, ge=0)
    end_s: float | None = Field(default=None, gt=0)


class Download(_Strict):
    """Where the data comes from. Without a verified checksum nothing is fetched unasked."""

    url: str
    mirrors: tuple[str, ...] = Field(
        default=(), description="further addresses of the same file, asked in their order"
    )
    size_bytes: int | None = Field(default=None, gt=0)
    sha256: str = Field(default=UNVERIFIED, pattern=rf"^([0-9a-f]{{64}}|{UNVERIFIED})$")
    unpack: Literal["tar", "zip", "none"] = "none"
    into: str = Field(default="", description="folder below the data folder that it unpacks to")

    @property
    def verified(self) -> bool:
        """True when the checksum was seen by whoever wrote the recipe."""
        return self.sha256 != UNVERIFIED


class Synthetic(_Strict):
    """Options of slambed-synth, named as on its command line with '_' for '-'."""

    trajectory: str = Field(
        default="spline",
        description="a named path, or a TUM-format .txt file in catalog/datasets/ or where data is",
    )
    seconds: float | None = Field(default=None, gt=0)
    seed: int = 1
    motion_blur_s: float | None = Field(default=None, ge=0)
    noise: float | None = Field(default=None, ge=0)
    depth_noise: float | None = Field(default=None, ge=0)
    depth_holes: float | None = Field(default=None, ge=0, le=1)
    max_depth_m: float | None = Field(default=None, ge=0.5, le=13)
    moving_objects: int | None = Field(default=None, ge=0)
    width: int | None = Field(default=None, ge=32)
    height: int | None = Field(default=None, ge=32)
    texel_scale: float | None = Field(default=None, ge=0.5)
    open_stretches: int | None = Field(default=None, ge=0)
    focal_error: float | None = None
    distortion: float | None = None
    right_yaw_deg: float | None = None
    right_pitch_deg: float | None = None
    right_roll_deg: float | None = None
    readout_s: float | None = Field(default=None, ge=0)
    exposure_wander: float | None = Field(default=None, ge=0)
    people: int | None = Field(default=None, ge=0)
    activity: Literal["walking", "crossing", "sitting", "mixed"] | None = None
    labels: bool | None = None
    blackout_start_s: float | None = Field(default=None, ge=0)
    blackout_end_s: float | None = Field(default=None, ge=0)

    @property
    def path_file(self) -> str | None:
        """The trajectory when it is a file, else None."""
        return self.trajectory if self.trajectory.endswith(".txt") else None


_LATER = {
    "width", "height", "texel_scale", "open_stretches", "focal_error", "distortion",
    "right_yaw_deg", "right_pitch_deg", "right_roll_deg", "readout_s", "exposure_wander",
    "people", "activity", "labels", "max_depth_m",
}  # fmt: skip
"""Options that came with streets, people and the hall: what asks for none keeps its key."""


def split_pattern(pattern: str) -> tuple[Path | None, str]:
    """A pattern of `paths` as the folder that it starts from and what glob() takes below it; None
    stands for every folder of the search path. Only absolute ones (`~` too) have a folder of
    their own."""
    path = Path(pattern).expanduser()
    if not path.is_absolute():
        return None, pattern
    return Path(path.anchor), str(path.relative_to(path.anchor))


class Dataset(_Strict):
    """One sequence: recorded (reader), generated (synthetic), a part of another one (window_of) or
    a choice of others (first_of)."""

    id: str = Field(pattern=r"^[a-z0-9][a-z0-9_]*$")
    title: str
    aliases: tuple[str, ...] = ()
    sensor: Sensor = "rgbd"
    reader: str | None = None
    paths: tuple[str, ...] = ()
    camera: CameraRecipe | None = None
    depth_unit_m: float = Field(default=0.0, ge=0)
    close_depth_baselines: float = Field(default=40.0, gt=0)
    fps: float = Field(default=30.0, gt=0)
    playback: DatasetPlayback = DatasetPlayback()
    groundtruth: str | None = None
    reader_options: dict[str, Any] = Field(default_factory=dict)
    download: Download | None = None
    license: str = ""
    note: str = ""
    synthetic: Synthetic | None = None
    first_of: tuple[str, ...] = ()
    window_of: str | None = None
    """Of this dataset `playback` plays a part: no copy is made."""
    prior_map: str | None = None
    """Prepared input that a parameter with the value `dataset` stands for (docs/inputs.md)."""
    reference: str | None = None
    """Prepared input whose path runs on this dataset are compared with."""

    @model_validator(mode="before")
    @classmethod
    def _in_words_of_today(cls, found: Any) -> Any:
        return keys_today(found, RECIPES) if isinstance(found, dict) else found

    @field_validator("paths")
    @classmethod
    def _are_patterns(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for pattern in value:
            try:
                next(Path(os.devnull).glob(split_pattern(pattern)[1]), None)
            except (ValueError, IndexError, NotImplementedError, RuntimeError) as refused:
                raise ValueError(f"'{pattern}' is no pattern of a path ({refused})") from None
        return value

    @model_validator(mode="after")
    def _one_origin(self) -> Self:
        origins = [self.reader, self.synthetic, self.first_of, self.window_of]
        if sum(map(bool, origins)) != 1:
            raise ValueError("exactly one of reader, synthetic, window_of and first_of is needed")
        if self.reader and not self.paths:
            raise ValueError("paths is needed: where the source lies below the search path")
        if self.reader and self.sensor == "rgbd" and self.depth_unit_m == 0:
            raise ValueError("depth_unit_m is needed for rgbd (TUM 0.0002, millimeters 0.001)")
        if self.sensor == "stereo" and self.camera is not None and self.camera.is_straightened:
            raise ValueError(
                "stereo pictures must be rectified: their camera has no distortion of this model; "
                "rectify them before, or take reader euroc, which does"
            )
        if self.synthetic and self.camera is not None:
            raise ValueError("camera belongs to recorded sequences; the generator has its own")
        return self

    def content_key(self) -> str:
        """Hash of everything that changes what the prepared sequence contains."""
        aside = {"aliases", "paths", "playback", "download", "license", "note"}
        aside |= {"window_of", "prior_map", "reference"}
        content = self.model_dump(mode="json", exclude=aside)
        # What a recipe does not ask for leaves its key as it was before one could ask for it.
        camera = content["camera"]
        if camera is not None and camera["distortion_model"] == "radial-tangential":
            del camera["distortion_model"]
        if content["synthetic"] is not None:
            asked = self.model_dump(mode="json", exclude_unset=True)["synthetic"]
            old = Synthetic.model_fields.keys() - _LATER
            kept = {k: v for k, v in content["synthetic"].items() if k in old or k in asked}
            content["synthetic"] = kept
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
