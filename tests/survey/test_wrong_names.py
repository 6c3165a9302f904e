"""Names of targets and set-ups that are wrong: each is planted in a good network, and is one finding."""

from dataclasses import replace

import pytest
from plane_site import PlaneSite
from set_ups import free_stations, resection, traverse

from obseq.survey.screening.findings import Cause

SITES = {"free stations": free_stations, "traverse": traverse, "resection": resection}


@pytest.mark.parametrize("site", SITES.values(), ids=SITES)
def test_honest_networks_raise_no_alarm(site, tmp_path):
    assert site().errors(tmp_path) == []


TARGETS = (
    ("free stations", "F3", "C2", "F2"),  # a set-up of F2 that stands where it should is not to be blamed
    ("free stations", "F1", "E1", "C3"),
    ("traverse", "T2", "T3", "T5"),
    ("traverse", "T3", "T4", "T2"),  # which it sees as well
    ("traverse", "B", "T1", "C"),
)


@pytest.mark.parametrize(("site", "origin", "right", "written"), TARGETS)
def test_a_target_under_another_name(site, origin, right, written, tmp_path):
    made = SITES[site]()
    lines = made.change(lambda line: {"target": written}, origin=(origin,), target=(right,))
    ((error, told),) = made.errors(tmp_path)
    assert error.cause is Cause.WRONG_POINT and told == lines and error.points == (written, right)
    assert error.text == f"they fit {right}, not {written}: the name of the target is wrong"


EXCHANGED = (
    ("free stations", "F2", "C3", "E0"),
    ("free stations", "F1", "E1", "E2"),
    ("traverse", "T3", "T2", "T4"),
    ("traverse", "B", "A", "T1"),
    ("resection", "P", "K3", "N1"),  # N1, which nothing else sees, is then put on K3
)


@pytest.mark.parametrize(("site", "origin", "one", "other"), EXCHANGED)
def test_two_targets_under_each_others_names(site, origin, one, other, tmp_path):
    made = SITES[site]()
    lines = made.exchange(one, other, origin=(origin,))
    ((error, told),) = made.errors(tmp_path)
    assert error.cause is Cause.SWAPPED_NAMES and told == lines
    assert set(error.points) == {one, other} and "of these targets are exchanged" in error.text


def test_two_known_points_that_one_set_up_sees_may_be_exchanged_in_either_file(tmp_path):
    made = resection()
    made.exchange("K1", "K3", origin=("P",))
    ((error, _),) = made.errors(tmp_path)
    assert "the names K1 and K3 of these targets are exchanged" in error.text
    assert "the coordinates of these two points are exchanged" in error.text
    assert error.text.endswith("nothing tells these apart")


@pytest.mark.parametrize(("site", "right", "written"), [
    ("traverse", "T3", "A"), ("traverse", "T5", "D"), ("traverse", "B", "D"),
    ("free stations", "F1", "F3"),  # which has approximate coordinates, and no observation under its own name
])  # fmt: skip
def test_a_set_up_under_the_name_of_another_station(site, right, written, tmp_path):
    made = SITES[site]()
    lines = made.change(lambda line: {"origin": written}, origin=(right,))
    ((error, told),) = made.errors(tmp_path)
    assert error.cause is Cause.WRONG_POINT and told == lines and error.points == (written, right)
    assert error.text == f"they fit {right}, not {written}: the name of the station is wrong"


def called(site, origin, right, written):
    """One target of a set-up, as backsight too, under another name."""

    def name(point):
        return written if point == right else point

    site.change(
        lambda row: replace(row, target=name(row.target), backsight=name(row.backsight)), origin=origin
    )


@pytest.mark.parametrize("written", ["M33", "M00"])
def test_a_backsight_of_angles_under_another_name(written):
    """All angles of the set-up name it, and its distance; M00 is seen from there as well."""
    site = PlaneSite(4, 4, with_angles=True)
    right = next(row.backsight for row in site.rows if row.origin == "M10" and row.backsight)
    called(site, "M10", right, written)
    site.rows = [row for row in site.rows if row.target != row.backsight]
    assert right not in ("M00", "M33")
    (error,) = site.network().gross_errors()
    assert error.text.endswith(f"fits {right}, not {written}: the name of the target is wrong")


def test_a_wrong_name_beside_a_distance_that_is_wrong():
    site = PlaneSite()
    called(site, "M00", "M11", "M22")
    k = next(k for k, row in enumerate(site.rows) if (row.type, row.origin) == ("DistHz", "M21"))
    site.rows[k] = replace(site.rows[k], value=site.rows[k].value / 0.3048)
    found = site.network().gross_errors()
    assert {error.cause for error in found} == {Cause.WRONG_POINT, Cause.UNITS}
    assert [error.rows for error in found if error.cause is Cause.UNITS] == [(k,)]
