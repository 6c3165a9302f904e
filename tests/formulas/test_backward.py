"""Cameras whose distortion corrects the measure: numbers that a person can follow, and a round trip."""

import numpy as np
import pytest

from obseq.errors import FormulaError, InputError
from obseq.formulas.backward import BackwardColinearity, BackwardDistortion
from obseq.formulas.distortion import Degree
from obseq.formulas.projections import Stenope
from obseq.images import Camera

IDENTITY = np.eye(3).ravel()


def test_the_measured_point_is_corrected():
    # Measured at (0.3, 0.4): squared radius 0.25, K1 = 0.1, so (0.3075, 0.41), times 1000 pixels.
    formula = BackwardColinearity(Degree(3, 1, 0), Stenope())
    camera = (0, 0, 0, 0, 0, 0, 1000, 500, 400, 0.1, 0, 0, 0, 0)
    # The point 1 m right and 2 m down at 10 m is at (0.1, 0.2): 100 and 200 pixels.
    residual = formula.evaluate((1, 2, 10, *camera), (800, 800, *IDENTITY))
    assert residual == pytest.approx((100 - 307.5, 200 - 410), rel=1e-14)


def test_affine_terms_come_first():
    # b1 = 0.1, b2 = 0.05: x becomes 0.3 + 0.03 + 0.02 = 0.35; then s = 0.2825 and K1 s = 0.02825.
    formula = BackwardDistortion(Degree(3, 1, 1))
    x, y = formula.evaluate((0.3, 0.4), (0.1, 0, 0, 0, 0, 0.1, 0.05))
    assert (x, y) == pytest.approx((0.35 * 1.02825, 0.4 * 1.02825), rel=1e-14)


def test_a_camera_goes_there_and_back():
    camera = Camera("c", 2000, 1500, 1800.0, [990.0, 740.0], (3, 1, 1), _BROWN, backward=True)
    pixels = np.random.default_rng(0).uniform([0, 0], [2000, 1500], (50, 2))
    rays = camera.directions(pixels)
    np.testing.assert_allclose(camera.project(rays), pixels, atol=1e-9)
    assert camera.sees(rays).all()
    step = 1e-6 * np.eye(3)
    _, jacobian = camera.project_with_jacobian(rays)
    slopes = [(camera.project(rays + h) - camera.project(rays - h)) / 2e-6 for h in step]
    np.testing.assert_allclose(jacobian, np.stack(slopes, axis=2), atol=1e-4)


_BROWN = {"K1": 0.08, "K2": -0.02, "p1": 1e-3, "p2": -5e-4, "b1": 4e-4, "b2": 1e-4}


def test_general_terms_are_refused():
    with pytest.raises(FormulaError, match="of the general terms there are b1 and b2"):
        BackwardDistortion(Degree(3, 1, 2))
    with pytest.raises(InputError, match="camera c: degree"):
        Camera("c", 2000, 1500, 1800.0, degree=(3, 1, 5), backward=True)
