"""Points outside the area of use, or the domain, of their system: it is said, with what explains it."""

import numpy as np
import pytest

from obseq import crs
from obseq.errors import CrsError

PARIS = np.array([[652000.0, 6862000.0, 35.0], [653000.0, 6863000.0, 40.0]])
NAMES = ["A", "B"]


def warning(definition, points, names=NAMES):
    return crs.area_warning(crs.parse(definition), np.asarray(points, float), names)


def test_points_inside_are_nothing_to_speak_of():
    assert warning("IGNF:LAMB93", PARIS) is None
    assert warning("EPSG:4326", [[2.35, 48.85, 35.0], [179.0, -10.0, 0.0]]) is None
    assert warning("EPSG:32660", [[700000.0, 100000.0, 0.0], [833978.56, 0.0, 0.0]]) is None  # the date line
    assert warning("Local", PARIS) is None
    assert crs.area_warning(crs.parse("IGNF:LAMB93"), np.zeros((0, 3)), []) is None


def test_swapped_coordinates_are_recognised():
    text = warning("IGNF:LAMB93", PARIS[:, [1, 0, 2]])
    assert text.startswith("A, B: outside the area where 'IGNF:LAMB93' is used (")
    assert text.endswith("); easting and northing look swapped")
    assert warning("EPSG:4171", [[48.85, 2.35, 35.0]], ["A"]).endswith("longitude and latitude look swapped")


def test_one_point_among_others_and_another_system():
    text = warning("IGNF:LAMB93", [PARIS[0], [-3e6, -2e6, 0.0]])
    assert text.startswith("B: outside")
    assert text.endswith("is it the system of these coordinates?")


def test_outside_the_domain_the_error_says_what_would_be_inside():
    with pytest.raises(CrsError, match="With longitude and latitude exchanged it is inside: longitude comes"):
        crs.parse("EPSG:4326").to_geocentric([2.35, 148.85, 35.0])
    with pytest.raises(CrsError, match=r"It takes longitude and latitude \(degree\)"):
        crs.parse("EPSG:4326").to_geocentric(PARIS)


def test_the_number_of_a_zone_in_front_of_the_easting_is_recognised():
    zoned = [[32_455_210.1, 5_540_300.0, 310.0], [32_456_100.2, 5_541_000.0, 305.0]]
    with pytest.raises(CrsError, match="Without the zone number 32 in front of the easting it is inside"):
        crs.parse("EPSG:25832").to_geocentric(zoned)
