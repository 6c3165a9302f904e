"""Free blocks of many kinds, self-calibrated, from rough poses: they end on their datum, and soon."""

from dataclasses import replace

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.geometry import exponential
from obseq.images import BundleAdjustment, Camera, Poses, similarity


def _strips(n_strips: int, n_images: int, n_points: int, relief: float):
    """Vertical images in strips flown there and back, 150 m above points of some relief."""
    rng = np.random.default_rng(0)
    strip, k = np.divmod(np.arange(n_strips * n_images), n_images)
    there = np.where(strip % 2, n_images - 1 - k, k)
    centres = np.column_stack([60.0 * there, 120.0 * strip, np.full(len(k), 150.0)])
    centres += rng.normal(0.0, 2.0, centres.shape)
    heading = np.where(strip % 2, -1.0, 1.0)
    axes = np.stack([np.diag([sign, -sign, -1.0]) for sign in heading])
    rotations = axes @ exponential(rng.normal(0.0, 0.03, (len(k), 3)))
    high = [60.0 * n_images, 120.0 * n_strips, relief]
    points = rng.uniform([-60.0, -60.0, 0.0], high, (n_points, 3))
    return Poses.of(
        [f"{s}_{n}" for s, n in zip(strip, k, strict=True)], centres, rotations, cameras="c"
    ), points


def _free(poses, points, shift, turn, freeze, noise=0.5):
    """A block of rough poses, with a camera that is 2 % off."""
    block = BundleAdjustment()
    start = scenes.CAMERA.parameters * [1.02, 1, 1, 0, 0, 0, 0, 0, 0, 0]
    block.add_cameras(scenes.CAMERA.with_parameters(start))
    if freeze:
        block.freeze_parameters(freeze)
    block.add_poses(scenes.moved(poses, shift, turn))
    names = [f"P{k}" for k in range(len(points))]
    block.add_measures(scenes.measured(poses, points, names, noise))
    return block


def _largest_error(solution, poses) -> float:
    """Of the centres, after the similarity that brings them to the truth."""
    scale, motion = similarity(solution.poses.centres, poses.centres)
    moved = motion.centre + scale * solution.poses.centres @ motion.rotation.T
    return float(np.abs(moved - poses.centres).max())


def _is_on_its_datum(values, start) -> None:
    """The changes have no part along translation, rotation and scale."""
    change, arms = values - start, values - values.mean(axis=0)
    size = np.linalg.norm(arms) * max(np.linalg.norm(change), 1e-9)
    assert np.linalg.norm(change.sum(axis=0)) < 1e-6 * size
    assert np.linalg.norm(np.cross(arms, change).sum(axis=0)) < 1e-6 * size
    assert abs(np.sum(arms * change)) < 1e-6 * size


@pytest.mark.parametrize("freeze", ["b.|p.|K3", ""])
@pytest.mark.parametrize("relief", [15.0, 1.0])
def test_a_self_calibrated_aerial_block_without_control(freeze, relief):
    """Vertical images of nearly flat ground hardly tell the focal length from the height."""
    poses, points = _strips(3, 6, 900, relief)
    solution = _free(poses, points, 5.0, 0.03, freeze).solve(datum="centres")
    assert solution.converged
    assert len(solution.iterations) < 32
    assert 0.95 < solution.sigma0 < 1.05
    assert solution.result.redundancy == solution.result.n_observations - solution.result.n_unknowns + 7
    error = abs(solution.cameras["c"].focal - scenes.CAMERA.focal)
    assert error < 4.0 * solution.camera_precisions("c")["F"]
    _is_on_its_datum(solution.poses.centres, solution.start.poses.centres)


def test_a_single_strip_is_turned_back_about_its_own_line():
    poses, points = _strips(1, 10, 700, 15.0)
    solution = _free(poses, points, 5.0, 0.03, "b.|p.|K.|PP.").solve(datum="centres")
    assert solution.converged
    assert len(solution.iterations) < 32
    _is_on_its_datum(solution.poses.centres, solution.start.poses.centres)


@pytest.mark.parametrize("shift", [0.05, 1.0])
@pytest.mark.parametrize("datum", ["centres", "points", ["P0", "P1", "P2", "P3"]])
def test_a_ring_from_near_and_far_on_any_datum(datum, shift):
    poses, points = scenes.ring(10, 60)
    solution = _free(poses, points, shift, 0.1 * shift, "b.|p.|K3").solve(datum=datum)
    assert solution.converged
    assert _largest_error(solution, poses) < 0.03
    names = solution.points if datum == "points" else datum
    if datum == "centres":
        _is_on_its_datum(solution.poses.centres, solution.start.poses.centres)
    else:
        rows = [solution.points.index(name) for name in names]
        _is_on_its_datum(solution.coordinates[rows], solution.start.coordinates[rows])


def test_scale_bars_of_an_industrial_block():
    poses, points = scenes.ring(16, 80)
    block = _free(poses, points, 0.5, 0.05, "", noise=0.05)
    for k in range(0, 10, 2):
        length = float(np.linalg.norm(points[k] - points[k + 1]))
        block.add_length(f"P{k}", f"P{k + 1}", length, 2e-5)
    solution = block.solve(datum="points")
    assert solution.converged
    assert solution.result.redundancy == solution.result.n_observations - solution.result.n_unknowns + 6
    _, motion = similarity(solution.coordinates, _true(solution, points), with_scale=False)
    moved = motion.centre + solution.coordinates @ motion.rotation.T
    assert np.abs(moved - _true(solution, points)).max() < 1e-3


def _true(solution, points):
    return points[[int(name[1:]) for name in solution.points]]


def test_a_datum_of_points_on_a_line_is_refused():
    poses, points = scenes.ring(8, 30)
    points[:3] = np.linspace([0.0, 0, 0], [1.0, 1, 1], 3)
    block = _free(poses, points, 0.05, 0.005, "b.|p.|K3")
    with pytest.raises(InputError, match=r"datum.*choose"):
        block.solve(datum=["P0", "P1"])


def test_a_datum_on_fewer_than_three_points_says_which_to_take():
    poses, points = scenes.ring(8, 30)
    block = _free(poses, points[:2], 0.01, 0.001, ".*")
    with pytest.raises(InputError, match=r"datum on points fixes no position.*there are 2.*--datum centres"):
        block.solve(datum="points")


def test_a_free_block_whose_focal_length_is_off_comes_home_on_its_datum():
    """Rounding hides in its normal matrix that its scale is free."""
    places = [(1, 1, 5), (4, 1, 5.5), (1, 3, 6), (4, 3, 5), (2.5, 2, 7), (2.5, 0, 5), (0, 2, 5), (5, 2, 5)]
    turns = [
        (6, -12, 0),
        (6, 12, 90),
        (-8, -10, 180),
        (-8, 10, 270),
        (0, 0, 0),
        (18, 0, 0),
        (0, -20, 90),
        (0, 20, 0),
    ]
    poses = Poses.of([f"I{k}" for k in range(8)], places, np.radians(turns), "opk", "c")
    points = np.array([(x, y, 0.6 * (x * y % 3)) for x in range(6) for y in range(5)])
    camera = Camera("c", 4000, 3000, 3000.0, degree=(2, 0, 0), distortion={"K1": -0.05, "K2": 0.01})
    measures = scenes.measured(poses, points, [f"P{k}" for k in range(30)], 0.3, camera=camera)
    for focal in (2960.0, 3000.0):
        block = BundleAdjustment()
        block.add_cameras(replace(camera, focal=focal, distortion={}))
        block.add_poses(replace(poses, centres=poses.centres + 0.02))
        block.add_measures(measures)
        solution = block.solve(datum="centres")
        assert solution.sigma0 == pytest.approx(1.0, abs=0.1)
        assert solution.cameras["c"].focal == pytest.approx(3000.0, abs=6.0)
