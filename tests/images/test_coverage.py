"""Confidence regions of a block hold the truth as often as they say."""

import numpy as np
import pytest
import scenes
from scipy.stats import chi2


@pytest.mark.slow
def test_the_regions_of_95_percent_hold_the_truth_in_95_percent_of_200_blocks():
    """200 adjustments."""
    inside = []
    for seed in range(1000, 1200):
        block, poses, truth = scenes.block(seed=seed, n_images=5, n_points=16, noise=0.1, sigma=0.0004)
        block.freeze_parameters("K3|p2|b.")
        solution = block.solve()
        moved = solution.poses.centres - poses.centres
        regions = solution.centre_covariances / solution.result.variance_factor  # the given sigmas are right
        squares = np.einsum("ni,nij,nj->n", moved, np.linalg.inv(regions), moved)
        points = solution.coordinates - np.array([truth[name] for name in solution.points])
        free = solution.point_covariances[6:] / solution.result.variance_factor
        more = np.einsum("ni,nij,nj->n", points[6:], np.linalg.inv(free), points[6:])
        limit = chi2.ppf(0.95, 3)
        camera = solution.cameras["c"].parameters - scenes.CAMERA.parameters
        names = solution.cameras["c"].parameter_names
        kept = [k for k, name in enumerate(names) if name in ("F", "PPx", "PPy", "K1", "K2", "p1")]
        covariance = solution.camera_covariance("c")[np.ix_(kept, kept)] / solution.result.variance_factor
        interior = camera[kept] @ np.linalg.solve(covariance, camera[kept])
        inside.append([np.mean(squares < limit), np.mean(more < limit), interior < chi2.ppf(0.95, 6)])
    np.testing.assert_allclose(np.mean(inside, axis=0), 0.95, atol=0.03)
