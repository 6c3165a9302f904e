"""The rational and the generic sensor against the equations of the catalogue."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.images.aerial import Rpc
from obseq.images.epipolar import CorrectedSensor, Pinhole, RationalSensor, epipolar_residuals
from obseq.kernels import calculator

RNG = np.random.default_rng(12)
TURN = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
FIRST = Pinhole(np.array([0.0, 0.0, 100.0]), TURN, 1000.0, np.array([500.0, 400.0]))
SECOND = Pinhole(np.array([30.0, 2.0, 101.0]), TURN, 1000.0, np.array([500.0, 400.0]))
SCENE = RNG.uniform([-20, -20, -5], [40, 20, 5], (60, 3))
BENT = 1e-3 * np.array([300.0, -200.0, 2.0, 1.0, 1e-3, -2e-3, -1.0, 2.0, 2e-3, 1e-3, 1e-3, 3e-3])


def test_rational_polynomials_are_those_of_the_catalogue():
    """`RPC_Transfo` counts latitude as its first coordinate and line as i."""
    coefficients = RNG.normal(0.0, 0.1, (4, 20))
    coefficients[[1, 3], 0] = 1.0
    offsets = {"LINE": 5000.0, "SAMP": 4000.0, "LAT": 45.0, "LONG": 3.0, "HEIGHT": 500.0}
    scales = {"LINE": 5100.0, "SAMP": 4100.0, "LAT": 0.05, "LONG": 0.07, "HEIGHT": 510.0}
    ground = np.column_stack(
        [RNG.uniform(2.95, 3.05, 50), RNG.uniform(44.96, 45.04, 50), RNG.uniform(100, 900, 50)]
    )
    inputs = [[values[key] for key in ("LAT", "LONG", "HEIGHT")] for values in (offsets, scales)]
    outputs = [[values[key] for key in ("LINE", "SAMP", "HEIGHT")] for values in (offsets, scales)]
    given = np.concatenate([*inputs, *outputs, coefficients.ravel()])
    found = calculator("RPC_Transfo").values(
        np.ascontiguousarray(ground[:, [1, 0, 2]]), np.broadcast_to(given, (50, len(given)))
    )
    pixels = Rpc(offsets, scales, coefficients).project(ground)
    np.testing.assert_allclose(pixels[:, ::-1], found[:, :2], rtol=1e-12)
    assert RationalSensor(Rpc(offsets, scales, coefficients)).rpc.offsets["LONG"] == 3.0


def test_a_corrected_sensor_is_that_of_its_observation_equation():
    sensor = CorrectedSensor(FIRST, BENT)
    seen = sensor.project(SCENE)
    base = FIRST.project(SCENE)
    step = 1e-4 * np.eye(3)
    gradients = [(FIRST.project(SCENE + s) - FIRST.project(SCENE - s)) / 2e-4 for s in step]
    slopes = np.stack(gradients, axis=2).reshape(len(SCENE), 6)
    unknowns = np.hstack([SCENE, np.broadcast_to(BENT, (len(SCENE), 12))])
    residuals = calculator("Dist_Polyn2D_Degree_2_EqColin").values(
        unknowns, np.hstack([seen, SCENE, base, slopes])
    )
    np.testing.assert_allclose(residuals, 0.0, atol=1e-9)
    assert np.abs(seen - base).max() > 1.0


def test_corrected_sensors_agree_on_their_scene_and_uncorrected_ones_do_not():
    one, two = CorrectedSensor(FIRST, BENT), CorrectedSensor(SECOND, -0.5 * BENT)
    pixels = one.project(SCENE), two.project(SCENE)
    np.testing.assert_allclose(one.uncorrected(pixels[0]), FIRST.project(SCENE), rtol=0.0, atol=1e-8)
    good = epipolar_residuals(one, pixels[0], two, pixels[1])
    np.testing.assert_allclose(good.values, 0.0, atol=1e-7)
    bad = epipolar_residuals(FIRST, pixels[0], SECOND, pixels[1])
    assert np.abs(bad.values).max() > 0.1


def test_a_correction_that_folds_the_image_has_no_ray_there():
    folded = CorrectedSensor(FIRST, np.array([0.0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1e-3, 0]))
    assert np.isnan(folded.uncorrected(np.array([[-900.0, 100.0]]))).all()


@pytest.mark.parametrize("given", [np.zeros(3), np.full(6, np.nan), np.zeros((2, 6))])
def test_wrong_parameters_are_refused(given):
    with pytest.raises(InputError, match="2, 6, 12 or 20 finite numbers"):
        CorrectedSensor(FIRST, given)
