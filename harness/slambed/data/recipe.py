# SPDX-License-Identifier: Apache-2.0
"""Models of catalog/datasets/*.yaml; unknown keys are errors."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from slambed.data.lens import PLAIN_COUNT, Lens, coefficients_of, model_of
from slambed.data.model import LARGEST_SIDE, Camera, Sensor
from slambed.errors import SlambedError
from slambed.files.names import Id, Name, Sha256, Title
from slambed.files.outputs import at_home
from slambed.files.yaml_source import MisplacedError, matching
from slambed.older_names import RECIPES, keys_today

UNVERIFIED = "unverified here"
LARGEST_COEFFICIENT = 1000.0
"""Of a distortion; strong lenses have up to a few tens."""
LARGEST_ASPECT = 10.0
"""Ratio of the focal lengths along a row and along a column; about 1, of an anamorphic lens 2."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_word_for_a_number(cls, value: Any, field: ValidationInfo) -> Any:
        """YAML reads `yes`, `on` and `no` as true and false, which pydantic takes for 1 and 0."""
        kinds = _kinds_in(cls.model_fields[str(field.field_name)].annotation)
        given = value if isinstance(value, list | tuple) else [value]
        if (
            kinds & {int, float}
            and bool not in kinds
            and any(isinstance(item, bool) for item in given)
        ):
            raise ValueError("expected a number, not true or false (yes, no, on, off)")
        return value


def _kinds_in(annotation: Any) -> set[Any]:
    """Returns the plain types that an annotation is made of."""
    parts = get_args(annotation)
    return set().union(*map(_kinds_in, parts)) if parts else {annotation}


class CameraRecipe(_Strict):
    """Camera of the source images; omitted if the dataset has its own calibration. With `euroc`:
    the camera to which pictures are rectified; its width, height and bf are not used."""

    width: int = Field(gt=0, le=LARGEST_SIDE)
    """In pixels."""
    height: int = Field(gt=0, le=LARGEST_SIDE)
    """In pixels."""
    fx: float = Field(gt=0)
    """Focal length along a row, in pixels."""
    fy: float = Field(gt=0)
    """Focal length along a column, in pixels."""
    cx: float
    """Column of the principal point, in pixels."""
    cy: float
    """Row of the principal point, in pixels."""
    bf: float = Field(ge=0, description="fx times baseline, px m")
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """k1 k2 p1 p2 [k3 [k4 k5 k6]] in OpenCV's order, or k1 k2 k3 k4 for `equidistant`."""
    distortion_model: str = "radial-tangential"
    """Distortion that nodes do not support (equidistant, k4 and higher) is removed during
    preparation."""

    @model_validator(mode="after")
    def _known_distortion(self) -> Self:
        try:
            self.lens()
        except SlambedError as refused:
            raise ValueError(str(refused)) from None
        return self

    def must_be_real(self) -> None:
        """Raises MisplacedError for numbers that no camera has."""
        if not 1 / LARGEST_ASPECT <= self.fx / self.fy <= LARGEST_ASPECT:
            what = f"is {self.fx:g}, but fy {self.fy:g} (real ones are about equal)"
            raise MisplacedError(f"{what}; correct the calibration", ("fx",))
        largest = max(self.distortion, key=abs, default=0.0)
        if abs(largest) > LARGEST_COEFFICIENT:
            what = f"no lens has a coefficient of {largest:g}"
            raise MisplacedError(f"{what}; correct the calibration", ("distortion",))
        if self._mirrors():
            what = "with these numbers points in the picture would change sides"
            raise MisplacedError(f"{what}; correct the calibration", ("distortion",))

    def _mirrors(self) -> bool:
        """Whether the radial distortion turns to the other side before the nearest edge of the
        picture. A real lens does not: where it bends inwards, a point at the edge is even further
        outside without the distortion."""
        lens = self.lens()
        if lens.model == "equidistant":
            return False
        k1, k2, _, _, k3, k4, k5, k6 = [*lens.coefficients, *[0.0] * 8][:8]
        edge = min(self.width / self.fx, self.height / self.fy) / 2
        with np.errstate(all="ignore"):  # an absurd focal length makes infinite squares
            r2 = np.linspace(0, edge, 50) ** 2
            above = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
            return bool(((above <= 0) | (below <= 0)).any())

    def lens(self) -> Lens:
        """Returns the lens model of the source images."""
        model = model_of(self.distortion_model, "distortion_model")
        matrix = np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])
        return Lens(matrix, coefficients_of(self.distortion, model, "distortion"), model)

    @property
    def is_straightened(self) -> bool:
        """True if the distortion is removed during preparation."""
        lens = self.lens()
        return lens.model == "equidistant" or bool(lens.coefficients[PLAIN_COUNT:].any())

    def camera(self) -> Camera:
        """Returns the camera of the prepared frames."""
        left = () if self.is_straightened else self.distortion[:PLAIN_COUNT]
        k1, k2, p1, p2, k3 = (*left, *[0.0] * (PLAIN_COUNT - len(left)))
        pinhole = self.model_dump(exclude={"width", "height", "distortion", "distortion_model"})
        return Camera(**pinhole, distortion=(k1, k2, p1, p2, k3))


class DatasetPlayback(_Strict):
    """Defaults for experiments that do not set these options."""

    fps: float | None = Field(default=None, ge=0.001)
    """Frames per second; null plays as recorded."""
    start_s: float = Field(default=0.0, ge=0)
    """Start of playback, in seconds from the first frame of the prepared sequence."""
    end_s: float | None = Field(default=None, gt=0)
    """End of playback, in seconds from the same frame; null plays to the end."""

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        if self.end_s is not None and self.end_s <= self.start_s:
            raise MisplacedError(
                f"{self.end_s:g} is not after start_s {self.start_s:g}", ("end_s",)
            )
        return self


class Download(_Strict):
    """Source of the data. Without a verified checksum a download requires --force."""

    url: str
    """Address of the file; `file:///...` for one on this machine."""
    mirrors: tuple[str, ...] = Field(
        default=(), description="further addresses of the same file, asked in their order"
    )
    size_bytes: int | None = Field(default=None, gt=0)
    """Size of the file."""
    sha256: Sha256 | Literal["unverified here"] = UNVERIFIED
    """Digest of the file; `unverified here` is fetched with `--force` only."""
    unpack: Literal["tar", "zip", "none"] = "none"
    """How the file is unpacked."""
    into: str = Field(default="", description="folder below the data folder that it unpacks to")

    @field_validator("into")
    @classmethod
    def _below(cls, into: str) -> str:
        path = PurePosixPath(into)
        if path.is_absolute() or into.startswith("~") or ".." in path.parts:
            raise ValueError(
                f"'{into}' is not below the data folder; write a path that begins there, such as "
                "tum/freiburg1"
            )
        return into

    @property
    def verified(self) -> bool:
        """True if the author of the recipe recorded the checksum."""
        return self.sha256 != UNVERIFIED


class Synthetic(_Strict):
    """Options of slambed-synth, named like its command line options with '_' instead of '-'."""

    trajectory: str = Field(
        default="spline",
        description="a named path, or a TUM-format .txt file in catalog/datasets/ or where data is",
    )
    seconds: float | None = Field(default=None, gt=0)
    """Length; null takes the whole path."""
    seed: int = Field(default=1, ge=0)
    """Of scene, path and noise."""
    motion_blur_s: float | None = Field(default=None, ge=0, le=0.1)
    """Exposure time."""
    noise: float | None = Field(default=None, ge=0, le=50)
    """Standard deviation of the gray values."""
    depth_noise: float | None = Field(default=None, ge=0, le=20)
    """Depth noise; 1 is a Kinect's."""
    depth_holes: float | None = Field(default=None, ge=0, le=1)
    """Share of the depth that is lost in patches."""
    max_depth_m: float | None = Field(default=None, ge=0.5, le=13)
    """No depth beyond this distance."""
    moving_objects: int | None = Field(default=None, ge=0, le=20)
    """Walking figures in a room, oncoming cars in a street."""
    width: int | None = Field(default=None, ge=32)
    """Of the pictures, in pixels."""
    height: int | None = Field(default=None, ge=32)
    """Of the pictures, in pixels."""
    texel_scale: float | None = Field(default=None, ge=0.5, le=50)
    """Above 1: coarser textures."""
    open_stretches: int | None = Field(default=None, ge=0, le=20)
    """Stretches of a street with nothing near the road."""
    focal_error: float | None = Field(default=None, ge=-0.03, le=0.03)
    """The calibration's focal length is the true one times 1 + this."""
    distortion: float | None = Field(default=None, ge=-0.05, le=0.05)
    """Lens distortion left over: a ray's slope times 1 + this r^2."""
    right_yaw_deg: float | None = Field(default=None, ge=-0.1, le=0.1)
    """Turn of the right camera to the side."""
    right_pitch_deg: float | None = Field(default=None, ge=-0.1, le=0.1)
    """Turn of the right camera up or down."""
    right_roll_deg: float | None = Field(default=None, ge=-0.1, le=0.1)
    """Turn of the right camera about its axis."""
    readout_s: float | None = Field(default=None, ge=0, le=0.05)
    """Rolling shutter: time from the first row to the last."""
    exposure_wander: float | None = Field(default=None, ge=0, le=0.4)
    """Share by which the brightness wanders."""
    people: int | None = Field(default=None, ge=0, le=12)
    """Persons with moving limbs in a room."""
    activity: Literal["walking", "crossing", "sitting", "mixed"] | None = None
    """What the persons do."""
    labels: bool | None = Field(default=None, strict=True)
    """Whether labels.bin with the true masks and key points is written."""
    blackout_start_s: float | None = Field(default=None, ge=0)
    """When the lens is covered, in seconds from the first frame of the sequence."""
    blackout_end_s: float | None = Field(default=None, ge=0)
    """When it is free again, in seconds from the same frame."""

    @model_validator(mode="after")
    def _has_effect(self) -> Self:
        if self.activity is not None and not self.people:
            raise MisplacedError("is of people, and there are none; say people: 2", ("activity",))
        start_s, end_s = self.blackout_start_s, self.blackout_end_s
        if start_s is not None and end_s is None:
            raise MisplacedError(
                "without blackout_end_s the lens is never covered; say both", ("blackout_start_s",)
            )
        if start_s is not None and end_s is not None and end_s <= start_s:
            raise MisplacedError(
                f"{end_s:g} is not after blackout_start_s {start_s:g}", ("blackout_end_s",)
            )
        return self

    @property
    def path_file(self) -> str | None:
        """The trajectory if it is a file, else None."""
        return self.trajectory if self.trajectory.endswith(".txt") else None


_LATER = {
    "width", "height", "texel_scale", "open_stretches", "focal_error", "distortion",
    "right_yaw_deg", "right_pitch_deg", "right_roll_deg", "readout_s", "exposure_wander",
    "people", "activity", "labels", "max_depth_m",
}  # fmt: skip
"""Later options: a recipe that does not use them keeps its old key."""


def split_pattern(pattern: str) -> tuple[Path | None, str]:
    """Splits a pattern of `paths` into its start folder and the part for glob(). The folder is
    None for a relative pattern, which applies to every folder of the search path; absolute
    patterns may start with `~`."""
    path = at_home(pattern)
    if not path.is_absolute():
        return None, pattern
    return Path(path.anchor), str(path.relative_to(path.anchor))


DatasetName = Annotated[
    str,
    *matching(
        r"^([^./\x00-\x1f][^/\x00-\x1f]*|[^\x00-\x1f]+\.ya?ml)$",
        "the name of a dataset, or of a .yaml file",
    ),
]
"""As a dataset file names another one."""
_OF_THE_SOURCE = (
    "paths", "camera", "depth_unit_m", "close_depth_baselines", "fps", "groundtruth",
    "reader_options", "download",
)  # fmt: skip
_USELESS_BESIDE = {
    "window_of": _OF_THE_SOURCE,
    "first_of": (*_OF_THE_SOURCE, "sensor", "playback", "prior_map", "reference"),
}
"""Origin -> keys that only the dataset that it names can have."""


class Dataset(_Strict):
    """One sequence: recorded (reader), generated (synthetic), a part of another one (window_of),
    or the first available of others (first_of)."""

    id: Id
    """Name of the sequence, as of the file or of its folder."""
    title: Title
    """One line for lists and reports."""
    aliases: tuple[Name, ...] = ()
    """Further names of the sequence."""
    sensor: Sensor = "rgbd"
    """What a frame holds."""
    reader: str | None = None
    """Format of the recording: `tum`, `seven_scenes`, `kitti`, `euroc` or `bag`."""
    paths: tuple[str, ...] = ()
    """Patterns of the recording's place: below the search path or beside this file, absolute, or
    from `~`."""
    camera: CameraRecipe | None = None
    """Calibration, where the format brings none; with `euroc` what pictures are rectified to."""
    depth_unit_m: float = Field(default=0.0, ge=0)
    """Meters per step of the depth pictures; required for a recorded `rgbd`, without effect on
    generated sequences."""
    close_depth_baselines: float = Field(default=40.0, gt=0)
    """ORB-SLAM2's ThDepth: points nearer than this many baselines are close. Generated sequences
    have their own."""
    fps: float = Field(default=30.0, ge=0.001, le=10_000)
    """Nominal rate of the recording."""
    playback: DatasetPlayback = DatasetPlayback()
    """What an experiment's `playback` leaves open."""
    groundtruth: str | None = None
    """File of the true path, for `tum`, `kitti` and `euroc`."""
    reader_options: dict[str, Any] = Field(default_factory=dict)
    """Options of the reader."""
    download: Download | None = None
    """Where the recording can be had."""
    license: str = ""
    """License of the recording."""
    note: str = ""
    """What a reader must know."""
    synthetic: Synthetic | None = None
    """Options of the generator, instead of `reader`."""
    first_of: tuple[DatasetName, ...] = ()
    """Other datasets: the first one that is on this machine is played."""
    window_of: DatasetName | None = None
    """The dataset of which `playback` selects a part, without a copy."""
    prior_map: str | None = None
    """Prepared input used for parameters with the value `dataset` (docs/reference/input.md)."""
    reference: str | None = None
    """Prepared input with the path that runs on this dataset are compared with."""

    @model_validator(mode="before")
    @classmethod
    def _in_words_of_today(cls, found: Any) -> Any:
        return keys_today(found, RECIPES) if isinstance(found, dict) else found

    @field_validator("paths")
    @classmethod
    def _are_patterns(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for pattern in value:
            below = split_pattern(pattern)[1]
            if Path(below) == Path():
                raise ValueError(f"'{pattern}' names no file or folder below the data folders")
            # From Python 3.13 on glob() takes this for `*`.
            if any("**" in part and part != "**" for part in Path(below).parts):
                raise ValueError(f"'{pattern}' is no pattern of a path (** stands alone)")
            try:
                next(Path(os.devnull).glob(below), None)
            except (ValueError, IndexError, NotImplementedError, RuntimeError) as refused:
                raise ValueError(f"'{pattern}' is no pattern of a path ({refused})") from None
        return value

    @field_validator("camera")
    @classmethod
    def _is_real(cls, value: CameraRecipe | None) -> CameraRecipe | None:
        if value is not None:
            value.must_be_real()
        return value

    @field_validator("aliases")
    @classmethod
    def _differ(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if twice := [name for name in value if value.count(name) > 1]:
            raise ValueError(f"'{twice[0]}' is given twice; remove one")
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

    @model_validator(mode="after")
    def _nothing_useless(self) -> Self:
        for origin, useless in _USELESS_BESIDE.items():
            if not getattr(self, origin):
                continue
            for key in useless:
                if key in self.model_fields_set and getattr(self, key):
                    whose = f"means nothing beside {origin}, which names a dataset with its own"
                    raise MisplacedError(f"{whose}; remove it", (key,))
        return self

    def content_key(self) -> str:
        """Returns a hash of everything that affects the content of the prepared sequence."""
        aside = {"aliases", "paths", "playback", "download", "license", "note"}
        aside |= {"window_of", "prior_map", "reference"}
        content = self.model_dump(mode="json", exclude=aside)
        # Options that a recipe does not use are left out, so that its key does not change when they
        # are introduced.
        camera = content["camera"]
        if camera is not None and camera["distortion_model"] == "radial-tangential":
            del camera["distortion_model"]
        if content["synthetic"] is not None:
            asked = self.model_dump(mode="json", exclude_unset=True)["synthetic"]
            old = Synthetic.model_fields.keys() - _LATER
            kept = {k: v for k, v in content["synthetic"].items() if k in old or k in asked}
            content["synthetic"] = kept
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
