"""Blocks from rough first values: poses off by degrees and a twentieth of the distance, gross errors."""

import numpy as np
import pytest

from obseq.geometry import exponential
from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses, Weighting
from obseq.images.initial import rough

DOWN = np.diag([1.0, -1.0, -1.0])
NOISE = 0.3


class _Strips:
    """Two strips over rolling ground, with true and rough poses."""

    def __init__(self, seed=3, lines=2, images=8, gross=0.0):
        rng = np.random.default_rng(seed)
        self.camera = Camera("c", 10000, 7000, 9000.0, degree=(3, 1, 1), distortion={"K1": -0.02})
        n = 220
        reach = np.array([180.0 * (images - 1), 330.0 * (lines - 1)])
        flat = rng.uniform([-200, -200], reach + 200, (n, 2))
        self.points = np.column_stack([flat, rng.normal(100.0, 20.0, n)])
        self.names = [f"P{k}" for k in range(n)]
        places = [
            (180.0 * k, 330.0 * line + 40.0 * (k % 3), 1200.0 + 20.0 * (k % 2))
            for line in range(lines)
            for k in range(images)
        ]
        turns = exponential(rng.normal(0.0, 0.03, (len(places), 3)))
        half = np.repeat([np.eye(3), exponential([0.0, 0.0, np.pi])], images, axis=0)[: len(places)]
        images_named = [f"i{k}" for k in range(len(places))]
        self.poses = Poses.of(images_named, np.array(places), DOWN @ turns @ half, cameras="c")
        rough = exponential(np.radians(5.0) / np.sqrt(3.0) * rng.normal(size=(len(places), 3)))
        shifts = 0.05 * 1100.0 / np.sqrt(3.0) * rng.normal(size=(len(places), 3))
        self.rough = Poses.of(
            images_named, self.poses.centres + shifts, self.poses.rotations @ rough, cameras="c"
        )
        self.measures = self._measured(rng, gross)
        self.positions = Poses.of(
            images_named, self.poses.centres + rng.normal(0.0, 0.03, (len(places), 3)), self.poses.rotations
        )

    def _measured(self, rng, gross):
        rows = []
        for image in self.poses.images:
            local = self.poses[image].to_local(self.points)
            pixels = self.camera.project(local)
            seen = np.flatnonzero(self.camera.sees(local))
            noise = rng.normal(0.0, NOISE, (len(seen), 2))
            bad = rng.random(len(seen)) < gross
            noise[bad] += rng.uniform(-60.0, 60.0, (int(bad.sum()), 2))
            rows += [(image, self.names[k], pixels[k] + off) for k, off in zip(seen, noise, strict=True)]
        return ImagePoints.of(
            [a for a, _, _ in rows], [b for _, b, _ in rows], np.array([c for _, _, c in rows]), NOISE
        )

    def block(self, weighting=None):
        """The block from rough poses and a nominal camera."""
        block = BundleAdjustment()
        block.add_cameras(Camera("c", 10000, 7000, 9000.0, degree=(3, 1, 1)))
        block.freeze_parameters("p.|b.|K[23]")
        block.add_poses(self.rough)
        block.add_measures(self.measures, weighting)
        return block


def _control(scene):
    chosen = range(0, len(scene.names), 20)
    return ControlPoints.of([scene.names[k] for k in chosen], scene.points[list(chosen)], 0.02)


def test_a_block_comes_home_from_rough_poses():
    scene = _Strips()
    block = scene.block()
    block.add_control_points(_control(scene))
    solution = block.solve()
    assert solution.converged
    assert solution.start.misfit > 100.0
    assert solution.sigma0 == pytest.approx(1.0, abs=0.08)
    assert all("1 ray" in item.reason or "0 ray" in item.reason for item in solution.left_out)
    off = solution.poses.centres - scene.poses.centres
    assert np.abs(off).max() < 5.0 * np.sqrt(np.diagonal(solution.centre_covariances, axis1=1, axis2=2)).max()


def test_a_single_strip_comes_home_by_its_observed_centres():
    scene = _Strips(lines=1, images=12)
    block = scene.block()
    block.observe_poses(scene.positions, 0.03)
    solution = block.solve()
    assert solution.converged
    assert solution.sigma0 == pytest.approx(1.0, abs=0.1)


def test_gross_errors_are_weakened_and_points_without_measures_named():
    scene = _Strips(gross=0.03)
    block = scene.block(Weighting(NOISE, attenuation=1.0, threshold=5.0))
    block.add_control_points(_control(scene))
    solution = block.solve()
    assert solution.converged
    assert solution.sigma0 < 1.1
    beyond = [item for item in solution.left_out if "are beyond the threshold" in item.reason]
    assert len(beyond) == len(solution.beyond) > 0
    used = {solution.points[k] for k in solution.residuals.point}
    assert not used & {item.name for item in beyond}
    # the losses are those that were asked for
    assert all(
        item.batch.loss.threshold == pytest.approx(5.0 / NOISE) for item in solution.equations.measures
    )
    weights = solution.residuals.weights
    norms = solution.residuals.norms
    assert (weights[norms > 5.0] == 0.0).all()
    np.testing.assert_allclose(weights[norms <= 5.0], 1.0 / (1.0 + norms[norms <= 5.0]), rtol=1e-2)


def test_good_poses_go_straight_to_the_solution():
    scene = _Strips()
    block = scene.block()
    block.poses = scene.poses
    block.add_control_points(_control(scene))
    solution = block.solve()
    assert solution.start.misfit < 5.0
    assert len(solution.iterations) == len(solution.result.iterations)


def test_robust_weights_may_take_more_iterations_unless_it_is_said():
    scene = _Strips(gross=0.03)
    block = scene.block(Weighting(NOISE, attenuation=1.0))
    block.poses = scene.poses
    block.add_control_points(_control(scene))
    assert block.solve().converged
    assert not block.solve(max_iterations=2).converged


def _over_the_ground(far):
    """Six images that look down on 25 points; one of these starts so far below."""
    rng = np.random.default_rng(1)
    camera = Camera("c", 2000, 1500, 1800.0)
    centres = np.array([[x, y, 10.0] for x in (0, 2, 4) for y in (0, 3)])
    poses = Poses.of([f"i{k}" for k in range(6)], centres, np.repeat(DOWN[None], 6, axis=0), cameras="c")
    points = rng.uniform([0, 0, -0.5], [4, 3, 0.5], (25, 3))
    names = [f"P{k}" for k in range(25)]
    rows = [
        (image, name, *(camera.project((point - centre)[None] * [1, -1, -1])[0] + rng.normal(0.0, NOISE, 2)))
        for image, centre in zip(poses.images, centres, strict=True)
        for name, point in zip(names, points, strict=True)
    ]
    images, seen, x, y = zip(*rows, strict=True)
    block = BundleAdjustment()
    block.add_cameras(camera)
    block.add_poses(poses)
    block.add_control_points(ControlPoints.of(names[20:], points[20:], 0.001))
    block.add_measures(ImagePoints.of(images, seen, np.column_stack([x, y]), NOISE))
    block.freeze_parameters()
    if far:
        block.add_approximations(["P3"], [[1.0, 1.0, -far]])
    return block.solve()


@pytest.mark.parametrize("far", [1e3, 1e6, 1e8])
def test_a_point_that_is_lost_far_away_is_called_back(far):
    found, other = _over_the_ground(far), _over_the_ground(0.0)
    assert found.converged
    assert not found.left_out
    assert len(found.iterations) == len(other.iterations)
    np.testing.assert_allclose(found.coordinates, other.coordinates, atol=1e-9)


def test_images_without_points_take_the_median_of_all_distances():
    distances, image = np.array([5.0, 1.0, np.nan, 3.0, 2.0, 8.0, np.nan]), np.array([0, 0, 0, 0, 2, 2, 3])
    np.testing.assert_array_equal(rough._medians(distances, image, 4), [3.0, 3.0, 5.0, 3.0])
    assert np.isnan(rough._medians(distances[[2, 6]], image[[2, 6]], 4)).all()
