"""Readings fit another point than the one that is noted: on the plain, and where the vertical leans."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from obseq.diagnosis.protocol import Change
from obseq.report.tables.units import METRIC
from obseq.survey.causes import slips
from obseq.survey.causes.catalogue import ROW
from obseq.survey.causes.effects import Effects
from obseq.survey.causes.other_points import other_backsights, other_standpoint, other_target, readings_to
from obseq.survey.kinds.registry import codes_where

PLACES = np.random.default_rng(8).uniform([-300, -300, -20], [300, 300, 20], (8, 3))
NAMES = ("Hz", "Zen", "Dist")
CODES = [codes_where(lambda kind, name=name: kind.name == name)[0] for name in NAMES]
LEANING = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
HORIZONS = {"upright": np.eye(3), "leaning": LEANING * np.linalg.det(LEANING)}
RAISED, OWN = 1.8, 1.5
TURN = 5.9
"""The circle of the set-up: readings pass its zero."""


def sight(origin, target, horizon):
    """Direction, zenith angle and slope distance, heights of prism and instrument included."""
    east, north, up = horizon @ (PLACES[target] - PLACES[origin]) + [0.0, 0.0, RAISED - OWN]
    flat = math.hypot(east, north)
    return [(math.atan2(east, north) + TURN) % math.tau, math.atan2(flat, up), math.hypot(flat, up)]


def set_up(origin, targets, horizon, seen_from=None, seen=None):
    """All readings of a set-up; those that are written, and those that its points should have given."""
    n = 3 * len(targets)
    written = [
        sight(origin if seen_from is None else seen_from, seen or target, horizon) for target in targets
    ]
    right = [sight(origin, target, horizon) for target in targets]
    types = np.array(CODES * len(targets))
    rows = SimpleNamespace(
        values=np.concatenate(written),
        types=types,
        from_points=np.full(n, origin),
        to_points=np.repeat(targets, 3),
        backsights=np.full(n, -1),
        from_heights=np.full(n, OWN),
        to_heights=np.full(n, RAISED),
    )
    flags = {name: np.arange(n) % 3 == k for k, name in enumerate(("is_direction", "is_zenith", "is_slope"))}
    notes = SimpleNamespace(book=SimpleNamespace(observations=rows), is_between=np.zeros(n, bool), **flags)
    horizons = np.tile(horizon, (len(PLACES), 1, 1))
    effects = Effects(notes, PLACES, np.zeros((n, 3)), rows.from_points, horizons, np.zeros((n, 3)))
    return effects, np.concatenate(right)


horizons = pytest.mark.parametrize("horizon", HORIZONS.values(), ids=HORIZONS)


@horizons
def test_a_reading_to_each_point_is_what_the_instrument_would_have_shown(horizon):
    effects, right = set_up(0, [3], horizon)
    for row in range(3):
        found = readings_to(effects, right, row)
        assert np.isnan(found[[0, 3]]).all()
        for point in (1, 2, 4, 5, 6, 7):
            off = found[point] - sight(0, point, horizon)[row]
            assert (math.remainder(off, math.tau) if row == 0 else off) == pytest.approx(0.0, abs=1e-9)


@horizons
def test_an_angle_from_each_point_is_what_it_would_have_been(horizon):
    effects, _ = set_up(0, [3], horizon)
    rows, notes = effects.notes.book.observations, effects.notes
    assert np.isnan(other_backsights(effects, np.zeros(3), 0)).all()
    notes.is_between[0], notes.is_direction[0] = True, False
    rows.backsights[0] = 5
    right = np.array([sight(0, 3, horizon)[0] - sight(0, 5, horizon)[0], 0.0, 0.0])
    found = other_backsights(effects, right, 0)
    assert np.isnan(found[[0, 5]]).all()
    for point in (1, 2, 4, 6, 7):
        wanted = sight(0, 3, horizon)[0] - sight(0, point, horizon)[0]
        assert math.remainder(found[point] - wanted, math.tau) == pytest.approx(0.0, abs=1e-9)
    rows.backsights[0] = 9
    assert np.isnan(other_backsights(effects, right, 0)).all()


SIGMAS = np.array([1e-5, 1e-5, 2e-3])


@horizons
def test_a_target_is_another_where_all_that_was_read_to_it_fits_that_one(horizon):
    effects, right = set_up(0, [3], horizon, seen=6)
    rows = np.arange(3)
    assert other_target(effects, right, rows, SIGMAS) == 6
    assert other_target(effects, right, rows[1:], SIGMAS[1:]) == 6
    assert other_target(effects, right, rows[:1], SIGMAS[:1]) is None  # one direction fits many points
    assert other_target(effects, right, rows[2:], SIGMAS[2:]) is None
    effects.notes.book.observations.values[2] += 0.05  # its prism has another height, within two centimetres
    assert other_target(effects, right, rows, SIGMAS) == 6
    effects.notes.book.observations.values[2] += 0.05
    assert other_target(effects, right, rows, SIGMAS) is None
    assert other_target(*set_up(0, [3], horizon), rows, SIGMAS) is None


@horizons
def test_an_instrument_stood_on_another_point_where_all_that_was_read_fits_that_one(horizon):
    targets = [1, 3, 4, 6]
    effects, _ = set_up(0, targets, horizon, seen_from=5)
    rows, sigmas = np.arange(12), np.tile(SIGMAS, 4)
    assert other_standpoint(effects, rows, sigmas) == 5
    values = effects.notes.book.observations.values
    values[5] += 0.05
    assert other_standpoint(effects, rows, sigmas) == 5
    values[5] += 0.05
    assert other_standpoint(effects, rows, sigmas) is None
    values[5] -= 0.1
    for wrong in (0, 4):  # a direction, a zenith angle
        values[wrong] += 0.01
        assert other_standpoint(effects, rows, sigmas) is None
        values[wrong] -= 0.01
    lost, _ = set_up(0, targets, horizon, seen_from=5)
    lost.notes.book.observations.to_points[:3] = 8  # of a point without a place
    assert other_standpoint(lost, rows, sigmas) is None
    assert other_standpoint(set_up(0, targets, horizon)[0], rows, sigmas) is None


def read(changes, sigma=1e-5, row=None):
    """Slips of the first reading that was changed, in a set-up of three targets with all else right."""
    effects, right = set_up(0, [1, 3, 4], HORIZONS["leaning"])
    rows, book = effects.notes.book.observations, effects.notes.book
    rows.stations, rows.active = np.zeros(9, int), np.ones(9, bool)
    book.point_names, book.label = "ABCDEFGH", "row {}".format
    up = HORIZONS["leaning"][2]
    effects.vectors[:] = PLACES[rows.to_points] - PLACES[0] + (RAISED - OWN) * up
    for at, value in changes.items():
        rows.values[at] = value
    evidence = slips.Evidence(effects, right, METRIC, None)
    own = SimpleNamespace(code=ROW, rows=np.array([next(iter(changes)) if row is None else row]))
    found = slips.slips_of(own, Change(0, np.zeros(1), np.array([sigma])), evidence)
    return [(one.code, one.text) for one in found if one.code in ("W108", "W112", "W113")]


def test_a_reading_to_another_point_is_told_with_its_name():
    seen = sight(0, 6, HORIZONS["leaning"])
    assert read({3: seen[0]}) == [("W112", "read to G")]
    assert read({4: seen[1]}) == [("W112", "read to G")]
    assert read({5: seen[2]}, 0.005) == [("W112", "read to G")]
    assert read({5: seen[2]}, 0.5) == []  # so near to one of all points is any length
    assert read({3: seen[0] + 4e-5}) == []
    assert read({3: sight(0, 3, HORIZONS["leaning"])[0] + 5e-5}) == []  # noise


def test_two_readings_of_one_kind_and_set_up_are_exchanged():
    one, other = (sight(0, target, HORIZONS["leaning"]) for target in (1, 4))
    assert read({0: other[0], 6: one[0]}) == [("W113", "exchanged with row 6")]
    assert read({6: one[0], 0: other[0]}) == [("W113", "exchanged with row 0")]
    assert read({2: other[2], 8: one[2]}, 0.005) == [("W113", "exchanged with row 8")]
    assert read({0: other[0], 6: one[0] + 1e-3}) == [("W112", "read to E")]


def test_a_horizontal_distance_in_place_of_the_slope_distance_is_told():
    east, north, _ = HORIZONS["leaning"] @ (PLACES[3] - PLACES[0])
    flat = math.hypot(east, north)
    assert sight(0, 3, HORIZONS["leaning"])[2] - flat > 1.0
    assert read({5: flat}, 0.002) == [("W108", "the horizontal distance in place of the slope distance")]
    assert read({5: flat + 0.007}, 0.002) == []
