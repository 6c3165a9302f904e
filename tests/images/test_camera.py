"""Cameras: projection by hand and against MMVII, inverse, visibility, medians."""

import json

import numpy as np
import panel
import pytest

from obseq.errors import InputError
from obseq.images import Camera, median_camera


def test_a_projection_by_hand():
    # q = (0.1, 0.2), s = 0.05, K1 = 0.4: factor 1.02; p1 = 0.01 adds (3 x2 + y2, 2 x y) p1 = (0.0007, 0.0004)
    camera = Camera("c", 2000, 1000, 1000.0, degree=(3, 1, 0), distortion={"K1": 0.4, "p1": 0.01})
    assert camera.parameter_names == ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2")
    np.testing.assert_allclose(camera.project([[0.2, 0.4, 2.0]]), [[1000 + 102.7, 500 + 204.4]], rtol=1e-14)


@pytest.mark.parametrize(
    "projection", ["Stenope", "FE_EquiDist", "FE_EquiSolid", "StereroGraphik", "OrthoGraphik", "EquiRect"]
)
def test_pixels_and_directions_are_inverse(projection):
    camera = Camera(
        "c",
        800,
        600,
        700.0,
        [410.0, 290.0],
        (3, 1, 1),
        {"K1": -0.1, "K2": 0.02, "p1": 1e-3, "b2": -2e-3},
        projection,
    )
    pixels = np.random.default_rng(0).uniform([0, 0], [800, 600], (200, 2))
    rays = camera.directions(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(camera.project(3.0 * rays), pixels, atol=1e-9)


def test_projection_and_inverse_are_those_of_mmvii(shared_data):
    expected = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())
    cameras, poses = panel.cameras(shared_data, "BA"), panel.poses(shared_data, "BA")
    control = panel.control_points(shared_data)
    for check in expected["projection_checks_BA"]:
        camera = cameras[poses.select([check["image"]]).cameras[0]]
        point = poses[check["image"]].to_local(control.select([check["point"]]).coordinates)
        np.testing.assert_allclose(camera.project(point), [check["projected"]], atol=1e-9)
    camera = next(camera for name, camera in cameras.items() if "043" in name)
    for check in expected["inverse_checks_BA_043"]:
        found = camera.undistorted((np.array([check["pixel"]]) - camera.principal_point) / camera.focal)
        np.testing.assert_allclose(found, [check["q"]], atol=1e-12)


def test_where_the_distortion_folds_there_is_no_direction():
    # r (1 - r^2) is largest, 0.385, at r = 0.577: nothing goes to 0.5
    camera = Camera("c", 2000, 2000, 1000.0, degree=(2, 0, 0), distortion=[-1.0, 0.0])
    rays = camera.directions([[1300.0, 1000.0], [1500.0, 1000.0]])
    assert np.isfinite(rays[0]).all()
    assert np.isnan(rays[1]).all()


def test_what_a_camera_sees():
    camera = Camera("c", 2000, 2000, 1000.0, degree=(2, 0, 0), distortion=[-1.0, 0.0])
    points = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [5.0, 0.0, 1.0], [0.9, 0.0, 1.0]]
    # before, behind, outside, folded: 0.9 (1 - 0.81) = 0.171 comes back as 0.177, not 0.9
    assert camera.sees(points).tolist() == [True, False, False, False]


def test_medians_are_the_shared_calibrations_of_mmvii(shared_data):
    for name, shared in panel.cameras(shared_data, "Calib").items():
        several = panel.cameras(shared_data, "11P", f"-PerspCentral-{'043' if '043' in name else '671'}*")
        found = median_camera(list(several.values()), name)
        np.testing.assert_allclose(found.parameters, shared.parameters, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"focal": 0.0}, "focal length must be above zero"),
        ({"distortion": {"K4": 1.0}}, r"K4 not in the distortion Dist_Rad3_Dec1_XY1.*K1, K2, K3, p1"),
        ({"distortion": [1.0]}, "takes 7 finite coefficients"),
        ({"width": 0}, "no pixels"),
    ],
)
def test_impossible_cameras_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        Camera(**({"name": "c", "width": 2000, "height": 1000, "focal": 900.0} | changes))


def test_a_focal_length_in_millimetres_is_recognised():
    camera = Camera("wide", 6000, 4000, 24.0)
    with pytest.raises(InputError, match=r"camera wide: a focal length of 24 pixels.*millimetres"):
        camera.require_plausible()


def test_the_median_of_different_models_is_refused():
    with pytest.raises(InputError, match="b is not of the model and size of a"):
        median_camera([Camera("a", 10, 10, 9.0), Camera("b", 10, 10, 9.0, degree=(0, 0, 0))], "m")
