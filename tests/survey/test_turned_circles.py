"""A circle that was turned within a set-up, with other errors beside it."""

import pytest
from set_ups import free_stations, resection

from obseq.survey.screening.findings import Cause

TURN = 37.1234


def turn(site, origin, *targets):
    return site.change(
        lambda line: {"value": (line.value + TURN) % 400.0}, "57", origin=(origin,), target=targets
    )


def test_directions_that_only_place_their_target_say_nothing_of_it(tmp_path):
    site = resection()
    turn(site, "P", "K4", "K5", "N1", "N2")
    ((error, _),) = site.errors(tmp_path)
    assert error.cause is Cause.NEW_SETUP and "set-up of P, from Hz P -> K4" in error.what
    assert "the 4 directions from there on are all turned by 37.1" in error.text
    assert "against the 3 before" in error.text


@pytest.mark.parametrize(
    ("codes", "origin", "target", "off"),
    [("3", "F1", "C2", 9.0), ("5", "F2", "C1", 5.5)],
    ids=["a distance elsewhere", "a direction of the same set-up"],
)
def test_one_other_error(codes, origin, target, off, tmp_path):
    site = free_stations(("F1", "F2"))
    turned = turn(site, "F2", "C3", "E0", "E1", "E2")
    (other,) = site.change(
        lambda line: {"value": line.value + off}, codes, origin=(origin,), target=(target,)
    )
    found = site.errors(tmp_path)
    (circle,) = [lines for error, lines in found if error.cause is Cause.NEW_SETUP]
    (single,) = [lines for error, lines in found if error.cause is not Cause.NEW_SETUP]
    assert circle == turned and single == {other}
