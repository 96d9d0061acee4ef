# SPDX-License-Identifier: Apache-2.0
"""Reads camera calibrations of ASL (EuRoC), Kalibr, OpenCV, ROS, ORB-SLAM and camodocal (VINS)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from slambed.data.lens import LARGEST_SKEW_PX, Lens, coefficients_of, model_of
from slambed.data.model import LARGEST_SIDE
from slambed.data.rotations import check_pose
from slambed.data.text_file import read_lines
from slambed.errors import SlambedError
from slambed.files.yaml_source import in_words
from slambed.files.yaml_text import problem_of, read_yaml

Floats = NDArray[np.float64]

#: Of pixels and meters in a calibration.
_LARGEST = 1e6
#: Two statements about one baseline may differ by as much.
_BASELINE_SHARE = 0.01
#: What only OpenCV's own parser accepts: its first line, with or without a comment, and its types.
_OPENCV = re.compile(r"^%YAML:?[ \t]*1\.0[ \t]*(#.*)?$|!!opencv[-_](nd[-_])?matrix", re.M)
#: OpenCV needs no blank behind a key.
_GLUED = re.compile(r"^(\s*[A-Za-z_][\w.]*):(?=[^\s:])", re.M)


@dataclass(frozen=True)
class CalibratedCamera:
    """One camera of a file."""

    size: tuple[int, int]
    lens: Lens
    pose: Floats | None = None
    """[4,4] as in the file: T_body_camera (ASL), or the transform from the previous camera
    (Kalibr)."""
    bf: float | None = None
    """fx times baseline, if the file contains it."""
    remarks: tuple[str, ...] = ()
    """What else the file says that a dataset file needs."""


def read_asl(file: Path) -> CalibratedCamera:
    """Reads the sensor.yaml of a camera, including its pose on the body."""
    kind, data = _load(file)
    if kind != "an ASL sensor.yaml":
        raise SlambedError(
            f"{file}: this is {kind}, expected an ASL sensor.yaml (intrinsics, resolution, T_BS); "
            f"'slambed data import-camera {file}' makes the camera of a dataset file of it"
        )
    return _checked(_asl, data, file, kind)[0]


def read_cameras(file: Path) -> tuple[str, list[CalibratedCamera]]:
    """Returns the kind of the file and its cameras."""
    kind, data = _load(file)
    readers = {
        "an ASL sensor.yaml": _asl,
        "a Kalibr camchain": _kalibr,
        "an OpenCV or ROS calibration": _opencv,
        "a settings file of ORB-SLAM": _orbslam,
        "a calibration of camodocal (VINS)": _camodocal,
    }
    if kind not in readers:
        raise SlambedError(
            f"{file}: this is {kind}; known are ASL (EuRoC) sensor.yaml, Kalibr camchains, OpenCV "
            "and ROS calibrations, settings of ORB-SLAM, and cameras of camodocal (VINS)"
        )
    return kind, _checked(readers[kind], data, file, kind)


def _load(file: Path) -> tuple[str, dict[str, Any]]:
    text = "\n".join(read_lines(file))
    text = re.sub(r"(?m)\n---[ \t]*\s*\Z", "\n", text)  # rostopic echo ends each message so
    if _OPENCV.search(text) is not None:
        text = _GLUED.sub(r"\1: ", _OPENCV.sub("", text))
    try:
        data = read_yaml(text)
    except yaml.YAMLError as broken:
        problem, line = problem_of(broken, text)
        raise SlambedError(f"{file}:{line}: not YAML: {problem}; correct the file") from None
    if not isinstance(data, dict):
        return "no calibration", {}
    return _kind_of(data), data


def _kind_of(data: Mapping[str, Any]) -> str:
    if "cam0" in data:
        return "a Kalibr camchain"
    if any(str(key).startswith(("Camera.", "Camera1.")) for key in data):
        return "a settings file of ORB-SLAM"
    if "model_type" in data:
        return "a calibration of camodocal (VINS)"
    if any(name in data for name in _MATRIX):
        return "an OpenCV or ROS calibration"
    return "an ASL sensor.yaml" if "intrinsics" in data or "T_BS" in data else "no calibration"


def _checked(
    read: Callable[[dict[str, Any], str], list[CalibratedCamera]],
    data: dict[str, Any],
    file: Path,
    kind: str,
) -> list[CalibratedCamera]:
    try:
        return read(data, str(file))
    except KeyError as missing:
        raise SlambedError(f"{file}: key {missing} is missing, which {kind} has") from None
    except (ValueError, ArithmeticError) as broken:
        raise SlambedError(f"{file}: not {kind}: {broken}; correct the file") from None
    except (TypeError, AttributeError, IndexError):
        raise SlambedError(
            f"{file}: not {kind}: a number, a list or a mapping is where another of them is "
            "expected; correct the file"
        ) from None


def _listed(value: Any, what: str, count: int | None = None) -> list[float]:
    """Returns a list of numbers. Raises ValueError for anything else."""
    if not isinstance(value, list) or count not in (None, len(value)):
        found = f"{len(value)} values" if isinstance(value, list) else in_words(value)
        expected = "a list of numbers" if count is None else f"{count} numbers"
        raise ValueError(f"its {what} are {found}, expected {expected}")
    return [float(number) for number in value]


def _mapped(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"its {what} is {in_words(value)}, expected a mapping of keys")
    return value


def _lens(intrinsics: Any, model: object, distortion: Any, where: str) -> Lens:
    fx, fy, cx, cy = _listed(intrinsics, "intrinsics", 4)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    if not (fx > 0 and fy > 0 and np.abs(matrix).max() <= _LARGEST):
        found = " ".join(f"{value:g}" for value in (fx, fy, cx, cy))
        raise SlambedError(
            f"{where}: intrinsics {found}, expected focal lengths above 0, in pixels; "
            "calibrate again"
        )
    name = model_of(str(model), where)
    return Lens(matrix, coefficients_of(_listed(distortion, "coefficients"), name, where), name)


def _resolution(given: Any) -> tuple[int, int]:
    if not isinstance(given, list) or len(given) != 2:
        raise ValueError(f"its resolution is {given!r}, expected [width, height]")
    return _size(*given)


def _size(width: Any, height: Any) -> tuple[int, int]:
    size = int(width), int(height)
    if min(size) < 1 or max(size) > LARGEST_SIDE:
        raise ValueError(f"a picture of {size[0]}x{size[1]} pixels")
    return size


def _must_be_pinhole(data: Mapping[str, Any], where: str) -> None:
    if (model := str(data.get("camera_model", "pinhole"))) != "pinhole":
        raise SlambedError(
            f"{where}: camera model '{model}' is not supported, expected pinhole; calibrate with a "
            "pinhole model (radtan or equi), or undistort the pictures before"
        )


def _pose(values: Any, where: str) -> Floats:
    given = np.array(values, dtype=np.float64)
    if given.size != 16:
        raise SlambedError(f"{where}: {given.size} numbers, expected 4x4; correct the file")
    matrix = given.reshape(4, 4)
    check_pose(matrix, where)
    if not np.abs(matrix).max() <= _LARGEST:
        raise SlambedError(
            f"{where}: a number of the pose is {np.abs(matrix).max():g}, expected meters; "
            "calibrate again"
        )
    return matrix


def _asl(data: dict[str, Any], where: str) -> list[CalibratedCamera]:
    _must_be_pinhole(data, where)
    lens = _lens(
        data["intrinsics"],
        data.get("distortion_model", "radial-tangential"),
        data["distortion_coefficients"],
        where,
    )
    size = _resolution(data["resolution"])
    return [
        CalibratedCamera(size, lens, _pose(_mapped(data["T_BS"], "T_BS")["data"], f"{where}: T_BS"))
    ]


def _kalibr(data: dict[str, Any], where: str) -> list[CalibratedCamera]:
    cameras: list[CalibratedCamera] = []
    to_imu_before: Floats | None = None
    names = (key for key in data if re.fullmatch(r"cam\d+", key))
    for name in sorted(names, key=lambda name: int(name.removeprefix("cam"))):
        entry, place = _mapped(data[name], name), f"{where}: {name}"
        _must_be_pinhole(entry, place)
        lens = _lens(
            entry["intrinsics"], entry["distortion_model"], entry["distortion_coeffs"], place
        )
        before, to_imu = entry.get("T_cn_cnm1"), _camera_to_imu(entry, place)
        pose = None if before is None else _pose(before, f"{place}: T_cn_cnm1")
        if pose is None and to_imu is not None and to_imu_before is not None:
            # OpenVINS's camchains have each camera's place on the IMU only.
            pose = np.linalg.inv(to_imu) @ to_imu_before
        to_imu_before = to_imu
        cameras.append(CalibratedCamera(_resolution(entry["resolution"]), lens, pose))
    return cameras


def _camera_to_imu(entry: Mapping[str, Any], place: str) -> Floats | None:
    """Returns the camera's pose on the IMU, which Kalibr writes as its inverse."""
    if (given := entry.get("T_imu_cam")) is not None:
        return _pose(given, f"{place}: T_imu_cam")
    if (given := entry.get("T_cam_imu")) is not None:
        return np.asarray(np.linalg.inv(_pose(given, f"{place}: T_cam_imu")))
    return None


_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "k", "M1")
_DISTORTION = (
    "distortion_coefficients", "distCoeffs", "Distortion_Coefficients", "dist_coeffs", "D", "d",
    "D1",
)  # fmt: skip
_PROJECTION = ("projection_matrix", "P", "p")
_WIDTH, _HEIGHT = (
    ("image_width", "image_Width", "width"),
    ("image_height", "image_Height", "height"),
)


def _opencv(data: dict[str, Any], where: str) -> list[CalibratedCamera]:
    matrix = np.array(_numbers(_first(data, _MATRIX)), dtype=np.float64).reshape(3, 3)
    if not np.allclose(matrix[2], [0, 0, 1], atol=1e-6):
        found = " ".join(f"{value:g}" for value in matrix[2])
        raise ValueError(
            f"the last row of its camera matrix is {found}, expected 0 0 1 (written by columns?)"
        )
    if abs(matrix[0, 1]) > LARGEST_SKEW_PX:
        raise ValueError(f"its camera matrix has a skew of {matrix[0, 1]:g}, expected 0")
    region = data.get("roi")
    if isinstance(region, Mapping) and any(region.get(key) for key in ("x_offset", "y_offset")):
        raise ValueError("its pictures are a region (roi) of those that its numbers are of")
    # OpenCV's own calibration program writes fisheye_model.
    usual = "equidistant" if data.get("fisheye_model") else "plumb_bob"
    model = data.get("distortion_model") or usual
    for name in ("binning_x", "binning_y"):
        if float(data.get(name) or 0) > 1:
            raise ValueError(f"{name} is {data[name]}, so its numbers are of larger pictures")
    intrinsics = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
    lens = _lens(intrinsics, model, _numbers(_first(data, _DISTORTION)), where)
    camera = CalibratedCamera(_size(_first(data, _WIDTH), _first(data, _HEIGHT)), lens)
    return [_with_projection(camera, data)]


def _with_projection(camera: CalibratedCamera, data: Mapping[str, Any]) -> CalibratedCamera:
    """Adds what ROS writes about rectified pictures: another pinhole, and in the file of the right
    camera -fx times the baseline."""
    given = next((data[name] for name in _PROJECTION if name in data), None)
    if given is None:
        return camera
    projection = np.array(_numbers(given), dtype=np.float64).reshape(3, 4)
    if not np.isfinite(projection).all() or np.abs(projection).max() > _LARGEST:
        raise ValueError("projection_matrix has no sensible numbers")
    remarks = camera.remarks
    if not np.allclose(projection[:, :3], camera.lens.matrix):
        fx, fy, cx, cy = (projection[i] for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
        remarks += (
            f"rectified pictures have fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g} "
            "(its projection matrix) and no distortion",
        )
    bf = -float(projection[0, 3])
    return replace(camera, bf=bf if bf > 0 else camera.bf, remarks=remarks)


def _orbslam(data: dict[str, Any], where: str) -> list[CalibratedCamera]:
    old = not any(str(key).startswith("Camera1.") for key in data)
    first = _orbslam_camera(data, "Camera" if old else "Camera1", where)
    fx = float(first.lens.matrix[0, 0])
    bf = data.get("Camera.bf")
    if bf is None and (baseline_m := data.get("Stereo.b")) is not None:
        bf = fx * float(baseline_m)
    remarks = []
    for name in ("RGBD.DepthMapFactor", "DepthMapFactor"):
        if name in data:
            if not (factor := float(data[name])) > 0:
                raise ValueError(f"{name} is {factor:g}, expected above 0")
            remarks.append(f"{name} {factor:g} is 'depth_unit_m: {1 / factor:.6g}'")
    if "Camera.newWidth" in data or "Camera.newHeight" in data:
        remarks.append("ORB-SLAM makes pictures smaller (Camera.newWidth), slambed does not")
    pose = None
    if (second_to_first := data.get("Stereo.T_c1_c2")) is not None:
        first_second = _pose(_numbers(second_to_first), f"{where}: Stereo.T_c1_c2")
        pose = np.asarray(np.linalg.inv(first_second))
        placed = fx * float(first_second[0, 3])
        if bf is None and "Camera2.fx" not in data:
            bf = placed
        elif bf is not None and abs(float(bf) - placed) > _BASELINE_SHARE * abs(placed):
            remarks.append(
                f"its baseline is {float(bf) / fx:.4g} m, and {first_second[0, 3]:.4g} m in "
                "Stereo.T_c1_c2; the first is taken"
            )
    first = replace(first, bf=None if bf is None else float(bf), remarks=tuple(remarks))
    if "Camera2.fx" not in data:
        return [first]
    return [first, replace(_orbslam_camera(data, "Camera2", where), pose=pose)]


def _orbslam_camera(data: dict[str, Any], head: str, where: str) -> CalibratedCamera:
    intrinsics = [data[f"{head}.{name}"] for name in ("fx", "fy", "cx", "cy")]
    kind = str(data.get("Camera.type", "PinHole"))
    if kind not in _ORBSLAM_DISTORTION:
        raise SlambedError(
            f"{where}: Camera.type '{kind}' is not supported; known: "
            f"{', '.join(_ORBSLAM_DISTORTION)}"
        )
    model, names = _ORBSLAM_DISTORTION[kind]
    unused = [
        name
        for name in ("k1", "k2", "k3", "k4", "p1", "p2")
        if name not in names and float(data.get(f"{head}.{name}") or 0) != 0
    ]
    if unused:
        likely = "PinHole" if kind == "Rectified" else "KannalaBrandt8"
        raise ValueError(
            f"{head}.{unused[0]} is not one of a {kind} camera; is Camera.type {likely}?"
        )
    distortion = [data.get(f"{head}.{name}", 0.0) for name in names]
    lens = _lens(intrinsics, model, distortion, where)
    return CalibratedCamera(_size(data["Camera.width"], data["Camera.height"]), lens)


#: Camera.type -> distortion model, and its coefficients.
_ORBSLAM_DISTORTION = {
    "PinHole": ("plumb_bob", ("k1", "k2", "p1", "p2", "k3")),
    "Rectified": ("plumb_bob", ()),
    "KannalaBrandt8": ("equidistant", ("k1", "k2", "k3", "k4")),
}


#: model_type -> intrinsics, distortion model, and its coefficients. Camodocal counts those of a
#: fisheye lens from k2, OpenCV from k1.
_CAMODOCAL = {
    "PINHOLE": (("fx", "fy", "cx", "cy"), "plumb_bob", ("k1", "k2", "p1", "p2")),
    "KANNALA_BRANDT": (("mu", "mv", "u0", "v0"), "equidistant", ("k2", "k3", "k4", "k5")),
}


def _camodocal(data: dict[str, Any], where: str) -> list[CalibratedCamera]:
    if (kind := str(data["model_type"]).upper()) not in _CAMODOCAL:
        raise SlambedError(
            f"{where}: model_type '{kind}' is not supported; known: {', '.join(_CAMODOCAL)}; "
            "calibrate again, or undistort the pictures before"
        )
    names, model, coefficients = _CAMODOCAL[kind]
    projection = data["projection_parameters"]
    # Coefficients of a fisheye lens are written in either place.
    distortion = {**projection, **(data.get("distortion_parameters") or {})}
    lens = _lens(
        [projection[name] for name in names],
        model,
        [distortion.get(name, 0.0) for name in coefficients],
        where,
    )
    return [CalibratedCamera(_size(data["image_width"], data["image_height"]), lens)]


def _first(data: Mapping[str, Any], names: Sequence[str]) -> Any:
    for name in names:
        if name in data:
            return data[name]
    raise KeyError(names[0])


def _numbers(value: Any) -> list[float]:
    """Parses an OpenCV matrix ({rows, cols, data}), or a list of numbers or rows."""
    inner = value["data"] if isinstance(value, dict) else value
    return [float(number) for number in np.array(inner, dtype=np.float64).ravel()]
