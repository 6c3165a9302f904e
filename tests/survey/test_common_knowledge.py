"""What two epochs were given alike counts once, whatever is shown and wherever free coordinates start."""

from dataclasses import replace

import numpy as np
import pytest
from outside import OutsideData
from planned import NAMES, network

from obseq.errors import InputError
from obseq.survey import Network, compare
from obseq.survey.epochs.known_points import common, given
from obseq.survey.planning.simulation import Simulation
from obseq.survey.points import CoordinateCovariance

STEP = 1e-4


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    return network(tmp_path_factory.mktemp("planned"), sigma=0.02)


def pair(planned, change=None):
    """Two epochs; the second may be given other points."""
    rng, simulation = np.random.default_rng(4), Simulation(planned)
    first, second = simulation.drawn(rng), simulation.drawn(rng)
    points = planned.points if change is None else change(planned.points)
    return replace(first, points=planned.points), replace(second, points=points)


def with_covariance(points):
    """The known points with a full covariance of their plan, their heights with sigmas."""
    plan = tuple((name, axis) for name in ("K1", "K2") for axis in (0, 1))
    factor = 0.01 * np.tril(1.0 + np.arange(16.0).reshape(4, 4) / 8.0)
    return replace(points, covariance=CoordinateCovariance(plan, factor @ factor.T))


def moved_by(network, component):
    """(3 n,) what a change of a given coordinate moves the adjusted points by, per metre."""
    places = []
    for sign in (1.0, -1.0):
        coordinates = network.points.coordinates.copy()
        coordinates[network.points.index[component[0]], component[1]] += sign * STEP
        moved = replace(network, points=replace(network.points, coordinates=coordinates))
        places.append(moved.adjust().points.coordinates.ravel())
    return (places[0] - places[1]) / (2.0 * STEP)


@pytest.mark.parametrize("is_correlated", [False, True])
def test_the_covariance_between_epochs_is_what_common_errors_do_to_both(planned, is_correlated):
    if is_correlated:
        planned = replace(planned, points=with_covariance(planned.points))
    first, second = pair(planned)
    known = [(name, axis) for name in ("K1", "K2") for axis in range(3)]
    gains = [np.column_stack([moved_by(epoch, one) for one in known]) for epoch in (first, second)]
    covariance = 0.02**2 * np.eye(6)
    if is_correlated:
        plan = [0, 1, 3, 4]
        covariance[np.ix_(plan, plan)] = planned.points.covariance.matrix
    expected = gains[0] @ covariance @ gains[1].T
    found = common(*(given(epoch.adjust(), NAMES) for epoch in (first, second)))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-4 * np.abs(expected).max())


def without_an_abscissa(points):
    """K2 with a free x: the others of its coordinates are known."""
    sigmas = points.sigmas.copy()
    sigmas[points.index["K2"], 0] = np.nan
    return replace(points, sigmas=sigmas)


def started_elsewhere(points):
    coordinates = points.coordinates.copy()
    coordinates[points.index["K2"], 0] += 0.004
    return replace(points, coordinates=coordinates)


def test_free_starting_values_of_known_points_change_nothing(planned):
    planned = replace(planned, points=without_an_abscissa(planned.points))
    one, other = (
        compare(*(epoch.adjust() for epoch in pair(planned, change))) for change in (None, started_elsewhere)
    )
    np.testing.assert_allclose(
        one.displacements.cofactors, other.displacements.cofactors, rtol=0.0, atol=1e-12
    )
    assert one.congruence.freedom == other.congruence.freedom


def lifted(points):
    coordinates = points.coordinates.copy()
    coordinates[points.index["A"]] += (0.05, 0.0, 0.0)
    return replace(points, coordinates=coordinates)


@pytest.mark.parametrize("reference", [None, ["K1", "K2", "B", "C"]])
def test_a_list_only_selects_what_is_shown(planned, reference):
    """Point A has moved; what is told of it does not depend on the others that are listed."""
    rng = np.random.default_rng(4)
    first = replace(Simulation(planned).drawn(rng), points=planned.points)
    second = Simulation(replace(planned, points=lifted(planned.points))).drawn(rng)
    epochs = [epoch.adjust() for epoch in (first, replace(second, points=planned.points))]
    every = compare(*epochs, reference=reference)
    some = compare(*epochs, points=["A", "D"], reference=reference)
    shown = ("A", "D") if reference is None else tuple(n for n in NAMES if n in ("A", "D", *reference))
    assert some.displacements.names == shown
    assert "A" in every.significant and "A" in some.significant
    told = {row.point: row for row in every.record().displacements}
    for row in some.record().displacements:
        assert row == told[row.point]


def test_known_points_in_two_systems_are_refused(planned):
    first, second = (epoch.adjust() for epoch in pair(planned))
    with pytest.raises(InputError, match=r"given in Local, those of the second in EPSG:2154"):
        compare(first, replace(second, points_crs="EPSG:2154"))


@pytest.mark.parametrize("more", [{}, {"points": ["A", "B"]}])
def test_listed_points_of_the_case(more):
    folder = OutsideData() / "verdict-cases/compare-points"
    epochs = [
        Network.read(folder / epoch / "simulated.obs", folder / "base.cor").adjust() for epoch in ("e1", "e2")
    ]
    found = compare(*epochs, **more)
    row = found.displacements.names.index("A")
    east = np.sqrt(found.displacements.block(row)[0, 0] * found.tester.variance_factor)
    assert east == pytest.approx(1.17e-3, abs=1e-5)
    assert found.significant == ("A",)


def test_free_starts_of_the_case():
    folder = OutsideData() / "verdict-cases/compare-flag3"
    first, second = (
        Network.read(folder / epoch / "simulated.obs", folder / points).adjust()
        for epoch, points in (("e1", "base.cor"), ("e2", "base2.cor"))
    )
    found = compare(first, second)
    up = np.sqrt(np.diag(found.displacements.cofactors)[2::3] * found.tester.variance_factor)
    assert up.max() < 1.2e-3 and found.congruence.freedom == 11
