"""Angles with the wrong sign: zenith angles that no instrument reads, and networks that are mirror images."""

import math
from dataclasses import replace

import numpy as np
import pytest
from five_points import PLACES, sights, table
from verdicts import alternatives, codes

from obseq.survey import network_from_tables
from obseq.survey.kinds.directions import HZ, ZEN


@pytest.fixture(scope="module")
def network():
    """Every point observes all others; A and B are known, the others have approximate coordinates."""
    x, y, z = np.array(list(PLACES.values())).T
    points = {"name": list(PLACES), "x": x, "y": y, "z": z}
    points |= {f"s{axis}": [0.001, 0.001, None, None, None] for axis in "xyz"}
    return network_from_tables(points, table(sights()), angles="rad", refraction=1.0)


def turned(network, *kinds, start=None):
    """The network with the signs of some angles, all or those from a point, changed."""
    rows = network.book.observations
    chosen = np.isin(rows.types, [kind.code for kind in kinds])
    if start is not None:
        chosen &= rows.from_points == network.book.point_names.index(start)
    values = np.where(chosen, -rows.values, rows.values)
    return replace(network, book=replace(network.book, observations=replace(rows, values=values)))


@pytest.mark.parametrize(("kinds", "count"), [((ZEN,), 20), ((HZ, ZEN), 40)])
def test_angles_with_the_wrong_sign_are_one_finding(network, kinds, count):
    (error,) = turned(network, *kinds).gross_errors()
    assert len(error.observations) == count and codes(error) & {"W102", "W131"}


def test_a_network_that_is_a_mirror_image_is_told_by_approximate_coordinates(network):
    """Two known points do not contradict it."""
    assert not network.gross_errors() and not network.adjust().warnings
    adjustment = turned(network, HZ).adjust()
    assert adjustment.solution.sigma0 < 2.0 and not adjustment.gross_errors
    assert adjustment.warnings[0].startswith(
        "the observations place 3 points as their approximate coordinates"
    )
    assert "directions look like counted anticlockwise" in adjustment.warnings[0]


def test_one_bad_approximation_is_no_mirror_image(network):
    coordinates = network.points.coordinates.copy()
    coordinates[[2, 3, 4]] += (500.0, 300.0, 0.0), (-400.0, 100.0, 0.0), (0.0, -600.0, 0.0)
    adjustment = replace(network, points=replace(network.points, coordinates=coordinates)).adjust()
    assert len(adjustment.replaced) == 3 and not any("mirror" in text for text in adjustment.warnings)


@pytest.mark.parametrize(("end", "name"), [("to", "E"), ("from", "D")])
def test_zenith_angles_that_share_an_offset_are_one_finding(network, end, name):
    rows, names = network.book.observations, network.book.point_names
    chosen = (rows.types == ZEN.code) & (getattr(rows, f"{end}_points") == names.index(name))
    values = np.where(chosen, rows.values - math.pi / 200.0, rows.values)
    (error,) = replace(
        network, book=replace(network.book, observations=replace(rows, values=values))
    ).gross_errors()
    told = [
        one
        for one in alternatives(error)
        if {row.row for row in one.observations} == set(np.flatnonzero(chosen))
    ]
    assert "S140" in {one.code for one in told}
