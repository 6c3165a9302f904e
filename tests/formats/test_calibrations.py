"""Calibrations as YAML, of OpenCV, ROS and kalibr, against the projection that they describe."""

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.calibrations.reader import read_calibrations

pytest.importorskip("yaml", reason="PyYAML is an extra: pip install obseq[yaml]")

OPENCV = """%YAML:1.0
---
calibration_time: "Thu 01 Jan 2026 10:00:00 AM UTC"
image_width: 1280
image_height: 960
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1.1e+03, 0., 6.41e+02, 0., 1.1e+03,
       4.75e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -2.0e-01, 6.0e-02, 1.0e-03, -2.0e-03, 1.0e-02 ]
avg_reprojection_error: 3.2e-01
"""
ROS = """image_width: 1280
image_height: 960
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [1100, 0, 641, 0, 1095, 475, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.06, 0.001, -0.002, 0]
"""
KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.06, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [1100.0, 1100.0, 641.0, 475.0]
  resolution: [1280, 960]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0.02, -0.003, 0.001, -0.0002]
  distortion_model: equidistant
  intrinsics: [800.0, 800.0, 641.0, 475.0]
  resolution: [1280, 960]
"""
MESSAGE = """height: 960
width: 1280
distortion_model: plumb_bob
d: [-0.2, 0.06, 0.001, -0.002, 0]
k: [1100, 0, 641, 0, 1095, 475, 0, 0, 1]
"""
SENSOR = """sensor_type: camera
resolution: [1280, 960]
intrinsics: [1100, 1095, 641, 475]
distortion_model: radial-tangential
distortion_coefficients: [-0.2, 0.06, 0.001, -0.002]
"""
SPACE = np.array([[0.1, 0.2, 1.0], [-0.3, 0.25, 1.0], [0.4, -0.3, 1.2], [0.0, 0.0, 2.0]])


def brown(fx, fy, terms):
    """Pixels of OpenCV's documentation, whose first pixel has its middle at (0, 0)."""
    k1, k2, p1, p2, k3 = terms
    x, y = SPACE[:, 0] / SPACE[:, 2], SPACE[:, 1] / SPACE[:, 2]
    r = x * x + y * y
    radial = 1 + k1 * r + k2 * r**2 + k3 * r**3
    u = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)
    v = y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y
    return np.column_stack([fx * u + 641.0, fy * v + 475.0])


def fish_eye(f, terms):
    flat = np.linalg.norm(SPACE[:, :2], axis=1)
    angle = np.arctan2(flat, SPACE[:, 2])
    bent = angle * (1 + sum(k * angle ** (2 * i + 2) for i, k in enumerate(terms)))
    share = np.divide(bent, flat, out=np.zeros_like(flat), where=flat > 0)
    return f * SPACE[:, :2] * share[:, None] + [641.0, 475.0]


@pytest.mark.parametrize(
    ("text", "pixels"),
    [
        (OPENCV, [brown(1100, 1100, (-0.2, 0.06, 0.001, -0.002, 0.01))]),
        (ROS, [brown(1100, 1095, (-0.2, 0.06, 0.001, -0.002, 0.0))]),
        (MESSAGE, [brown(1100, 1095, (-0.2, 0.06, 0.001, -0.002, 0.0))]),
        (SENSOR, [brown(1100, 1095, (-0.2, 0.06, 0.001, -0.002, 0.0))]),
        (
            KALIBR,
            [
                brown(1100, 1100, (-0.2, 0.06, 0.001, -0.002, 0.0)),
                fish_eye(800, (0.02, -0.003, 0.001, -0.0002)),
            ],
        ),
    ],
    ids=["opencv", "ros", "message", "sensor", "kalibr"],
)
def test_a_calibration_projects_as_its_program_does(tmp_path, text, pixels):
    (tmp_path / "lens.yaml").write_text(text)
    cameras = read_calibrations(tmp_path / "lens.yaml")
    assert [camera.name for camera in cameras] in (["lens"], ["front"], ["cam0", "cam1"])
    for camera, wanted in zip(cameras, pixels, strict=True):
        assert (camera.width, camera.height) == (1280, 960)
        np.testing.assert_allclose(camera.project(SPACE), wanted + 0.5, rtol=0, atol=0.011)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("image_width: 1280\n", ""), "the size of the image"),
        (("1100, 0, 641", "1100, 2, 641"), "a skew"),
        (("0.001, -0.002, 0]", "x, -0.002, 0]"), "no list of numbers"),
        (("plumb_bob", "odd"), "'odd' is no distortion"),
        (("camera_matrix:", "matrix:"), "no calibration of OpenCV or ROS"),
        (("  cols: 3\n", "  cols: [\n"), r"lens.yaml:\d+: no YAML"),
    ],
)
def test_a_wrong_calibration_is_told_with_its_file(tmp_path, change, message):
    (tmp_path / "lens.yaml").write_text(ROS.replace(*change, 1))
    with pytest.raises(InputError, match=r"lens\.yaml") as caught:
        read_calibrations(tmp_path / "lens.yaml")
    assert caught.match(message)


def test_the_command_line_takes_a_calibration(tmp_path, monkeypatch, capsys):
    """Three images of twelve points, whose measures are those of the calibrated camera."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lens.yml").write_text(ROS)
    (camera,) = read_calibrations(tmp_path / "lens.yml")
    ground = np.random.default_rng(1).uniform([-1, -1, 3], [1, 1, 5], (12, 3))
    images, marks = ["image,camera,x,y,z,omega,phi,kappa"], ["image,point,x,y"]
    for k, place in enumerate(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.1], [0.2, 0.4, 0.0]])):
        images.append(f"i{k},front,{','.join(map(str, place))},180,0,0")
        turned = (ground - place) * [1.0, 1.0, 1.0]
        marks += [f"i{k},p{n},{x},{y}" for n, (x, y) in enumerate(camera.project(turned).tolist())]
    control = ["point,x,y,z,sigma", *(f"p{n},{x},{y},{z},0.001" for n, (x, y, z) in enumerate(ground[:6]))]
    for name, rows in (("im", images), ("mes", marks), ("ctl", control)):
        (tmp_path / f"{name}.csv").write_text("\n".join([*rows, ""]))
    command = (
        "bundle --cameras lens.yml --images im.csv --measures mes.csv --control ctl.csv --image-sigma 0.1"
    )
    assert main([*command.split(), "--freeze", ".*"]) == 0, capsys.readouterr()
