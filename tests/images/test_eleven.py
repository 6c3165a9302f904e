"""Resection without calibration: exact on points without noise, right with noise, refused on planes."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.images import Camera, ControlPoints, ImagePoints, resect_uncalibrated

LINEAR = Camera("c", 2000, 1500, 1800.0, [980.0, 760.0], (0, 0, 1), {"b1": 0.01, "b2": -0.005})


def _scene(camera: Camera, noise: float, **shape):
    poses, points = scenes.ring(**shape)
    names = [f"P{k}" for k in range(len(points))]
    return poses, ControlPoints.of(names, points), scenes.measured(poses, points, names, noise, camera=camera)


def test_the_linear_map_is_exact():
    poses, control, measures = _scene(LINEAR, 0.0)
    found = resect_uncalibrated(measures, control, (2000, 1500))
    for image in poses.images:
        np.testing.assert_allclose(found.cameras[image].parameters, LINEAR.parameters, rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(found.poses[image].centre, poses[image].centre, atol=1e-8)
        np.testing.assert_allclose(found.poses[image].rotation, poses[image].rotation, atol=1e-9)


def test_national_coordinates_and_distortion():
    poses, control, measures = _scene(scenes.CAMERA, 0.0, n_points=60, origin=(6e5, 6.8e6, 300.0))
    found = resect_uncalibrated(measures, control, (2000, 1500), (3, 1, 1))
    for image in poses.images:
        np.testing.assert_allclose(
            found.cameras[image].parameters[:3], scenes.CAMERA.parameters[:3], atol=1e-3
        )
        np.testing.assert_allclose(found.poses[image].centre, poses[image].centre, atol=1e-5)
    assert found.rms.max() < 1e-6


def test_medians_of_noisy_images_are_near_the_truth():
    poses, control, measures = _scene(LINEAR, 0.2, n_points=60)
    found = resect_uncalibrated(measures, control, (2000, 1500))
    (shared,) = found.medians({"all": poses.images}).values()
    assert shared.focal == pytest.approx(1800.0, abs=3.0)


def test_frozen_parameters_stay():
    _, control, measures = _scene(LINEAR, 0.2, n_points=60)
    free = resect_uncalibrated(measures, control, (2000, 1500), (3, 1, 1), frozen="K.|p.")
    assert all((camera.coefficients[:5] == 0.0).all() for camera in free.cameras.values())


def test_the_principal_point_is_held_where_it_is_said_to_be():
    poses, control, measures = _scene(LINEAR, 0.0)
    held = resect_uncalibrated(measures, control, (2000, 1500), principal_point=(0.49, 760 / 1500))
    for image in poses.images:
        assert held.cameras[image].principal_point.tolist() == pytest.approx([980.0, 760.0], rel=1e-14)
        assert held.cameras[image].focal == pytest.approx(1800.0, abs=1e-5)
    middle = resect_uncalibrated(measures, control, (2000, 1500), frozen="b.", principal_point=(0.5, 0.5))
    for camera in middle.cameras.values():
        assert camera.principal_point.tolist() == [1000.0, 750.0]
        assert camera.focal != pytest.approx(1800.0, abs=1e-3)


def _squeezed(factor: float, noise: float):
    poses, points = scenes.ring()
    low = points.mean(axis=0) + (points - points.mean(axis=0)) * [1.0, 1.0, factor]
    names = [f"P{k}" for k in range(len(low))]
    measures = scenes.measured(poses, low, names, noise, camera=LINEAR)
    return resect_uncalibrated(measures, ControlPoints.of(names, low), (2000, 1500))


def test_points_nearly_in_a_plane_are_said_to_be():
    assert not _squeezed(1.0, 0.5).nearly_flat
    weak = _squeezed(0.03, 0.5)
    assert weak.nearly_flat == weak.poses.images
    assert max(abs(camera.focal - 1800.0) for camera in weak.cameras.values()) > 20.0
    with pytest.raises(InputError, match=r"image i0: its 30 control points are in a plane"):
        _squeezed(0.01, 0.5)


def test_planes_and_few_points_are_refused():
    _, control, measures = _scene(LINEAR, 0.0)
    flat = ControlPoints.of(control.names, control.coordinates * [1.0, 1.0, 0.0])
    with pytest.raises(InputError, match=r"image i0: its .* control points are in a plane"):
        resect_uncalibrated(measures, flat, (2000, 1500))
    with pytest.raises(InputError, match="image i0: 5 control points; eleven parameters take 6"):
        resect_uncalibrated(measures, control.select(control.names[:5]), (2000, 1500))
    empty = ImagePoints.of(["i9"], ["Q"], [[1.0, 1.0]])
    with pytest.raises(InputError, match="image i9: 0 control points"):
        resect_uncalibrated(empty, control, (2000, 1500))
