"""Angles with the wrong sign: zenith angles that no instrument reads, and networks that are mirror images."""

import math
from dataclasses import replace

import numpy as np
import pytest
from five_points import PLACES, sights, table

from obseq.report.units import METRIC
from obseq.survey import network_from_tables
from obseq.survey.kinds.directions import HZ, ZEN
from obseq.survey.kinds.geodetic import LONGITUDE
from obseq.survey.screening.beyond_nadir import beyond_nadir
from obseq.survey.screening.findings import Cause, gap_of


@pytest.fixture(scope="module")
def network():
    """Every point observes all others; A and B are known, the others have approximate coordinates."""
    x, y, z = np.array(list(PLACES.values())).T
    points = {"name": list(PLACES), "x": x, "y": y, "z": z}
    points |= {f"s{axis}": [0.001, 0.001, None, None, None] for axis in "xyz"}
    return network_from_tables(points, table(sights()), angles="rad")


def turned(network, *kinds, start=None):
    """The network with the signs of some angles, all or those from a point, changed."""
    rows = network.book.observations
    chosen = np.isin(rows.types, [kind.code for kind in kinds])
    if start is not None:
        chosen &= rows.from_points == network.book.point_names.index(start)
    values = np.where(chosen, -rows.values, rows.values)
    return replace(network, book=replace(network.book, observations=replace(rows, values=values)))


@pytest.mark.parametrize("start", [None, "C"])
def test_zenith_angles_with_the_wrong_sign_are_one_finding(network, start):
    (error,) = turned(network, ZEN, start=start).gross_errors()
    count, where = (20, "") if start is None else (4, " from C")
    assert error.what.startswith(f"all {count} Zen observations{where} (the first: Zen ")
    assert error.cause is Cause.SENSE and len(error.rows) == count and error.size > 1e5
    assert "read in the other face, or with the wrong sign" in error.text


@pytest.mark.parametrize("start", [None, "C"])
def test_all_angles_with_the_wrong_sign_are_one_finding(network, start):
    (error,) = turned(network, HZ, ZEN, start=start).gross_errors()
    count, where = (40, "") if start is None else (8, " from C")
    assert error.what.startswith(f"all {count} angles{where} (the first: Hz ")
    assert error.text == "they look like angles with the wrong sign: directions counted anticlockwise"


def test_elevations_below_the_horizon_are_not_taken_for_zenith_angles_of_the_other_face(network):
    rows = network.book.observations
    values = np.where(rows.types == ZEN.code, -0.2, rows.values)
    book = replace(network.book, observations=replace(rows, values=values))
    assert not beyond_nadir(book).size and beyond_nadir(turned(network, ZEN).book).size == 20


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


def shifted(network, off, **ends):
    """The network with an angle (gon) added to the zenith angles from, or to, a point."""
    rows, names = network.book.observations, network.book.point_names
    chosen = rows.types == ZEN.code
    for end, name in ends.items():
        chosen &= getattr(rows, f"{end}_points") == names.index(name)
    values = np.where(chosen, rows.values + off * math.pi / 200.0, rows.values)
    return replace(network, book=replace(network.book, observations=replace(rows, values=values)))


@pytest.mark.parametrize(("off", "is_occupied"), [(40.0, False), (-1.0, True)])
def test_zenith_angles_to_one_target_that_are_off_are_one_finding(network, off, is_occupied):
    """Also where they decide where the target is, which has no sights of its own then."""
    from_target = network.book.observations.from_points == network.book.point_names.index("E")
    good = network if is_occupied else replace(network, book=network.book.without(from_target))
    (error,) = shifted(good, off, to="E").gross_errors()
    assert error.what.startswith("the 4 zenith angles to E (the first: Zen A -> E ")
    added = float(error.text.split(" ")[0])
    assert abs(added + off) < 0.01 and "likely another mark was aimed at" in error.text


def test_an_index_of_forty_gon_is_one_finding(network):
    (error,) = shifted(network, 40.0, **{"from": "D"}).gross_errors()
    assert error.cause is Cause.INDEX and error.what.startswith("the 4 zenith angles from D (the first: ")
    assert abs(float(error.text.split(" ")[0]) + 40.0) < 0.01


@pytest.mark.parametrize("reading", [250.0, -50.0])
def test_a_single_zenith_angle_of_the_other_face_is_named_where_nothing_is_spare(reading):
    sigmas = {axis: [0.001] * 3 + [None] for axis in ("sx", "sy", "sz")}
    places = {"x": [0.0, 10.0, 0.0, 3.0], "y": [0.0, 0.0, 10.0, 4.0], "z": [0.0, 0.0, 0.0, 5.0]}
    rows = {"type": ["Zen", "Dist", "Dist"], "from": ["A", "B", "C"], "to": ["P"] * 3}
    rows |= {"value": [reading, 9.487, 8.367], "sigma": [0.001, 0.002, 0.002]}
    (error,) = network_from_tables(
        {"name": list("ABCP"), **places, **sigmas}, rows, angles="gon"
    ).gross_errors()
    assert error.what == "Zen A -> P (observations:1)" and "is no zenith angle" in error.text


@pytest.mark.parametrize(("kind", "shown"), [(HZ, "395.00000"), (ZEN, "395.00000"), (LONGITUDE, "-5.00000")])
def test_what_the_others_give_is_within_one_turn(kind, shown):
    """A longitude is not: it is counted to both sides."""
    assert f"the others give {shown} gon, it is 1.00000 gon off" in gap_of(
        METRIC, kind, -5.0 * math.pi / 200.0, math.pi / 200.0
    )
