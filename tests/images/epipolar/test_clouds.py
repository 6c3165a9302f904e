import json
from pathlib import Path

import numpy as np
import pytest

from obseq.geometry import RigidMotion, exponential
from obseq.images import Camera
from obseq.images.aerial import Rpc
from obseq.images.epipolar import (
    OrientedCamera,
    Pinhole,
    RationalSensor,
    epipolar_residuals,
    fit_cloud,
    fit_field,
    percentile_text,
    reduced,
    residual_cloud,
    residual_page,
)

FILE = Path(__file__).resolve().parents[4] / "shared" / "data" / "epipolar" / "expected.json"
CASES = json.loads(FILE.read_text())["cases"] if FILE.is_file() else []
RNG = np.random.default_rng(4)


def vertices(cloud):
    header, _, body = cloud.partition(b"end_header\n")
    count = int(header.split(b"element vertex ")[1].split()[0])
    data = np.frombuffer(body, np.dtype([("place", "<f4", 3), ("colour", "u1", 3)]))
    assert len(data) == count
    return data


@pytest.mark.parametrize(
    "case", [c for c in CASES if c["kind"] == "visuredhom_ply"], ids=lambda case: case["id"]
)
def test_clouds_have_the_vertices_of_the_original(case):
    inputs, expected = case["inputs"], case["expected"]
    count = inputs["n_tie_points"]
    pixels, values = RNG.uniform(0, 50, (count, 2)), RNG.normal(0, 1, count)
    cloud = vertices(residual_cloud(pixels, values, tuple(inputs["image_size"])))
    assert len(cloud) == expected["cloud_vertices"]
    assert len(cloud) - count * expected["sphere_vertices_per_tie_point"] == expected["plane_vertices"]
    fits = fit_field(pixels, values)
    assert len(fits) == len(expected["fit_files"])
    assert len(vertices(fit_cloud(pixels, fits[0]))) == expected["fit_cloud_vertices"]


def test_a_cloud_by_hand():
    cloud = vertices(residual_cloud(np.array([[12.0, 34.0]]), np.array([0.02]), (101, 57)))
    assert cloud["place"][:7].tolist() == [[0, 10 * k, 0] for k in range(6)] + [[10, 0, 0]]
    ball = cloud[66:]
    np.testing.assert_allclose(ball["place"].mean(axis=0), [12.0, 34.0, 20.0], rtol=1e-5)
    assert (ball["colour"] == [255, 0, 0]).all()


def test_the_text_has_a_block_for_each_fit_but_the_last():
    pixels, values = RNG.uniform(0, 4000, (200, 2)), RNG.normal(0, 1, 200)
    text = percentile_text(values, pixels, fit_field(pixels, values))
    assert text.startswith("Nb Pts=200\n")
    assert [line.strip() for line in text.splitlines() if "Degree" in line or "Initial" in line] == [
        "Initial",
        *(f"Degree={degree}" for degree in range(5)),
    ]
    assert text.count("Res[") == 6 * 21
    assert f"Res[100.000000]={np.abs(values).max():f}\n" in text


def test_a_page_draws_each_point_twice_and_asks_for_nothing():
    pixels, values = RNG.uniform(0, 100, (30, 2)), RNG.normal(0, 1, 30)
    page = residual_page("a <b>", pixels, values, (100, 100), fit_field(pixels, values, 1)[-1])
    assert page.count("<circle") == 60
    assert "a &lt;b&gt;" in page
    assert "http" not in page


def test_a_camera_with_distortion_agrees_with_a_pinhole_on_what_it_undistorts():
    camera = Camera("c", 6000, 4000, focal=5000.0, distortion={"K1": -0.1, "p1": 1e-4})
    bare = Camera("b", 6000, 4000, focal=5000.0)
    turn = exponential(np.array([0.02, -0.03, 0.1]))
    second = Pinhole(np.array([100.0, 3.0, -2.0]), turn.T, 5000.0, np.array([3000.0, 2000.0]))
    pose = RigidMotion(np.zeros(3), np.eye(3))
    scene = RNG.uniform([-300, -200, 900], [300, 200, 1100], (40, 3))
    exact = OrientedCamera(camera, pose).project(scene)
    p2 = second.project(scene) + RNG.normal(0, 0.5, (40, 2))
    found = epipolar_residuals(OrientedCamera(camera, pose), exact, second, p2)
    plain = epipolar_residuals(OrientedCamera(bare, pose), bare.project(scene), second, p2)
    np.testing.assert_allclose(found.values, plain.values, rtol=0.2, atol=0.02)
    np.testing.assert_allclose(
        epipolar_residuals(OrientedCamera(camera, pose), exact, second, second.project(scene)).values,
        0.0,
        atol=1e-8,
    )


def rational(tilt):
    """A sensor that sees degrees as pixels, with a parallax of `tilt` pixels per metre of height."""
    coefficients = np.zeros((4, 20))
    coefficients[[1, 3], 0] = 1.0
    coefficients[0, 2], coefficients[2, 1], coefficients[2, 3] = -1.0, 1.0, tilt * 500.0 / 5000.0
    offsets = {"LINE": 5000.0, "SAMP": 5000.0, "LAT": 45.0, "LONG": 3.0, "HEIGHT": 500.0}
    scales = {"LINE": 5000.0, "SAMP": 5000.0, "LAT": 0.05, "LONG": 0.07, "HEIGHT": 500.0}
    return RationalSensor(Rpc(offsets, scales, coefficients))


def test_satellites_agree_on_their_scene_and_see_a_shift_across():
    first, second = rational(0.5), rational(-0.5)
    pixels = RNG.uniform(1000, 9000, (30, 2))
    heights = RNG.uniform(100, 900, 30)
    ground = np.column_stack([first.ground(pixels, heights), heights])
    seen = second.rpc.project(ground)
    none = epipolar_residuals(first, pixels, second, seen)
    np.testing.assert_allclose(none.values, 0.0, atol=1e-2)  # its lines of sight are a little curved
    shifted = epipolar_residuals(first, pixels, second, seen + np.array([0.0, 2.0]))
    np.testing.assert_allclose(np.abs(shifted.values), 1.0, atol=0.02)
    assert (np.sign(shifted.values) == np.sign(shifted.directions[:, 0]) * -1.0).all()


def test_a_reduced_image_keeps_its_brightness_and_its_slope():
    image = np.add.outer(np.arange(57.0), 2.0 * np.arange(101.0))
    small = reduced(image)
    assert small.shape == (6, 11)
    np.testing.assert_allclose(reduced(np.full((57, 101), 7.0)), 7.0)
    np.testing.assert_allclose(small[1:-1, 1:-1], image[10:50:10, 10:100:10], atol=1e-9)
    grey = vertices(residual_cloud(np.zeros((0, 2)), np.zeros(0), (101, 57), small))
    assert grey["colour"][7, 0] == int(small[1, 1])
