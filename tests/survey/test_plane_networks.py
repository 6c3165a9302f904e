"""Slips in networks of the plane: what a set-up or all distances share is named as one cause."""

from dataclasses import replace

import numpy as np
import pytest
from plane_site import PlaneSite

from obseq.survey import Network, estimating
from obseq.survey.screening.findings import Cause

BOTH = pytest.mark.parametrize("with_angles", [False, True])


@BOTH
def test_an_honest_network_raises_no_alarm(with_angles):
    adjustment = PlaneSite(with_angles=with_angles).network().adjust()
    assert adjustment.gross_errors == () and adjustment.suspicion is None


@BOTH
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v: v - 0.1344, "a constant added to all of them fits (0.13"),
        (lambda v: 1.0005 * v, "one scale for all of them fits (-"),
    ],
)
def test_what_all_horizontal_distances_share_is_named(with_angles, change, words):
    site = PlaneSite(with_angles=with_angles)
    rows = site.change_values(change, ("DistHz",))
    (error,) = site.network().gross_errors()
    assert error.cause is Cause.DISTANCES and words in error.text and error.rows == tuple(rows)


def test_it_is_named_where_no_distance_stands_out():
    site = PlaneSite()
    site.change_values(lambda v: v + 0.006, ("DistHz",))
    network = site.network()
    assert network.gross_errors() == ()
    (error,) = network.adjust().gross_errors
    assert error.cause == Cause.DISTANCES and "a constant added to all of them fits (-0.00" in error.text


def test_constant_and_scale_of_horizontal_distances_can_be_estimated():
    site = PlaneSite()
    site.change_values(lambda v: (v - 0.025) / 1.0003, ("DistHz",))
    network = site.network()
    adjustment = replace(network, book=estimating(network.book, ["constant", "scale"])).adjust()
    found = dict(
        note.split(" of observations: ") for note in adjustment.notes if " of observations: " in note
    )
    constant, scale = (float(found[part].split()[0]) for part in ("constant", "scale"))
    assert constant == pytest.approx(0.025, abs=0.003) and scale == pytest.approx(3e-4, abs=2e-5)
    assert 0.8 < adjustment.sigma0 < 1.2


@BOTH
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v: v - 0.0644, "0.06"),
        (lambda v: 1.0012 * v, " ppm added to each of them fits: likely a correction in ppm that is wrong"),
    ],
)
def test_what_the_distances_of_one_set_up_share_is_one_cause(with_angles, change, words):
    site = PlaneSite(with_angles=with_angles)
    rows = site.change_values(change, ("DistHz",), "M11")
    (error,) = site.network().gross_errors()
    assert error.cause is Cause.DISTANCES and words in error.text and set(error.rows) <= set(rows)
    assert error.what.startswith("the 6 distances from M11") and len(error.rows) >= 4


def beside(site, name, shift):
    """The set-up of a point, as from a place beside it; its rows."""
    mark = site.places[name]

    def moved(row):
        before = site.sight(name, row.target), site.sight(name, row.backsight or name)
        site.places[name] = mark + shift
        after = site.sight(name, row.target), site.sight(name, row.backsight or name)
        site.places[name] = mark
        if row.type == "DistHz":
            return replace(row, value=row.value + after[0][1] - before[0][1])
        turn = after[0][0] - before[0][0] - (after[1][0] - before[1][0] if row.backsight else 0.0)
        return replace(row, value=(row.value + turn) % 400.0)

    return site.change(moved, origin=name)


@BOTH
@pytest.mark.parametrize("name", ["M11", "M21"])
def test_an_eccentric_set_up_is_one_cause(with_angles, name):
    site = PlaneSite(with_angles=with_angles)
    rows = beside(site, name, (0.25, 0.1))
    (error,) = site.network().gross_errors()
    assert error.cause is Cause.ECCENTRIC and error.points == (name,) and set(rows) <= set(error.rows)
    assert float(error.text.partition("), ")[2].split()[0]) == pytest.approx(0.27, abs=0.01)


@BOTH
def test_a_set_up_of_another_point_is_one_cause(with_angles):
    site = PlaneSite(4, 3, with_angles=with_angles)
    targets = {end for row in site.rows if row.origin == "M11" for end in (row.target, row.backsight)}
    (other, *_) = (name for name in site.places if name not in {*targets, "M11"})
    rows = site.change(lambda row: replace(row, origin=other), origin="M11")
    (error,) = site.network().gross_errors()
    assert error.cause is Cause.WRONG_POINT and error.points == (other, "M11") and error.rows == tuple(rows)
    assert f"they fit M11, not {other}: the name of the station is wrong" in error.text


def test_what_is_tried_is_told_while_it_lasts():
    site, told = PlaneSite(), []
    beside(site, "M11", (0.25, 0.1))
    (error,) = site.network().adjust(progress=told.append).gross_errors
    assert error.cause == Cause.ECCENTRIC
    assert [line for line in told if line.startswith("gross errors: cause ")][:2] == [
        "gross errors: cause 1",
        "gross errors: cause 2",
    ]


def test_no_constant_of_kilometres_is_thought_of(shared_data):
    """Of five distances with hardly any control two, of one station, are in feet: much would fit."""
    network = Network.read_project(shared_data / "gama-textbook-2d/Ghilani14_5_Distance_fix.gkf")
    rows = network.book.observations
    values = np.where(rows.from_points == rows.from_points[0], rows.values / 0.3048, rows.values)
    spoilt = replace(network, book=replace(network.book, observations=replace(rows, values=values)))
    (error,) = spoilt.gross_errors()
    assert error.text == "they look like feet instead of metres" and "from Badger" in error.what
