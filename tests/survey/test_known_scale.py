"""Known points that are too far apart, or too near, by one factor: they are of another coordinate system."""

import numpy as np
import pytest
from five_points import PLACES, sights, table

from obseq.survey import network_from_tables
from obseq.survey.screening.findings import Cause


def measured(n_known, scale, spoil=lambda kind, value: value, crs="EPSG:2154"):
    """Every point observes all others; the first ones are known in Lambert 93, `scale` times as far apart."""
    rows = [(kind, start, end, spoil(kind, value), sigma) for kind, start, end, value, sigma in sights()]
    x, y, z = np.array(list(PLACES.values())).T
    given = {"x": 657700.0 + scale * x, "y": 6860700.0 + scale * y, "z": z}
    points = {"name": list(PLACES)}
    for axis, values in given.items():
        points[axis] = [value if k < n_known else None for k, value in enumerate(values.tolist())]
        points[f"s{axis}"] = [0.02 if k < n_known else None for k in range(5)]
    return network_from_tables(points, table(rows), angles="rad", points_crs=crs)


@pytest.mark.parametrize(("n_known", "scale"), [(2, 1.52), (3, 0.62)])
def test_known_points_of_another_map_are_one_finding(n_known, scale):
    (error,) = measured(n_known, scale).gross_errors()
    assert error.cause is Cause.COORDINATE_SYSTEM and error.points == tuple("ABC"[:n_known])
    assert f"they are {scale:.3g} times as far apart as the observations place them" in error.text
    assert "correct --points-crs" in error.text and ("or the coordinates of one" in error.text) == (
        n_known == 2
    )


def test_right_points_are_not_accused_and_feet_are_told_as_feet():
    assert measured(3, 1.0).gross_errors() == ()
    feet = measured(3, 1.0, lambda kind, value: value / 0.3048 if kind == "Dist" else value)
    assert [error.cause for error in feet.gross_errors()] == [Cause.UNITS]
