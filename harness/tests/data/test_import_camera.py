# SPDX-License-Identifier: Apache-2.0
"""`slambed data import-camera`: calibrations of other tools as the camera of a dataset file."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml
from command_line import slambed
from data_samples import one_line

from slambed.data.camera_files import read_cameras
from slambed.data.import_camera import camera_yaml
from slambed.data.recipe import CameraRecipe
from slambed.errors import SlambedError
from slambed.files.yaml_text import read_yaml

KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.02, 0.003, 0.0001]
  distortion_model: equidistant
  intrinsics: [190.5, 190.8, 254.9, 256.8]
  resolution: [512, 500]
cam1:
  T_cn_cnm1: [[1, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.1, 0, 0]
  distortion_model: radtan
  intrinsics: [200, 201, 250, 251]
  resolution: [512, 500]
"""
OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.1e+02, 0., 3.2e+02, 0., 5.2e+02,
       2.4e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 1.e-01, -2.e-01, 0., 0., 1.e-02 ]
"""
ROS = """image_width: 640
image_height: 480
camera_name: left
camera_matrix: {rows: 3, cols: 3, data: [510, 0, 320, 0, 520, 240, 0, 0, 1]}
distortion_model: rational_polynomial
distortion_coefficients: {rows: 1, cols: 8, data: [0.1, 0, 0, 0, 0, 0.2, 0, 0]}
"""
PROJECTION = "projection_matrix: {{data: [{k}, 0, 320, {t}, 0, {k}, 240, 0, 0, 0, 1, 0]}}\n"
ORBSLAM = """%YAML:1.0
Camera.fx: 535.4
Camera.fy: 539.2
Camera.cx: 320.1
Camera.cy: 247.6
Camera.k1: 0.1
Camera.k2: 0.0
Camera.p1: 0.0
Camera.p2: 0.0
Camera.width: 640
Camera.height: 480
Camera.bf: 40.0
"""

ORBSLAM3 = """%YAML:1.0
File.version: "1.0"
Camera.type: "KannalaBrandt8"
Camera1.fx: 190.5
Camera1.fy: 190.8
Camera1.cx: 254.9
Camera1.cy: 256.8
Camera1.k1: 0.01
Camera1.k2: 0.02
Camera1.k3: 0.003
Camera1.k4: 0.0001
Camera2.fx: 200.0
Camera2.fy: 201.0
Camera2.cx: 250.0
Camera2.cy: 251.0
Camera2.k1: 0.02
Stereo.T_c1_c2: !!opencv-matrix
  rows: 4
  cols: 4
  dt: f
  data:[1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
Camera.width: 512
Camera.height: 500
Viewer.PointSize:2
"""

CAMODOCAL = """%YAML:1.0
---
model_type: KANNALA_BRANDT
camera_name: camera
image_width: 512
image_height: 500
projection_parameters:
   k2: 0.01
   k3: 2.0e-02
   k4: 0.003
   k5: 0.0001
   mu: 190.5
   mv: 1.908e+02
   u0: 254.9
   v0: 256.8
"""


def imported(tmp_path: Path, text: str, number: int = 0, baseline_m: float | None = None) -> object:
    file = tmp_path / "other.yaml"
    file.write_text(text)
    return CameraRecipe(**read_yaml(camera_yaml(file, number, baseline_m)[0])["camera"])


ON_THE_IMU = """%YAML:1.0

cam0:
  {key}: [[0, -1, 0, {x0}], [1, 0, 0, {y0}], [0, 0, 1, 0.01], [0, 0, 0, 1]]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]
  distortion_model: radtan
  intrinsics: [400, 401, 367.2, 248.4] #fu, fv, cu, cv
  resolution: [752, 480]
cam1:
  {key}: [[0, -1, 0, {x1}], [1, 0, 0, {y1}], [0, 0, 1, 0.01], [0, 0, 0, 1]]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]
  distortion_model: radtan
  intrinsics: [400, 401, 367.2, 248.4]
  resolution: [752, 480]
"""


@pytest.mark.parametrize(
    "places",
    [
        {"key": "T_imu_cam", "x0": -0.02, "y0": -0.06, "x1": -0.02, "y1": 0.05},
        {"key": "T_cam_imu", "x0": 0.06, "y0": 0.02, "x1": -0.05, "y1": 0.02},
    ],
    ids=["OpenVINS", "Kalibr"],
)
def test_a_camchain_that_places_its_cameras_on_the_imu(
    tmp_path: Path, places: dict[str, object]
) -> None:
    camera = imported(tmp_path, ON_THE_IMU.format(**places))
    assert isinstance(camera, CameraRecipe) and camera.bf == pytest.approx(400 * 0.11)
    # Without its neighbor's place there is no baseline.
    alone = ON_THE_IMU.format(**places).replace(str(places["key"]), "T_other", 1)
    camera = imported(tmp_path, alone)
    assert isinstance(camera, CameraRecipe) and camera.bf == 0


@pytest.mark.parametrize(
    ("x", "y", "note"),
    [
        (-0.11, 0, []),
        (
            0.05,
            0.001,
            ["cam1 is 0.050 m to the left of this camera: as a stereo pair its pictures"],
        ),
        (0, -0.12, ["cam1 is not beside this camera but at x 0.000, y 0.120, z 0.000 m; as a"]),
    ],
    ids=["right", "left", "below"],
)
def test_a_rig_that_is_no_stereo_pair_is_told(
    tmp_path: Path, x: float, y: float, note: list[str]
) -> None:
    file = tmp_path / "rig.yaml"
    camera = yaml.safe_load(KALIBR)
    camera["cam1"]["T_cn_cnm1"] = [[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]]
    file.write_text(yaml.safe_dump(camera))
    text, (kind, *notes) = camera_yaml(file, 0, None)
    assert f"bf: {190.5 * math.hypot(x, y):.9g}" in text and kind.endswith("a Kalibr camchain")
    assert len(notes) == len(note) and all(map(str.startswith, notes, note))


@pytest.mark.parametrize("first", ["%YAML:1.0", "%YAML:1.0 # the file type", "%YAML 1.0"])
def test_the_first_line_of_opencvs_yaml(tmp_path: Path, first: str) -> None:
    written = f"{first}\n\n{KALIBR}"
    assert imported(tmp_path, written) == imported(tmp_path, KALIBR)
    with pytest.raises(SlambedError, match=f"other.yaml:{written.count(chr(10)) + 1}: not YAML"):
        imported(tmp_path, f"{written}a: b: c\n")


def test_a_camchain(tmp_path: Path) -> None:
    first = imported(tmp_path, KALIBR)
    assert first == CameraRecipe(
        width=512,
        height=500,
        fx=190.5,
        fy=190.8,
        cx=254.9,
        cy=256.8,
        bf=19.05,
        distortion=(0.01, 0.02, 0.003, 0.0001),
        distortion_model="equidistant",
    )
    second = imported(tmp_path, KALIBR, 1, baseline_m=0.5)
    assert second == CameraRecipe(
        width=512, height=500, fx=200, fy=201, cx=250, cy=251, bf=100, distortion=(-0.2, 0.1, 0, 0)
    )
    with pytest.raises(SlambedError, match=r"a Kalibr camchain with 2 camera\(s\)"):
        imported(tmp_path, KALIBR, 2)


def test_cameras_of_a_camchain_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    first, _, more = KALIBR.partition("cam1:")
    chain = "".join(f"cam{i}:{more.replace('250', str(250 + i))}" for i in range(1, 12))
    (tmp_path / "chain.yaml").write_text(first + chain)
    _, cameras = read_cameras(tmp_path / "chain.yaml")
    assert [camera.lens.matrix[0, 2] for camera in cameras[1:]] == [*range(251, 262)]


@pytest.mark.parametrize(
    ("text", "distortion"), [(OPENCV, (0.1, -0.2, 0, 0, 0.01)), (ROS, (0.1, 0, 0, 0, 0, 0.2, 0, 0))]
)
def test_opencv_and_ros(tmp_path: Path, text: str, distortion: tuple[float, ...]) -> None:
    assert imported(tmp_path, text, 0, 0.1) == CameraRecipe(
        width=640, height=480, fx=510, fy=520, cx=320, cy=240, bf=51, distortion=distortion
    )


def test_settings_of_orbslam(tmp_path: Path) -> None:
    assert imported(tmp_path, ORBSLAM) == CameraRecipe(
        width=640,
        height=480,
        fx=535.4,
        fy=539.2,
        cx=320.1,
        cy=247.6,
        bf=40,
        distortion=(0.1, 0, 0, 0, 0),
    )


def test_rectified_pictures_of_ros(tmp_path: Path) -> None:
    """The right camera's projection has -fx times the baseline in it."""
    file = tmp_path / "right.yaml"
    file.write_text(ROS + PROJECTION.format(k=500, t=-60))
    text, (_, rectified) = camera_yaml(file, 0, None)
    assert "fx: 510.0, fy: 520.0" in text and "bf: 60," in text
    assert rectified.startswith(
        "rectified pictures have fx 500, fy 500, cx 320, cy 240 (its projection"
    )
    file.write_text(ROS + PROJECTION.format(k=500, t=0))
    text, (_, rectified, single) = camera_yaml(file, 0, None)
    assert "bf: 0," in text and single.startswith("bf is 0")
    same = "projection_matrix: [510, 0, 320, -51, 0, 520, 240, 0, 0, 0, 1, 0]\n"
    file.write_text(ROS + same)
    assert "bf: 51," in camera_yaml(file, 0, None)[0] and len(camera_yaml(file, 0, None)[1]) == 1
    file.write_text(ROS + same.replace("-51", ".nan"))
    with pytest.raises(SlambedError, match="projection_matrix has no sensible numbers"):
        camera_yaml(file, 0, None)


def test_cameras_of_vins(tmp_path: Path) -> None:
    fisheye = imported(tmp_path, CAMODOCAL)
    kalibr = imported(tmp_path, KALIBR)
    assert isinstance(kalibr, CameraRecipe) and fisheye == kalibr.model_copy(update={"bf": 0})
    apart = CAMODOCAL.replace("   k2", "distortion_parameters:\n   k2").split(
        "projection_parameters:\n"
    )
    lens, camera = apart[1].split("   mu")
    text = f"{apart[0]}{lens}projection_parameters:\n   mu{camera}"
    assert imported(tmp_path, text) == fisheye
    pinhole = text.replace("KANNALA_BRANDT", "PINHOLE")
    for old, new in zip(("mu", "mv", "u0", "v0"), ("fx", "fy", "cx", "cy"), strict=True):
        pinhole = pinhole.replace(f" {old}:", f" {new}:")
    found = imported(tmp_path, pinhole.replace("k2", "k1", 1))
    assert isinstance(found, CameraRecipe) and (found.fx, found.distortion) == (
        190.5,
        (0.01, 0, 0, 0),
    )
    with pytest.raises(
        SlambedError, match="model_type 'MEI' is not supported; known: PINHOLE, KANN"
    ):
        imported(tmp_path, text.replace("KANNALA_BRANDT", "MEI"))
    with pytest.raises(SlambedError, match="key 'mu' is missing, which a calibration of camodocal"):
        imported(tmp_path, text.replace("mu:", "nu:"))


def test_settings_of_orbslam3(tmp_path: Path) -> None:
    """A second camera; and what OpenCV reads without a blank behind the colon."""
    first = imported(tmp_path, ORBSLAM3)
    kalibr = imported(tmp_path, KALIBR)
    assert isinstance(first, CameraRecipe) and isinstance(kalibr, CameraRecipe)
    assert first.bf == pytest.approx(19.05) and first == kalibr.model_copy(update={"bf": first.bf})
    second = imported(tmp_path, ORBSLAM3, 1, baseline_m=0.5)
    assert isinstance(second, CameraRecipe)
    assert (second.fx, second.bf, second.distortion) == (200, 100, (0.02, 0, 0, 0))


def test_the_baseline_and_the_depth_of_orbslam3(tmp_path: Path) -> None:
    file = tmp_path / "depth.yaml"
    text = ORBSLAM.replace("Camera.", "Camera1.").replace("Camera1.width", "Camera.width")
    text = text.replace("Camera1.height", "Camera.height")
    text = text.replace("Camera1.bf: 40.0", "Stereo.b: 0.1\nRGBD.DepthMapFactor: 5000.0")
    file.write_text(text)
    lines, (_, depth) = camera_yaml(file, 0, None)
    assert "bf: 53.54," in lines and depth == "RGBD.DepthMapFactor 5000 is 'depth_unit_m: 0.0002'"
    placed = "Stereo.T_c1_c2: [1, 0, 0, 0.2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
    file.write_text(text + placed)
    assert "0.1 m, and 0.2 m in Stereo.T_c1_c2" in "".join(camera_yaml(file, 0, None)[1])
    file.write_text(text.replace("Stereo.b: 0.1", "") + placed)
    assert "bf: 107.08," in camera_yaml(file, 0, None)[0]
    file.write_text(f"{text}Camera.newWidth: 320\n")
    assert "ORB-SLAM makes pictures smaller" in camera_yaml(file, 0, None)[1][-1]
    file.write_text(f"{text}Camera.type: Omni\n")
    with pytest.raises(SlambedError, match=r"Camera\.type 'Omni' is not supported; known: PinHole"):
        camera_yaml(file, 0, None)
    file.write_text(f"{text}Camera.type: Rectified\n")
    with pytest.raises(SlambedError, match=r"not one of a Rectified camera; is .* PinHole\?"):
        camera_yaml(file, 0, None)
    file.write_text(text.replace("Camera1.fx", "Camera1.f"))
    with pytest.raises(SlambedError, match=r"key 'Camera1\.fx' is missing, which a settings file"):
        camera_yaml(file, 0, None)
    file.write_text(text.replace("5000.0", "0"))
    with pytest.raises(
        SlambedError, match=r"not a settings file of ORB-SLAM: RGBD\.DepthMapFactor is 0"
    ):
        camera_yaml(file, 0, None)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("equidistant", "fov", "cam0: distortion model 'fov' is not supported"),
        ("camera_model: pinhole", "camera_model: ds", "cam0: camera model 'ds' is not supported"),
        ("resolution", "size", "key 'resolution' is missing, which a Kalibr camchain has"),
        ("[190.5,", "[x,", "not a Kalibr camchain: could not convert"),
        ("cam0", "camera0", "this is no calibration"),
        ("cam0:", "cam0: [", "other.yaml:.*: not YAML"),
        ("cam1:", "  resolution: [1, 1]\ncam1:", "other.yaml:7: .* 'resolution' is given twice"),
        ("intrinsics: [190.5,", "intrinsics: [", "its intrinsics are 3 values, expected 4 numbers"),
        (
            "distortion_coeffs: [",
            "distortion_coeffs: 1 #",
            "its coefficients are 1, expected a list",
        ),
        ("cam1:", "cam1: 3\nother:", "its cam1 is 3, expected a mapping of keys"),
        ("cam1:", "---\ncam1:", "a second document begins with '---', expected one"),
        ("190.8", "19080", r"other\.yaml: fx: is 190\.5, but fy 19080 .real ones are about equal."),
        (
            "[0.01, 0.02",
            "[0.01, -2e4",
            "other.yaml: distortion: no lens has a coefficient of -20000",
        ),
        ("254.9", "25490", "cx 25490 is far outside of a picture of 512x500; calibrate again"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    with pytest.raises(SlambedError, match=complaint) as error:
        imported(tmp_path, KALIBR.replace(old, new))
    one_line(error)


def test_the_command_prints_lines_for_a_dataset_file(tmp_path: Path) -> None:
    (tmp_path / "chain.yaml").write_text(KALIBR)
    code, out, err = slambed("data", "import-camera", "chain.yaml", cwd=tmp_path)
    assert code == 0 and read_yaml(out)["camera"]["distortion_model"] == "equidistant"
    assert "chain.yaml is a Kalibr camchain" in err
