"""Clinometers on cameras: what they give a block, and what is found of them."""

import json
import re

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.geometry import exponential
from obseq.images import BundleAdjustment, Clinometer, ControlPoints, Poses
from obseq.images.output.page import page
from obseq.images.output.page import text as summary
from obseq.images.output.record import record_of

AXES = {"x": np.array([1.0, 0.02, -0.01]), "y": np.array([0.01, 0.1, 1.0])}
SIGMA = 2e-4


def _block(n_control: int, tilt=(0.0, 0.0, 0.0), noise=SIGMA, offset=0.0):
    """A ring whose camera carries two clinometers; the world is tilted by a rotation vector."""
    ring, points = scenes.ring()
    rolls = exponential(np.outer(np.arange(8) * 0.8, [0.0, 0.0, 1.0]))
    poses = Poses(ring.images, ring.centres, ring.rotations @ rolls, ring.cameras)
    names = [f"P{k}" for k in range(len(points))]
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.freeze_parameters()
    block.add_poses(scenes.moved(poses, 0.05, 0.005))
    block.add_measures(scenes.measured(poses, points, names, 0.5))
    if n_control:
        block.add_control_points(ControlPoints.of(names[:n_control], points[:n_control], 1e-4))
    up = exponential(np.array(tilt)) @ [0.0, 0.0, 1.0]
    rng = np.random.default_rng(8)
    for name, axis in AXES.items():
        sines = poses.rotations @ (axis / np.linalg.norm(axis)) @ up - offset
        readings = np.arcsin(sines) + rng.normal(0.0, noise, len(poses))
        block.add_clinometer(Clinometer(name, axis, free_degrees=(0,) if offset else ()))
        block.add_inclinations(name, poses.images, readings, SIGMA)
    return block, poses, up


def test_clinometers_level_a_block():
    block, poses, _ = _block(6)
    other, _, _ = _block(6)
    other.instruments.inclinations.clear()
    without = other.solve()
    solution = block.solve()
    labels, residuals = solution.clinometer_residuals()
    assert labels[0] == "clinometer x, image i0"
    record = record_of(solution)
    first, second = record.clinometers
    np.testing.assert_array_equal([*first.residuals, *second.residuals], residuals)
    assert (first.name, first.images[0]) == ("x", "i0")
    np.testing.assert_array_equal(first.axis, solution.clinometer("x").axis)
    content = json.loads(re.search(r'id="content">(.*?)</script>', page(record))[1])
    (readings,) = (table["columns"] for table in content["tables"] if table["id"] == "readings")
    (column,) = (column["values"] for column in readings if column["title"] == "residual")
    assert column[-1] == pytest.approx(residuals[-1], rel=1e-4)
    assert "Clinometers" in summary(record)
    assert len(labels) == 16
    assert np.abs(residuals).max() < 4.0 * SIGMA
    assert np.sqrt(np.mean(residuals**2)) > 0.2 * SIGMA
    up = poses.rotations[:, 2]
    angles = np.sum((solution.poses.rotations[:, 2] - up) ** 2, axis=1)
    assert np.sqrt(angles.mean()) < 1e-3
    trace = [np.trace(found.rotation_covariances, axis1=1, axis2=2).mean() for found in (solution, without)]
    assert trace[0] < trace[1]


def test_the_axes_and_the_offset_are_found_again():
    block, _, _ = _block(6, offset=0.002)
    wrong = [
        Clinometer(item.name, item.axis + 0.003, free_degrees=(0,)) for item in block.instruments.clinometers
    ]
    block.instruments.clinometers[:] = wrong
    solution = block.solve()
    for name, axis in AXES.items():
        found = solution.clinometer(name)
        np.testing.assert_allclose(found.axis, axis / np.linalg.norm(axis), atol=2e-3)
        assert found.correction[0] == pytest.approx(0.002, abs=1e-3)
        assert found.correction[1] == 1.0


def test_a_tilted_world_is_seen_when_the_vertical_is_free():
    tilt = (0.01, -0.02, 0.0)
    block, _, up = _block(6, tilt)
    for row, item in enumerate(block.instruments.clinometers):
        block.instruments.clinometers[row] = Clinometer(item.name, item.axis, is_fixed=True)
    assert block.solve().sigma0 > 2.0
    block.set_vertical(is_free=True)
    solution = block.solve()
    assert 0.8 < solution.sigma0 < 1.2
    np.testing.assert_allclose(solution.vertical, up, atol=5e-4)


def test_right_angles_of_axes_count_once():
    block, _, _ = _block(6)
    before = block.solve()
    block.add_right_angle("x", "y", 1e-7)
    after = block.solve()
    assert after.result.redundancy == before.result.redundancy + 1
    product = after.clinometer("x").axis @ after.clinometer("y").axis
    assert abs(product) < 1e-6 < abs(before.clinometer("x").axis @ before.clinometer("y").axis)


def test_two_axes_are_two_of_the_seven_of_a_datum():
    block, _, _ = _block(0)
    for row, item in enumerate(block.instruments.clinometers):
        block.instruments.clinometers[row] = Clinometer(item.name, item.axis, is_fixed=True)
    solution = block.solve(datum="centres")
    defect = solution.result.redundancy - solution.result.n_observations + solution.result.n_unknowns
    assert defect == 5


def test_what_a_clinometer_cannot_be():
    with pytest.raises(InputError, match="clinometer a: its axis is a direction"):
        Clinometer("a", [0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="clinometer a: free degrees are among 0 to 3"):
        Clinometer("a", [1.0, 0.0, 0.0], free_degrees=(4,))
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.add_images(["i"], "c")
    block.add_clinometer(Clinometer("a", [1.0, 0.0, 0.0]))
    with pytest.raises(InputError, match="clinometer 'a' is given twice"):
        block.add_clinometer(Clinometer("a", [1.0, 0.0, 0.0]))
    with pytest.raises(InputError, match="inclinations: clinometer 'b' is not known"):
        block.add_inclinations("b", ["i"], 0.1, 1e-4)
    with pytest.raises(InputError, match=r"clinometer a, image i: an inclination of 114.* radians"):
        block.add_inclinations("a", ["i"], 2.0, 1e-4)
    with pytest.raises(InputError, match="right angle of a and a"):
        block.add_right_angle("a", "a", 1e-4)
