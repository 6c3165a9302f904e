"""Circles through points: their axes and centres, wherever they lie and however they are turned."""

import numpy as np
import pytest

from obseq.geometry import exponential
from obseq.geometry.circles import axis_of, centre_of


@pytest.mark.parametrize("count", [3, 4, 9])
def test_axis_and_centre_of_a_turned_circle(count: int) -> None:
    random = np.random.default_rng(count)
    rotation, centre = exponential(random.normal(0.0, 1.0, 3)), random.normal(0.0, 50.0, 3)
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, count))
    flat = np.column_stack([3.0 * np.cos(angles), 3.0 * np.sin(angles), np.zeros(count)])
    points = flat @ rotation.T + centre
    np.testing.assert_allclose(centre_of(points), centre, atol=1e-10)
    normal = axis_of(points)
    np.testing.assert_allclose(np.abs(normal @ rotation[:, 2]), np.linalg.norm(normal), rtol=1e-12)


def test_points_on_a_line_have_no_circle() -> None:
    points = np.outer(np.arange(4.0), [1.0, 2.0, 3.0])
    assert centre_of(points) is None
    assert centre_of(points[:2]) is None
    assert not axis_of(points[:2]).any()
