"""An aerial block of DBAT: five images, control points with sigmas, two sets of measures, a fixed camera."""

import json

import numpy as np
import pytest

from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses

PIXEL = 77.976 / 12996
"""Millimetres."""


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
    sigmas = np.sqrt(np.diagonal(solution.centre_covariances, axis1=1, axis2=2))
    turns = np.degrees(solution.attitude_precisions("opk"))
    for k, photo in enumerate(photos.values()):
        for j, key in enumerate(("Xc", "Yc", "Zc")):
            assert solution.poses.centres[k, j] == pytest.approx(photo[key]["value"], abs=2e-4)
            assert sigmas[k, j] == pytest.approx(photo[key]["std"], rel=6e-3)
        for j, key in enumerate(("Omega", "Phi", "Kappa")):
            assert np.degrees(solution.poses.attitudes("opk")[k, j]) == pytest.approx(
                photo[key]["value"], abs=2e-6
            )
            assert turns[k, j] == pytest.approx(photo[key]["std"], rel=6e-3)
