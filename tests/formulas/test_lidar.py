"""Lidar points in images and scans, on projections that a person can follow."""

from collections.abc import Sequence

import numpy as np
import pytest

import obseq
from obseq.formulas.lidar import (
    EqLidarImCensus,
    EqLidarImCensusPose,
    EqLidarImCorrel,
    EqLidarImCorrelPose,
    EqLidarImPonct,
    EqLidarImPonctPose,
    EqLidarLidar,
)

IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)
TO_CAMERA = (0, 1, 0, -1, 0, 0, 0, 0, 1)
"""World to camera: the world's y is x in the camera, the world's x is -y."""
CAMERA = (1, 2, 0, 0, 0, 0)
GRADIENTS = (10, 0, 0, 0, 20, 0)
"""10 pixels along i for a metre along x of the camera, 20 along j for a metre along y."""


def sighting(point: Sequence[float], radiometry: float = 100) -> tuple[float, ...]:
    """A point, expanded at (3, -1, 5) of the camera, where the image has the gradient (0.5, -2)."""
    return (*point, 3, -1, 5, *GRADIENTS, radiometry, 0.5, -2)


def test_a_point_follows_the_gradients_of_the_image() -> None:
    # (2.2, 5.1, 5) is (1.2, 3.1, 5) from the camera, (3.1, -1.2, 5) in its frame, (0.1, -0.2, 0) off: 1 pixel
    # along i, -4 along j; 100 + 0.5 + 8 = 108.5.
    found = EqLidarImPonct().evaluate((100, *CAMERA), (*TO_CAMERA, *sighting((2.2, 5.1, 5))))
    assert found == pytest.approx((8.5,), abs=1e-12)


def test_the_target_of_a_patch_is_reached_by_a_line() -> None:
    # 3 + 2 * 108.5 - 200 = 20
    found = EqLidarImCorrel().evaluate((200, 2, 3, *CAMERA), (*TO_CAMERA, *sighting((2.2, 5.1, 5))))
    assert found == pytest.approx((20,), abs=1e-12)


def test_a_scan_places_its_points() -> None:
    # The scan at (0.2, 0.1, 0) turned by a quarter takes (5, -2, 5) to (2.2, 5.1, 5), the point above.
    scan, turn = (0.2, 0.1, 0, 0, 0, 0), (0, -1, 0, 1, 0, 0, 0, 0, 1)
    observations = (*turn, *TO_CAMERA, *sighting((5, -2, 5)))
    assert EqLidarImPonctPose().evaluate((100, *scan, *CAMERA), observations) == pytest.approx((8.5,))
    assert EqLidarImCorrelPose().evaluate((200, 2, 3, *scan, *CAMERA), observations) == pytest.approx((20,))


def census(first: float, second: float) -> float:
    """Residual of the contrast of two radiometries, the points being where they were expanded."""
    seen = ((2, 5, 5), (2, 5, 5))
    blocks = [(*TO_CAMERA, *sighting(p, value)) for p, value in zip(seen, (first, second), strict=True)]
    (found,) = EqLidarImCensus().evaluate((0.0, *CAMERA), (*blocks[0], *blocks[1]))
    scans = [(*IDENTITY, *block) for block in blocks]
    unknowns = (0.0, 0, 0, 0, 0, 0, 0, *CAMERA)
    assert EqLidarImCensusPose().evaluate(unknowns, (*scans[0], *scans[1])) == pytest.approx((found,))
    return float(found)


def test_contrast_of_a_point_with_its_neighbour() -> None:
    assert census(100, 50) == pytest.approx(0.5)
    assert census(50, 100) == pytest.approx(-0.5)
    assert census(80, 80) == 0
    assert census(-10, 80) == -1
    assert census(0, 0) == 0


@pytest.mark.parametrize(("first", "second"), [(100, 100), (0, 0), (-5, -5), (-5, 100)])
def test_the_contrast_has_derivatives_at_equality_and_none_through_negative_radiometries(
    first: float, second: float
) -> None:
    calc = obseq.calculator("EqLidarImCensus")
    observations = [*TO_CAMERA, *sighting((2, 5, 5), first), *TO_CAMERA, *sighting((2, 5, 5), second)]
    values, jacobian = calc.values_and_jacobian([[0.25, *CAMERA]], [observations])
    assert np.isfinite(values).all() and np.isfinite(jacobian).all()
    if first <= 0:
        # A negative radiometry does not move the contrast, which it holds at -1 or 0; nor do two that are 0.
        assert (jacobian[0, 0, 1:] == 0).all()
    else:
        # Equal radiometries with the same gradients: the contrast stays 0 when the camera moves.
        assert jacobian[0, 0] == pytest.approx([-1, *[0] * 6], abs=1e-15)


def test_the_second_matrix_is_read() -> None:
    observations = [*TO_CAMERA, *sighting((2.2, 5.1, 5)), *TO_CAMERA, *sighting((2.2, 5.1, 5))]
    assert EqLidarImCensus().evaluate((0, *CAMERA), observations) == (0,)
    observations[24:33] = IDENTITY
    assert EqLidarImCensus().evaluate((0, *CAMERA), observations) != (0,)


def test_distance_of_a_scanned_point_in_another_scan() -> None:
    # A at (1, 0, 0): its point (2, 4, 12) is (3, 4, 12) in the world, 13 m from B at the origin. The raster
    # says 12 at (3, 4, 11), and 1 m along z is 10 columns, each of 0.02 m: 12.2.
    scans = (1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    raster = (3, 4, 11, 0, 0, 10, 1, 0, 0, 12, 0.02, 0.5)
    found = EqLidarLidar().evaluate(scans, (*IDENTITY, *IDENTITY, 2, 4, 12, *raster))
    assert found == pytest.approx((0.8,), abs=1e-12)
