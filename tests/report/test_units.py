import math

from obseq.report import units


def test_angles_are_written_in_gon_and_their_residuals_in_milligon() -> None:
    assert units.observed("rad", math.pi / 2) == "100.00000 gon"
    assert units.small("rad", -math.pi / 200 * 0.0025) == "-2.500 mgon"


def test_lengths_are_written_in_metres_and_their_residuals_in_millimetres() -> None:
    assert units.observed("m", -1.25) == "-1.2500 m"
    assert units.small("m", 0.0123) == "12.30 mm"


def test_an_azimuth_is_between_0_and_400_gon() -> None:
    assert units.gon(-math.pi / 2) == "300.00000"
    assert units.gon(-1e-12) == "0.00000"


def test_what_is_not_defined_is_a_dash() -> None:
    assert (
        units.gon(None)
        == units.small("rad", None)
        == units.millimetres(None)
        == units.fixed(math.nan, 2)
        == "-"
    )
    assert units.significant(math.inf) == "-"


def test_no_negative_zero() -> None:
    assert units.fixed(-0.00001, 2) == "0.00"
    assert units.fixed(-0.01, 2) == "-0.01"
