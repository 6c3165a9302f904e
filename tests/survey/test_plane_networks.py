"""Slips in networks of the plane: what a set-up or all distances share is named as one cause."""

from dataclasses import replace

import pytest
from plane_site import PlaneSite

from obseq.survey import estimating
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
        (lambda v: v - 0.1344, "a constant added to all of them fits (0.134"),
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
