"""Two blocks of DBAT: a camera calibrated with its distortion on the measures, and an aerial block."""

import json

import numpy as np
import pytest

from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses

PIXEL = 77.976 / 12996
"""Millimetres."""
OLYMPUS_PIXEL = 5.43764 / 1704
"""Millimetres: the height of a pixel, DBAT's unit."""
HALF_DIGIT = 0.52
"""Of the last digit that DBAT prints."""


def _rows(path):
    lines = [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    return [[field.strip() for field in line.split(",")] for line in lines]


def test_the_block_of_strasbourg_is_that_of_dbat(shared_data):
    folder = shared_data / "dbat-sxb"
    expected = json.loads((folder / "expected.json").read_text())["dbat"]
    block = BundleAdjustment()
    principal_point = np.array([26.577, 38.811]) / PIXEL
    block.add_cameras(Camera("c", 8858, 12996, 123.9392 / PIXEL, principal_point, (0, 0, 0)))
    block.freeze_parameters()
    photos = expected["photos"]
    values = [[photo[key]["value"] for key in ("Xc", "Yc", "Zc")] for photo in photos.values()]
    angles = [[photo[key]["value"] for key in ("Omega", "Phi", "Kappa")] for photo in photos.values()]
    block.add_poses(Poses.of(list(photos), values, np.radians(angles), "opk"))
    control = [row for row in _rows(folder / "reference/sxb-control.txt") if row[0] not in ("351", "410")]
    numbers = np.array([row[2:] for row in control], dtype=float)
    block.add_control_points(ControlPoints.of([row[0] for row in control], numbers[:, :3], numbers[:, 3:]))
    for name, sigma in (("markpts", 0.5), ("smartpts", 1.0)):
        rows = _rows(folder / f"measurements/{name}.txt")
        xy = np.array([row[2:4] for row in rows], dtype=float)
        block.add_measures(
            ImagePoints.of([row[1] for row in rows], [row[0] for row in rows], xy, sigma), name=name
        )
    solution = block.solve()
    assert solution.result.redundancy == expected["redundancy"]
    assert solution.sigma0 == pytest.approx(expected["sigma0"], abs=5e-5)
    assert np.sqrt(solution.result.cost) == pytest.approx(expected["last_error"], abs=5e-5)
    _poses_agree(solution, photos)


@pytest.fixture(scope="module")
def camera_calibration(shared_data):
    """The Olympus from its measures and four held points alone, and what DBAT printed."""
    folder = shared_data / "dbat-camcal"
    marks, control = (
        _rows(folder / "measurements/markpts.txt"),
        _rows(folder / "reference/camcal-fixed.txt"),
    )
    block = BundleAdjustment()
    block.add_cameras(Camera("c", 2272, 1704, 7.5 / OLYMPUS_PIXEL, degree=(3, 1, 1), backward=True))
    block.freeze_parameters("b2")
    block.add_images(list(dict.fromkeys(row[0] for row in marks)), "c")
    xyz = np.array([row[2:] for row in control], dtype=float)
    block.add_control_points(ControlPoints.of([row[0] for row in control], xyz))
    numbers = np.array([row[2:] for row in marks], dtype=float)
    names = [row[0] for row in marks], [row[1] for row in marks]
    block.add_measures(ImagePoints.of(*names, numbers[:, :2], numbers[:, 2]))
    block.initialise()
    return block.solve(), json.loads((folder / "expected.json").read_text())["dbat"]


def test_a_camera_with_backward_distortion_is_calibrated_as_dbat_does(camera_calibration):
    solution, expected = camera_calibration
    assert solution.converged
    assert solution.result.n_observations == 4148
    assert solution.result.n_unknowns == 423
    assert solution.result.redundancy == expected["redundancy"]
    assert solution.sigma0 == pytest.approx(expected["sigma0"], abs=5e-5)
    assert np.sqrt(solution.result.cost) == pytest.approx(expected["last_error"], abs=5e-4)
    _poses_agree(solution, expected["photos"])


def test_its_interior_orientation_in_millimetres_is_that_of_dbat(camera_calibration):
    solution, expected = camera_calibration
    values, jacobian = _millimetres(solution.cameras["c"])
    covariance = jacobian @ solution.camera_covariance("c")[:9, :9] @ jacobian.T
    keys = ("Camera", "px", "py", "K1", "K2", "K3", "P1", "P2", "as")
    given = [next(value for name, value in expected["camera"].items() if name.startswith(k)) for k in keys]
    for value, sigma, printed in zip(values, np.sqrt(np.diagonal(covariance)), given, strict=True):
        assert value == pytest.approx(printed["value"], rel=2e-6)
        assert sigma == pytest.approx(printed["std"], rel=6e-3)


def _millimetres(camera):
    """DBAT's parameters in its units, from those of a camera, and their derivatives (9, 9)."""
    f = camera.focal * OLYMPUS_PIXEL
    powers = np.array([0.0, 0, 0, -2, -4, -6, -1, -1, 0])
    scales = np.array([OLYMPUS_PIXEL] * 3 + [1.0, 1, 1, 1, -1, 1]) * f**powers
    values = scales * camera.parameters[:9]
    jacobian = np.diag(scales)
    jacobian[:, 0] += values * powers / camera.focal
    return values, jacobian


def _poses_agree(solution, photos):
    """Centres and angles with their standard deviations, to the digits that are printed."""
    sigmas = np.sqrt(np.diagonal(solution.centre_covariances, axis1=1, axis2=2))
    turns = np.degrees(solution.attitude_precisions("opk"))
    angles = np.degrees(solution.poses.attitudes("opk"))
    for name, photo in photos.items():
        k = solution.poses.images.index(name)
        for j, key in enumerate(("Xc", "Yc", "Zc")):
            assert abs(solution.poses.centres[k, j] - photo[key]["value"]) < _slack(photo[key])
            assert sigmas[k, j] == pytest.approx(photo[key]["std"], rel=6e-3)
        for j, key in enumerate(("Omega", "Phi", "Kappa")):
            turn = np.remainder(angles[k, j] - photo[key]["value"] + 180.0, 360.0) - 180.0
            assert abs(turn) < _slack(photo[key])
            assert turns[k, j] == pytest.approx(photo[key]["std"], rel=6e-3)


def _slack(printed):
    """What the six printed decimals and the end of DBAT's iterations leave."""
    return HALF_DIGIT * 1e-6 + 5e-4 * printed["std"]
