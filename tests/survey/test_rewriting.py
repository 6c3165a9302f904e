"""Networks as they would be without a mistake of many values: what is changed in them, and how."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from polar_network import network

from obseq.survey.causes.notes import Notes
from obseq.survey.causes.other_system import other_system
from obseq.survey.causes.rewriting import REWRITINGS, of_all_values, rewritten
from obseq.survey.causes.scopes import SIGHT
from obseq.survey.causes.set_ups import TARGET
from obseq.survey.causes.values import _share_of_slips, explain, variants
from obseq.survey.kinds.registry import BY_CODE, codes_where

ZENITH = np.radians([85.0, 92.0, 97.5])
FALSE, TRUE = np.zeros(3, bool), np.ones(3, bool)


def notes_of(net):
    return Notes(net.points, net.book)


def test_values_are_put_right_as_the_mistake_made_them_wrong():
    right = {(one.code, one.slip): [] for one in REWRITINGS}
    for one in REWRITINGS:
        right[one.code, one.slip].append(one.right)
    degrees = np.degrees(ZENITH)
    np.testing.assert_allclose(right["S200", "W100"][0](degrees * math.pi / 200.0, FALSE), ZENITH)
    np.testing.assert_allclose(right["S200", "W101"][0](np.radians(degrees / 0.9), FALSE), ZENITH)
    np.testing.assert_allclose(right["S201", "W103"][0](math.pi / 2.0 - ZENITH, TRUE), ZENITH)
    as_gon = (90.0 - degrees) * math.pi / 200.0
    np.testing.assert_allclose(right["S201", "W132"][0](as_gon, TRUE), ZENITH)
    np.testing.assert_allclose(right["S201", "W132"][0](degrees * math.pi / 200.0, FALSE), ZENITH)
    for of_sense in right["S202", "W131"] + right["S201", "W102"]:
        np.testing.assert_allclose(of_sense(2.0 * math.pi - ZENITH, FALSE), ZENITH)
        np.testing.assert_allclose(of_sense(-ZENITH, FALSE), ZENITH)
    lengths = np.array([12.5, 830.0])
    for code in ("S203", "S204"):
        np.testing.assert_allclose(right[code, "W126"][0](1000.0 * lengths, FALSE), lengths)
        np.testing.assert_allclose(right[code, "W106"][0](lengths / 0.3048, FALSE), lengths)
    np.testing.assert_allclose(right["S203", "W107"][0](0.3048 * lengths, FALSE), lengths)


def test_all_values_of_a_kind_are_written_anew_and_no_others():
    notes = notes_of(network())
    found = list(of_all_values(notes))
    assert Counter(one.slip for one in found)["W126"] == 2
    before = notes.book.observations.values
    kinds = np.array([BY_CODE[int(code)].name for code in notes.book.observations.types])
    takes = {"distances": {"Dist"}, "height differences": {"DH"}, "angles": {"Hz", "Zen"}}
    for one in found:
        changed = np.flatnonzero(one.book.observations.values != before)
        assert set(changed.tolist()) <= set(one.rows.tolist()) and one.count == len(one.rows)
        of = takes.get(one.what.partition(",")[0].removeprefix("unit of "))
        if of is not None:
            assert set(kinds[one.rows]) == of and len(changed) == len(one.rows)
            assert len(one.rows) == np.isin(kinds, list(of)).sum()
        assert f"{len(one.rows)} observations" in one.what and ", all, " in one.what


def test_where_nothing_says_how_large_a_network_is_no_unit_is_changed():
    codes = {known: {one.code for one in of_all_values(notes_of(network(known)))} for known in ("A", "AB")}
    assert {"S203", "S204"} <= codes["AB"] and not {"S203", "S204"} & codes["A"]


def rewritings(off_rows=(), known="ABCD"):
    """All rewritings, in their parts; off_rows contradict, and points about them."""
    net = network(known)
    notes = notes_of(net)
    off = np.zeros(len(net.book.observations))
    off[list(off_rows)] = 1.0
    off_points = net.book.counts(off > 0.0, len(net.points))
    return notes, [list(part) for part in rewritten(notes, net.point_system, off, off_points)]


def test_parts_go_from_all_values_to_single_points():
    notes, (outside, inside, system, some, points) = rewritings()
    assert {one.code for one in outside} == {"S202", "S203", "S204", "S210", "S211", "S212"}
    assert {one.code for one in inside} == {"S200", "S201", "S202", "S205"}
    assert [one.code for one in system] == ["S213"] and some == []
    assert Counter(one.code for one in points) == {"S111": 4, "S112": 4, "S113": 6}
    given = notes.points.coordinates
    by_slip = {(one.code, one.slip): one.points.coordinates for one in outside}
    np.testing.assert_allclose(by_slip["S210", "W123"][:4], given[:4, [1, 0, 2]])
    np.testing.assert_allclose(by_slip["S211", "W106"][:4], given[:4] * [1.0, 1.0, 0.3048])
    np.testing.assert_allclose(by_slip["S211", "W107"][:4], given[:4] / [1.0, 1.0, 0.3048])
    np.testing.assert_allclose(by_slip["S212", "W106"][:4], given[:4] * 0.3048)
    np.testing.assert_allclose(by_slip["S212", "W126"][:4], given[:4] / 1000.0)
    (slopes,) = [one for one in inside if one.code == "S205"]
    kinds = [BY_CODE[int(code)].name for code in slopes.book.observations.types[slopes.rows]]
    assert set(kinds) == {"DistHz"} and len(slopes.rows) == notes.is_slope.sum()


def test_single_points_are_exchanged_with_each_other_in_themselves_or_unknown():
    notes, parts = rewritings(known="ABC")
    given = notes.points.coordinates
    for one in parts[-1]:
        (changed,) = [
            np.flatnonzero((one.points.coordinates != given).any(axis=1) & np.isfinite(given[:, 0]))
        ]
        assert sorted(changed.tolist()) == sorted(one.known.tolist()) and one.count == 3 * len(one.known)
        own = one.points.coordinates[one.known]
        if one.code == "S111":
            np.testing.assert_allclose(own, given[one.known][:, [1, 0, 2]])
        elif one.code == "S112":
            assert np.isnan(own).all() and one.points.is_free[one.known].all()
        else:
            np.testing.assert_allclose(own, given[one.known][::-1])
    assert not [one for one in rewritings(known="AB")[1][-1] if one.code == "S112"]  # nothing would be left


def test_values_of_one_station_are_written_anew_where_most_of_them_are_off():
    from_b = [row for row in range(16, 32) if row % 4 == 2]  # its slope distances
    _, parts = rewritings(off_rows=from_b)
    assert {one.code for one in parts[3]} == {"S203"} and len(parts[3]) == 3
    assert all(one.rows.tolist() == from_b and "from B" in one.what for one in parts[3])
    assert rewritings(off_rows=from_b[:3])[1][3] != []
    assert rewritings(off_rows=from_b[:2])[1][3] == []  # half of them


def test_points_of_another_system_are_unknown_but_for_neighbours_in_the_middle():
    net = network()
    (one,) = other_system(notes_of(net), np.arange(4))
    held = np.flatnonzero(np.isfinite(one.points.coordinates[:4]).all(axis=1))
    assert len(held) == 2 and one.known.tolist() == [0, 1, 2, 3] and one.points.is_free[4].all()
    apart = np.linalg.norm(np.diff(net.points.coordinates[held], axis=0))
    others = np.linalg.norm(net.points.coordinates[:4] - net.points.coordinates[held[0]], axis=1)
    assert apart <= np.sort(np.round(others, 6))[2]
    assert list(other_system(notes_of(network("ABC")), np.arange(3))) == []
    shifted = np.add(net.points.coordinates, [10.0, 0.0, 0.0])
    assert one.told(shifted) is None  # as they were, but for a shift
    cosine, sine = math.cos(math.radians(3.0)), math.sin(math.radians(3.0))
    turn = 1.0002 * np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    assert "turned by 3 degrees and +200 ppm" in one.told(net.points.coordinates @ turn.T)


def test_what_a_slip_of_the_pen_would_explain_by_chance_is_its_share_of_such_errors():
    tried = [11.0, 9.5, 12.0, 10.4, 12.1, 8.0]  # three of an error between half and twice of 1, and two on it
    assert _share_of_slips(tried, 10.0, 11.0, 0.01) == pytest.approx(4 * 2.0 * 0.01 / 3.0)
    assert _share_of_slips(tried, 10.0, 11.0, 10.0) == 1.0


def test_a_digit_explains_by_chance_as_much_as_all_ways_of_it_cover():
    (code,) = codes_where(lambda kind: kind.name == "Dist")
    kind = BY_CODE[code]
    told = explain(kind, 345.67, 325.67, 0.004)
    tried = list(variants(345.67, 4, 0.004))
    assert told is not None and told.code == "W109"
    ways = sum(text == told.text for text, _ in tried) * len({text for text, _ in tried})
    share = _share_of_slips([right for _, right in tried], 345.67, 325.67, 0.004)
    by_chance = min(len(tried), ways) * 2.0 * 0.004 / (2.0 * 345.67)
    assert told.chance == pytest.approx(max(share, by_chance), rel=0.2)
    assert explain(kind, 345.67, 325.67, 0.008).chance == pytest.approx(2.0 * told.chance, rel=0.1)


def test_distances_that_are_switched_off_stay_what_they_are():
    net = network()
    rows = net.book.observations
    active = np.arange(len(rows)) != 2
    off = replace(net, book=replace(net.book, observations=replace(rows, active=active)))
    found = rewritten(notes_of(off), net.point_system, np.zeros(len(rows)), np.zeros(5, int))
    (slopes,) = [one for part in found for one in part if one.code == "S205"]
    assert (
        2 not in slopes.rows and slopes.book.observations.types[2] == rows.types[2] and len(slopes.rows) == 19
    )


def test_names_of_targets_may_be_wrong_in_every_set_up():
    notes = notes_of(network())
    groups = [group for group in TARGET.where(notes, notes.book.observations.active) if group.scope is SIGHT]
    (sights,) = groups
    origins = {int(notes.book.observations.from_points[sights.of(k)[0]]) for k in range(len(sights))}
    assert origins == set(range(5))


@pytest.mark.parametrize(("written", "code"), [(2.5, "W103"), (-7.3, "W103")])
def test_an_elevation_in_degrees_is_told_from_one_in_gon(written, code):
    (zenith,) = codes_where(lambda kind: kind.name == "Zen")
    gon, degree = math.pi / 200.0, math.pi / 180.0
    kind = BY_CODE[zenith]
    assert explain(kind, written * gon, math.pi / 2.0 - written * gon, 1e-5).code == code
    assert explain(kind, written * gon, math.pi / 2.0 - written * degree, 1e-5).code == "W132"


def test_degrees_minutes_and_seconds_that_were_read_as_gon_are_told():
    (direction,) = codes_where(lambda kind: kind.name == "Hz")
    right = math.radians(123.0 + 47.0 / 60.0 + 38.0 / 3600.0)
    found = explain(BY_CODE[direction], 123.4738 * math.pi / 200.0, right, 1e-6)
    assert found is not None and found.code == "W111"
