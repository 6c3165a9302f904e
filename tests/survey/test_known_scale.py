"""Known points that are too far apart, or too near, by one factor: they are of another coordinate system."""

import math

import numpy as np
import pytest

from obseq.survey import network_from_tables
from obseq.survey.screening.findings import Cause

PLACES = {"A": (0.0, 0.0, 10.0), "B": (210.0, 20.0, 14.0), "C": (90.0, 190.0, 7.0), "D": (60.0, 60.0, 12.0)}
PLACES |= {"E": (130.0, 110.0, 9.0)}


def measured(n_known, scale, spoil=lambda kind, value: value, crs="EPSG:2154"):
    """Every point observes all others; the first ones are known in Lambert 93, `scale` times as far apart."""
    random = np.random.default_rng(2)
    rows = []
    for k, (start, here) in enumerate(PLACES.items()):
        for end, there in PLACES.items():
            east, north, up = np.subtract(there, here)
            flat = math.hypot(east, north)
            hz, zen = (math.atan2(*pair) + random.normal(0.0, 1e-5) for pair in ((east, north), (flat, up)))
            hz = (hz + 1.3 * k) % (2.0 * math.pi)
            sight = [("Hz", hz, 1e-5), ("Zen", zen, 1e-5), ("Dist", math.hypot(flat, up), 0.002)]
            rows += [
                (kind, start, end, spoil(kind, value), sigma) for kind, value, sigma in sight if start != end
            ]
    x, y, z = np.array(list(PLACES.values())).T
    given = {"x": 657700.0 + scale * x, "y": 6860700.0 + scale * y, "z": z}
    points = {"name": list(PLACES)}
    for axis, values in given.items():
        points[axis] = [value if k < n_known else None for k, value in enumerate(values.tolist())]
        points[f"s{axis}"] = [0.02 if k < n_known else None for k in range(5)]
    columns = dict(zip(("type", "from", "to", "value", "sigma"), zip(*rows, strict=True), strict=True))
    return network_from_tables(points, columns, angles="rad", points_crs=crs)


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
