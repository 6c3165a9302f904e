"""Radiometric models, on pixels that a person can follow."""

import pytest

from obseq.formulas import find
from obseq.formulas.radiometry import (
    REGISTERED,
    RadiomCalibPolIm,
    RadiomCalibRadSensor,
    RadiomEqualisation,
    RadiomStabilized,
    RadiomVignetLin,
    Sensor,
)

PIXEL = (3, 1, 1, 2, 4)
"""Pixel (3, 1), centre (1, 2), extent 4: u = 0.5, v = -0.25, r^2 = 0.3125."""


def test_image_polynomial() -> None:
    # 1 + 2 v + 3 u = 1 - 0.5 + 1.5
    assert RadiomCalibPolIm(1).evaluate((1, 2, 3), PIXEL) == pytest.approx((2,))


def test_names_of_the_image_polynomial_vary_fastest_in_v() -> None:
    assert RadiomCalibPolIm(2).unknowns == ("Mon_0_0", "Mon_0_1", "Mon_0_2", "Mon_1_0", "Mon_1_1", "Mon_2_0")


def test_radial_factor_of_a_sensor() -> None:
    # 1 + 2 * 0.3125 + 4 * 0.09765625 = 2.015625
    assert RadiomCalibRadSensor(Sensor(2)).evaluate((2, 4), PIXEL) == pytest.approx((0, 2.015625))


def test_sensor_polynomial_without_dark_current() -> None:
    # Terms v, v^2, u, u v: 1 + 6 * -0.25 + 7 * 0.0625 + 8 * 0.5 + 9 * -0.125 = 2.8125
    sensor = Sensor(2, False, 2)
    names = ("Sens_Mon_0_1", "Sens_Mon_0_2", "Sens_Mon_1_0", "Sens_Mon_1_1")
    assert sensor.coefficients == ("K0", "K1", *names)
    assert RadiomCalibRadSensor(sensor).evaluate((0, 0, 6, 7, 8, 9), PIXEL) == pytest.approx((0, 2.8125))


def test_with_a_dark_current_the_polynomial_reads_one_place_early() -> None:
    # K1 = 2 serves twice, and Sens_Mon_1_1 = 9 never: 1 + 2 * 0.09765625 + 2 v + 6 v^2 + 7 u + 8 u v
    sensor = Sensor(2, True, 2)
    found = RadiomCalibRadSensor(sensor).evaluate((0.5, 0, 2, 6, 7, 8, 9), PIXEL)
    assert found == pytest.approx((0.5, 1 + 0.1953125 - 0.5 + 0.375 + 3.5 - 1))


def test_equalisation_is_observed_minus_computed() -> None:
    # Image factor 2, sensor factor 1 + 2 * 0.3125, dark current 3: 100 - 2 * (20 * 1.625 + 3) = 29
    formula = RadiomEqualisation(Sensor(1, True), 1)
    assert formula.evaluate((20, 3, 2, 1, 2, 3), (100, *PIXEL)) == pytest.approx((29,))


def test_stabilisation_is_minus_what_is_not_constant() -> None:
    # 100 * (7 - (7 - 0.5 + 1.5)) = -100
    formula = RadiomStabilized(Sensor(1), 1)
    assert formula.evaluate((9, 7, 2, 3), (100, *PIXEL)) == pytest.approx((-100,))


def test_stabilisation_of_a_constant_is_nothing() -> None:
    assert RadiomStabilized(Sensor(1), 0).evaluate((9, 7), (100, *PIXEL)) == (0,)


def test_vignetting() -> None:
    # 10 / (1 + 0.5 + 0.25 * 4) = 4, minus 2 * 3 ... with rho^2 = 2: 1 + 0.25 * 2 + 0.25 * 4 = 2.5
    assert RadiomVignetLin(2).evaluate((2, 3, 0.25, 0.25), (10, 2)) == pytest.approx((-2,))


def test_any_member_is_found_by_its_name() -> None:
    for formula in (
        *REGISTERED,
        RadiomVignetLin(0),
        RadiomCalibPolIm(7),
        RadiomCalibRadSensor(Sensor(3, True, 0)),
        RadiomEqualisation(Sensor(0), 9),
        RadiomStabilized(Sensor(12, True, 6), 10),
    ):
        assert find(formula.name) == formula, formula.name


@pytest.mark.parametrize(
    "name",
    [
        "RadiomEqualisation_DRad5",
        "RadiomCalibRadSensor_DRad5_DegIm1",
        "RadiomCalibPolIm_x",
        "RadiomStabilized_",
    ],
)
def test_names_that_mean_nothing(name: str) -> None:
    assert find(name) is None
