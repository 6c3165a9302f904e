"""What errors of one unit do to observations: each is the difference that moving the sight makes."""

from types import SimpleNamespace

import numpy as np
import pytest

from obseq.survey.causes.effects import Effects
from obseq.survey.causes.known_points import KNOWN_BOWL, KNOWN_HEIGHTS, KNOWN_SCALE, KNOWN_TURN

KINDS = {
    "is_direction": lambda v: np.arctan2(v[:, 0], v[:, 1]),
    "is_zenith": lambda v: np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2]),
    "is_slope": lambda v: np.linalg.norm(v, axis=1),
    "is_flat": lambda v: np.hypot(v[:, 0], v[:, 1]),
    "is_rise": lambda v: v[:, 2],
}
STEP = 1e-5
UPRIGHT = np.eye(3)


def effects_of(kind, horizon=UPRIGHT):
    """Sights of one kind from a point whose horizon may be turned."""
    local = np.random.default_rng(2).uniform(-80.0, 80.0, (9, 3))
    flags = {name: np.full(9, name == kind) for name in KINDS}
    flags["is_length"] = flags["is_slope"] | flags.pop("is_flat")
    return local, Effects(
        SimpleNamespace(**flags),
        np.zeros((1, 3)),
        local @ horizon,
        np.zeros(9, np.int64),
        horizon[None],
        np.full((9, 3), np.nan),
    )


def turned():
    return np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


@pytest.mark.parametrize("horizon", [UPRIGHT, turned()], ids=["upright", "turned"])
@pytest.mark.parametrize("kind", ["is_direction", "is_zenith", "is_slope", "is_flat"])
def test_an_instrument_beside_its_point_changes_readings_as_the_sight_changes(kind, horizon):
    local, effects = effects_of(kind, horizon)
    for axis in (0, 1):
        step = STEP * np.eye(3)[axis]
        wanted = (KINDS[kind](local + step) - KINDS[kind](local - step)) / (2.0 * STEP)
        np.testing.assert_allclose(effects.off_centre[:, axis], wanted, atol=1e-8)


@pytest.mark.parametrize("horizon", [UPRIGHT, turned()], ids=["upright", "turned"])
@pytest.mark.parametrize("kind", ["is_zenith", "is_slope", "is_rise", "is_direction"])
def test_a_height_of_a_target_changes_readings_as_the_sight_changes(kind, horizon):
    local, effects = effects_of(kind, horizon)
    step = [0.0, 0.0, STEP]
    wanted = (KINDS[kind](local + step) - KINDS[kind](local - step)) / (2.0 * STEP)
    np.testing.assert_allclose(effects.raised, wanted, atol=1e-8)


def test_sights_of_no_length_or_of_points_without_a_place_have_finite_effects():
    for vector in ([0.0, 0.0, 0.0], [np.nan] * 3):
        _, effects = effects_of("is_slope")
        effects.vectors[0] = vector
        assert np.isfinite(effects.off_centre).all() and np.isfinite(effects.raised).all()
        assert effects.lengths[0] == 1e-3 and effects.raised[0] == 0.0


def test_constants_and_scales_make_readings_too_large_and_computed_minus_observed_too_small():
    _, effects = effects_of("is_slope")
    effects.notes.book = SimpleNamespace(observations=SimpleNamespace(values=np.arange(1.0, 10.0)))
    assert (effects.ones == -1.0).all() and len(effects.ones) == 9
    assert effects.values.tolist() == [-float(k) for k in range(1, 10)]


def test_the_end_of_a_vector_moves_its_components_and_nothing_else():
    _, effects = effects_of("is_slope")
    effects.axes[:3] = np.eye(3)  # a vector in its own axes: east, north, up
    assert effects.beside[:3].tolist() == [[-1, 0], [0, -1], [0, 0]] and not effects.beside[3:].any()
    assert effects.upward[:3].tolist() == [0, 0, -1] and not effects.upward[3:].any()


PLACES = np.array([[300.0, -200.0, 50.0], [-100.0, 400.0, 20.0]])
"""East, north and up of two known points from the middle of all."""


def known(cause, curvature=1.6e-7):
    """(p, 3, q) what a cause adds to each coordinate of the points."""
    each = [cause.effect(PLACES, np.full(2, component), curvature) for component in range(3)]
    return np.stack(each, axis=1)


def test_known_points_that_are_turned_or_too_large_move_in_plan_as_a_map_does():
    larger, turned = known(KNOWN_TURN).transpose(2, 0, 1)[:, :, :2]
    np.testing.assert_allclose(larger, PLACES[:, :2])
    np.testing.assert_allclose(known(KNOWN_SCALE)[:, :2, 0], PLACES[:, :2])
    angle = 1e-6  # clockwise
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    np.testing.assert_allclose(turned, (PLACES[:, :2] @ turn.T - PLACES[:, :2]) / angle, atol=1e-3)


def test_known_heights_rise_by_a_slope_or_a_bowl_told_for_a_kilometre():
    _, east, north = known(KNOWN_HEIGHTS)[:, 2].T
    np.testing.assert_allclose([east, north], 1e-3 * PLACES[:, :2].T)
    assert not known(KNOWN_HEIGHTS)[:, :2, 1:].any()
    np.testing.assert_allclose(known(KNOWN_HEIGHTS)[:, :2, 0], 1.6e-7 * PLACES[:, :2])
    assert not known(KNOWN_HEIGHTS)[:, 2, 0].any()
    bowl, east, north = known(KNOWN_BOWL)[:, 2].T
    np.testing.assert_allclose(bowl, np.square(np.linalg.norm(PLACES[:, :2], axis=1) / 1000.0))
    np.testing.assert_allclose([east, north], 1e-3 * PLACES[:, :2].T)
