"""Relations of first values and their derivatives: they say what the formulas of the observations say."""

import numpy as np
import pytest

from obseq.formulas.topography import TopoDist, TopoDistHz, TopoDX, TopoDY, TopoDZ, TopoHz, TopoZen
from obseq.geometry import exponential, rotation_z
from obseq.survey.initial.known import Known, as_matrix
from obseq.survey.initial.relations import Measured, Relation, gradient, misfit

POINT, OTHER, G0 = (101.0, 207.0, 13.0), (95.0, 203.0, 18.5), 0.7
STATION = {
    Measured.AZIMUTH: TopoHz(),
    Measured.READING_AT: TopoHz(),
    Measured.ZENITH: TopoZen(),
    Measured.ZENITH_AT: TopoZen(),
    Measured.RISE: TopoDZ(),
    Measured.RISE_AT: TopoDZ(),
    Measured.EAST: TopoDX(),
    Measured.NORTH: TopoDY(),
}
AT_THE_POINT = (Measured.READING_AT, Measured.ZENITH_AT, Measured.HORIZONTAL_AT, Measured.RISE_AT)
"""Of what is measured at the point looked for; the others are measured at the known one."""


@pytest.fixture(params=["plane", "tilted verticals"])
def verticals(request):
    """(3, 3) rotations from the frame to east, north, up: at the known point, and at the point."""
    if request.param == "plane":
        return np.eye(3), np.eye(3)
    return exponential([0.01, -0.02, 0.3]), exponential([-0.03, 0.01, 0.2])


@pytest.fixture
def known(verticals):
    """One point with a position, among two."""
    found = Known(["other", "point"], 1, lambda points: np.repeat(verticals[:1], len(points), axis=0))
    found.positions[0], found.has_height[0] = OTHER, 1
    found.settle([0])
    return found


@pytest.mark.parametrize("kind", STATION, ids=lambda kind: kind.name)
def test_measures_of_a_plumb_instrument(kind, known, verticals):
    # The instrument stands plumb at one end, its y axis at the azimuth G0: instrument to frame is V' Rz(-G0).
    relation = Relation(kind, 0, 0.123, (0,))
    at_point = kind in AT_THE_POINT
    origin, target = (POINT, OTHER) if at_point else (OTHER, POINT)
    zero = G0 if kind == Measured.READING_AT else 0.0
    matrix = verticals[at_point].T @ rotation_z(-zero)
    formula = STATION[kind]
    no_refraction = (0.0,) * (len(formula.observations) - 10)
    values = (*matrix.ravel(), *no_refraction, 0.123)
    (expected,) = formula.evaluate((*origin, 0, 0, 0, *target), values)
    found = misfit(known, relation, POINT, as_matrix(verticals[1]), G0)
    assert found == pytest.approx(expected, abs=1e-12)


def test_slope_distances(known, verticals):
    (expected,) = TopoDist().evaluate((*OTHER, *POINT), (4.5,))
    found = misfit(known, Relation(Measured.DISTANCE, 0, 4.5, (0,)), POINT, as_matrix(verticals[1]), 0.0)
    assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("kind", [Measured.HORIZONTAL, Measured.HORIZONTAL_AT], ids=lambda kind: kind.name)
def test_horizontal_lengths(kind, known, verticals):
    at_point = kind in AT_THE_POINT
    origin, target = (POINT, OTHER) if at_point else (OTHER, POINT)
    (expected,) = TopoDistHz().evaluate((*origin, *target), (*verticals[at_point][2], 4.5))
    found = misfit(known, Relation(kind, 0, 4.5, (0,)), POINT, as_matrix(verticals[1]), 0.0)
    assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("lift", [0.0, 1.5])
@pytest.mark.parametrize("kind", Measured, ids=lambda kind: kind.name)
def test_derivatives_are_those_of_the_misfits(kind, lift, known, verticals):
    relation, vertical, step = Relation(kind, 0, 0.123, (0,), lift=lift), as_matrix(verticals[1]), 1e-3

    def at(offset):
        return misfit(known, relation, tuple(np.add(POINT, offset)), vertical, G0)

    # central differences of the sixth order
    weights = {1: 45.0, 2: -9.0, 3: 1.0}
    expected = [
        sum(w * (at(k * step * axis) - at(-k * step * axis)) for k, w in weights.items()) / (60.0 * step)
        for axis in np.eye(3)
    ]
    found = gradient(known, relation, POINT, vertical)
    np.testing.assert_allclose(found, verticals[1] @ expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", Measured, ids=lambda kind: kind.name)
def test_derivatives_are_finite_where_one_point_is_above_the_other(kind, known, verticals):
    above = tuple(np.add(OTHER, 5.0 * verticals[0][2]))
    assert np.isfinite(gradient(known, Relation(kind, 0, 0.123, (0,)), above, as_matrix(verticals[0]))).all()
