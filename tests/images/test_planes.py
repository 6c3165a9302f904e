"""Resection on a plane: poses and focal length from images of a flat target."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.images import Camera, ControlPoints, ImagePoints, Poses, resect_on_plane

CAMERA = Camera("c", 2000, 1500, 1800.0, degree=(0, 0, 0))


def _scene(n_images: int = 4, noise: float = 0.2, height: float = 4.0, origin=(6e5, 6.8e6, 200.0)):
    """A board of 25 points, tilted in the world, from a ring above it."""
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-0.8, 0.8, 5))
    board = np.column_stack([x.ravel(), y.ravel(), np.zeros(25)])
    angle = np.linspace(0.3, 5.0, n_images)
    centres = np.column_stack([2 * np.cos(angle), 2 * np.sin(angle), np.full(n_images, height)])
    rotations = scenes.looking_at(centres, np.zeros(3))
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    images = [f"i{k}" for k in range(n_images)]
    poses = Poses.of(images, centres @ turn.T + origin, turn @ rotations, cameras="c")
    points = board @ turn.T + origin
    names = [f"P{k}" for k in range(25)]
    return poses, ControlPoints.of(names, points), scenes.measured(poses, points, names, noise, camera=CAMERA)


def test_without_noise_all_is_exact():
    poses, control, measures = _scene(noise=0.0)
    found = resect_on_plane(measures, control, (2000, 1500))
    assert found.camera.focal == pytest.approx(1800.0, abs=1e-4)
    np.testing.assert_allclose(found.poses.centres, poses.centres, atol=1e-6)
    np.testing.assert_allclose(found.poses.rotations, poses.rotations, atol=1e-7)
    assert found.rms.max() < 1e-6


def test_with_noise_the_focal_length_is_near():
    poses, control, measures = _scene()
    found = resect_on_plane(measures, control, (2000, 1500), name="wide")
    assert found.camera.name == "wide"
    assert found.camera.focal == pytest.approx(1800.0, rel=0.005)
    np.testing.assert_allclose(found.poses.centres, poses.centres, atol=0.03)
    assert 0.1 < found.rms.max() < 0.5


def test_one_oblique_image_of_four_points_is_enough():
    poses, control, measures = _scene(1, noise=0.0)
    corners = ["P0", "P4", "P20", "P24"]
    found = resect_on_plane(measures.of_points(corners), control.select(corners), (2000, 1500))
    np.testing.assert_allclose(found.poses.centres, poses.centres, atol=1e-5)


def test_the_sheet_of_dbat_gives_its_focal_length_from_four_points(shared_data):
    folder = shared_data / "dbat-camcal"
    rows = [line.split(",") for line in (folder / "measurements/markpts.txt").read_text().splitlines()[2:]]
    given = [line.split(",") for line in (folder / "reference/camcal-fixed.txt").read_text().splitlines()[3:]]
    control = ControlPoints.of([row[0] for row in given], [[float(v) for v in row[2:5]] for row in given])
    names = [row[0].strip() for row in rows], [row[1].strip() for row in rows]
    measures = ImagePoints.of(*names, [[float(v) for v in row[2:4]] for row in rows])
    found = resect_on_plane(measures.of_points(control.names), control, (2272, 1704))
    assert found.camera.focal == pytest.approx(2336.8, rel=0.05)  # distortion left out


def test_what_a_plane_cannot_give():
    _, control, measures = _scene()
    with pytest.raises(InputError, match="image i0: 3 control points; a resection on a plane takes 4"):
        resect_on_plane(measures.rows(~((measures.image == 0) & (measures.point > 2))), control, (2000, 1500))
    line = [f"P{k}" for k in range(5)]
    with pytest.raises(InputError, match="image i0: its 5 control points are on a line"):
        resect_on_plane(measures.of_points(line), control, (2000, 1500))
    raised = control.coordinates + np.random.default_rng(0).normal(0.0, 0.3, (25, 3))
    with pytest.raises(InputError, match="image i0: its control points are not in a plane"):
        resect_on_plane(measures, ControlPoints.of(control.names, raised), (2000, 1500))


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_images_that_look_straight_on_say_nothing_of_the_focal_length(noise):
    _, control, _ = _scene(1)
    middle = control.coordinates.mean(axis=0)
    normal = np.linalg.svd(control.coordinates - middle)[2][2]
    rotation = scenes.looking_at((middle + 4 * normal)[None], middle)
    straight = Poses.of(["s"], [middle + 4 * normal], rotation, cameras="c")
    measures = scenes.measured(straight, control.coordinates, control.names, noise, camera=CAMERA)
    with pytest.raises(InputError, match="look straight at the plane"):
        resect_on_plane(measures, control, (2000, 1500))
