"""Resections on the circle through their targets: the iterations end somewhere on it."""

import math

import pytest

from obseq.survey import network_from_tables

TARGETS = {"A": 0.1, "B": 1.6, "C": 3.0}
"""Known points, by their angle (rad) on a circle of 200 m around (500, 500)."""


def resection(radius, more=()):
    """The adjustment of P, seen from the centre at 4.6 rad, from directions to the targets."""
    places = {name: (500 + 200 * math.cos(a), 500 + 200 * math.sin(a)) for name, a in TARGETS.items()}
    p = (500 + radius * math.cos(4.6), 500 + radius * math.sin(4.6))
    points = {"name": [*places, "P"], "x": [], "y": [], "z": [100.0] * 4}
    for x, y in [*places.values(), (p[0] - 20.0, p[1] + 9.0)]:
        points["x"].append(x)
        points["y"].append(y)
    points |= {f"s{axis}": [0.001] * 3 + [None] for axis in "xyz"}
    table = {"type": [], "from": [], "to": [], "value": [], "sigma": []}
    for name, (x, y) in places.items():
        azimuth = math.degrees(math.atan2(x - p[0], y - p[1])) / 0.9
        for kind, value in (("Hz", round(azimuth % 400, 4)), ("Zen", 100.0)):
            for column, one in zip(table, (kind, "P", name, value, 0.001), strict=True):
                table[column].append(one)
    for name in more:
        length = math.dist(p, places[name])
        for column, one in zip(table, ("Dist", "P", name, length, 0.005), strict=True):
            table[column].append(one)
    return network_from_tables(points, table, angles="gon", refraction=0.0).adjust()


def test_a_station_on_the_circle_through_its_targets_is_doubtful():
    adjusted = resection(200.0)
    (point,) = adjusted.doubtful
    assert (point.name, set(point.circle)) == ("P", set(TARGETS))
    assert "danger circle" in adjusted.warnings[-1]
    assert not adjusted.is_complete
    assert not adjusted.record().is_complete
    assert adjusted.record().doubtful[0].circle == point.circle


@pytest.mark.parametrize(("radius", "more"), [(60.0, ()), (200.0, ("A", "B"))])
def test_off_the_circle_or_with_distances_it_is_determined(radius, more):
    adjusted = resection(radius, more)
    assert adjusted.doubtful == ()
    assert adjusted.is_complete
