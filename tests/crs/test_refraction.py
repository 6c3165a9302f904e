"""Curvature, arcs and refraction (reference, sections 8.4 and 15.1)."""

import numpy as np
import pytest

from obseq import crs
from obseq.crs import CrsError, parse

EQUATOR = parse("RTL*45*0*0*+proj=latlong")
STATION = np.array([[100.0, 100.0, 100.0]])
TARGET = np.array([[107.07177492, 107.07177492, 99.99996773]])


def test_numbers_of_the_bench_example_3() -> None:
    assert crs.curvature_radius(0.0) == pytest.approx(6356752.314, abs=5e-4)
    assert crs.horizontal_distance(EQUATOR, STATION, TARGET) == pytest.approx([9.9672], abs=1e-3)
    assert crs.refraction_correction(EQUATOR, STATION, TARGET) == pytest.approx([9.408e-8], abs=5e-12)


def test_curvature_is_the_mean_of_the_two_radii() -> None:
    latitude = np.deg2rad([0.0, 30.0, 45.0, 90.0])
    e2 = crs.SQUARED_ECCENTRICITY
    w2 = 1.0 - e2 * np.sin(latitude) ** 2
    meridian, normal = crs.EQUATORIAL_RADIUS * (1 - e2) / w2**1.5, crs.EQUATORIAL_RADIUS / np.sqrt(w2)
    assert crs.curvature_radius(latitude) == pytest.approx(np.sqrt(meridian * normal))


def test_distance_is_seen_at_the_height_of_the_origin() -> None:
    """A kilometre of arc on the ground is longer at the top of a tower, by height over radius."""
    pole = parse("RTL*0*90*0*EPSG:4326")
    target = np.array([[1000.0, 0.0, 0.0]])
    rho = 6399593.6
    low = crs.horizontal_distance(pole, [[0.0, 0.0, 0.0]], target)[0]
    high = crs.horizontal_distance(pole, [[0.0, 0.0, 1000.0]], target)[0]
    assert high / low == pytest.approx(1.0 + 1000.0 / rho, rel=1e-9)
    # alpha = 1000 / 6356752.3 (the pole is at b from the centre), times rho
    assert low == pytest.approx(1000.0 / 6356752.3142 * rho, rel=1e-7)


@pytest.mark.parametrize("length", [1e-6, 1e-3, 0.1, 1.0, 50.0, 5000.0])
def test_short_arcs_are_not_quantised(length) -> None:
    """An arc cosine of single doubles gives multiples of 0.1 m."""
    target = STATION + np.array([[length, 0.0, 0.0]])
    found = crs.horizontal_distance(EQUATOR, STATION, target)[0]
    # at the equator the point is at a + 100 m from the centre, seen with rho + 100 m
    expected = length * (6356752.3142 + 100.0) / (6378137.0 + 100.0)
    assert found == pytest.approx(expected, rel=1e-6, abs=3e-9)


def test_targets_on_the_vertical() -> None:
    """No NaN, as an arc cosine of more than 1 gives; the arc is that of the geocentric directions.

    The normal leans by e2 sin(lat) cos(lat) on the line to the centre: 3.3 mm per metre at 45 degrees.
    """
    frame = parse("RTL*2*45*0*EPSG:4326")
    station, ten_metres_up = np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 10.0]])
    distances = crs.horizontal_distance(frame, station, ten_metres_up)
    assert distances[0] == 0.0
    assert distances[1] == pytest.approx(10.0 * crs.SQUARED_ECCENTRICITY / 2.0, rel=0.01)


def test_any_system_with_a_place_will_do() -> None:
    lambert, frame = parse("L93"), parse("RTL*657700*6860700*0*L93")
    origins, targets = (
        np.array([[657700.0, 6860700.0, 10.0]] * 2),
        np.array([[657800.0, 6860750.0, 20.0]] * 2),
    )
    to_frame = crs.Transformer(lambert, frame)
    expected = crs.refraction_correction(frame, to_frame.forward(origins), to_frame.forward(targets))
    assert crs.refraction_correction(lambert, origins, targets) == pytest.approx(expected, rel=1e-9)
    assert expected.shape == (2,)
    with pytest.raises(CrsError, match="is local"):
        crs.refraction_correction(parse("LocalA"), origins, targets)


def test_coefficient_scales_the_correction() -> None:
    usual = crs.refraction_correction(EQUATOR, STATION, TARGET)
    assert crs.refraction_correction(EQUATOR, STATION, TARGET, coefficient=0.24) == pytest.approx(2.0 * usual)
    assert (usual > 0.0).all()
