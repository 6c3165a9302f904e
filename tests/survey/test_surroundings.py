"""What is worked out once for coordinates belongs to these coordinates."""

import numpy as np

from obseq import crs
from obseq.survey.equations.frame import Frame

FRAME = Frame(crs.parse("RTL*2.4*48.8*100*EPSG:4326"))
PLACES = np.array([[0.0, 0.0, 0.0], [5000.0, -300.0, 40.0], [-70.0, 20000.0, 900.0]])


def test_verticals_of_some_points_are_those_of_the_system():
    rows = np.array([2, 0])
    np.testing.assert_array_equal(FRAME.verticals(rows, PLACES), FRAME.system.vertical_rotation(PLACES[rows]))


def test_coordinates_that_change_in_place_have_other_surroundings():
    coordinates = PLACES.copy()
    before = FRAME.around(coordinates).geodetic[1].copy()
    coordinates[1, 0] += 1e-3
    after = FRAME.around(coordinates).geodetic[1]
    np.testing.assert_array_equal(after, FRAME.system.geodetic(coordinates)[1])
    assert before[0] < after[0]


def test_same_coordinates_are_worked_out_once():
    first = FRAME.around(PLACES)
    assert FRAME.around(PLACES.copy()) is first
    assert FRAME.around(PLACES[:2]) is not first
    assert FRAME.around(PLACES) is first, "those of the last few coordinates are kept"
    for k in range(1, 20):
        FRAME.around(PLACES + k)
    assert FRAME.around(PLACES) is not first
