"""Models placed on images, on four pixels that a person can follow."""

import pytest

from obseq.formulas.image_deformation import (
    DeformImAffinity,
    DeformImHomography,
    DeformImHomotethy,
    LGrad_DeformImHomotethy,
)

SQUARE = (10, 20, 100, 110, 120, 170)
"""Corner (10, 20); values 100, then 110 next along x, 120 next along y, 170 on the diagonal."""


def test_bilinear_interpolation_between_four_pixels() -> None:
    # Place (10.5, 20.25): low side 105, high side 145, a quarter up: 115. Model 2 * 50 + 20 = 120.
    unknowns = (2, 20, 0.5, 10, 20)
    assert DeformImHomotethy().evaluate(unknowns, (*SQUARE, 1, 0.5, 50)) == pytest.approx((5,))


def test_im10_is_along_x() -> None:
    # Place (11, 20): the value is Im10.
    assert DeformImHomotethy().evaluate((1, 0, 1, 10, 20), (*SQUARE, 1, 0, 0)) == pytest.approx((-110,))


def test_a_homothety_is_an_affinity() -> None:
    for model in ((0, 0), (1, 0.5), (0.2, 0.9)):
        (one,) = DeformImHomotethy().evaluate((2, 20, 0.5, 10, 20), (*SQUARE, *model, 50))
        (other,) = DeformImAffinity().evaluate((2, 20, 0.5, 0, 0, 0.5, 10, 20), (*SQUARE, *model, 50))
        assert one == pytest.approx(other, abs=1e-12)


def test_the_affinity_s_first_row_gives_x() -> None:
    # x = 10 + 0.5 * 1 (second entry of the first row), y = 20: halfway from 100 to 110.
    unknowns = (1, 0, 0, 0.5, 0, 0, 10, 20)
    assert DeformImAffinity().evaluate(unknowns, (*SQUARE, 0, 1, 0)) == pytest.approx((-105,))


def test_a_value_and_its_gradient() -> None:
    # Image 100 with gradient (10, -4) at (10, 20), read at (10.5, 20.25): 104. Model 120.
    found = LGrad_DeformImHomotethy().evaluate((2, 20, 0.5, 10, 20), (10, 20, 100, 10, -4, 1, 0.5, 50))
    assert found == pytest.approx((16,))


def test_homography_has_perspective_bend_light_and_blur() -> None:
    """Depth 1 + 0.5 2 = 2, so that p = (4, 2) / 2 = (2, 1), with |p|^2 = 5: place (10 + 2 + 0.5, 20 + 1 - 1).

    The image there is 100 + 10 0.5 - 4 (-1) = 109, the model (2 + 0.5 2) (50 + 0.1 20) + 5 + 2 = 163.
    """
    unknowns = (2, 5, 0.5, 0, 1, 0, 0.1, 2, 0, 0, 2, 0.5, 0, 0.1, -0.2, 10, 20)
    observations = (12, 21, 100, 10, -4, 2, 1, 50, 20)
    assert DeformImHomography().evaluate(unknowns, observations) == pytest.approx((163 - 109,))


def test_homography_without_its_own_is_the_affinity() -> None:
    """At the place where the image was read, its gradient does not count."""
    unknowns = (2, 20, 0, 0, 0, 0, 0, 0.5, 0.1, -0.1, 0.5, 0, 0, 0, 0, 10, 20)
    (one,) = DeformImHomography().evaluate(unknowns, (10.6, 20.3, 105, 3, 7, 1, 1, 50, 9))
    (other,) = DeformImAffinity().evaluate(
        (2, 20, 0.5, 0.1, -0.1, 0.5, 10, 20), (10, 20, 105, 105, 105, 105, 1, 1, 50)
    )
    assert one == pytest.approx(other - 7 * 0.1)
