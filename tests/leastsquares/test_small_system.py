"""Small systems: an iteration in two compiled loops is the same as all its steps one by one."""

import numpy as np
import pytest
from networks import mixed_system

from obseq import DivergenceError, SingularSystemError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.assembly.small_system import MOST_UNKNOWNS


@pytest.fixture
def step_by_step(monkeypatch):
    """Makes solutions go through assembly and solver, one after the other."""
    return lambda: monkeypatch.setattr(NormalEquations, "solve_at_once", lambda self: None)


def trilateration(loss=None, blunder=0.0, frozen=(), viscous=False):
    """Five points by all their distances, two of them with priors, one of these twice."""
    random = np.random.default_rng(5)
    truth = random.uniform(0.0, 50.0, (5, 3))
    first, second = np.triu_indices(5, 1)
    lengths = np.linalg.norm(truth[first] - truth[second], axis=1) + random.normal(0.0, 0.01, 10)
    lengths[3] += blunder
    system = LeastSquares()
    points = system.add_points(list("ABCDE"), truth + random.normal(0.0, 0.3, truth.shape))
    system.add("Dist3D", {"p1": points[first[:6]], "p2": points[second[:6]]}, lengths[:6], 0.01, loss=loss)
    system.add("Dist3D", {"p1": points[first[6:]], "p2": points[second[6:]]}, lengths[6:], 0.02)
    system.add_prior(points[:4], truth[:4], [0.05, np.inf, 0.02, 0.3])
    system.add_prior(points[:1], truth[:1], 0.1, "again")
    for point, component in frozen:
        system.freeze(points[[point]], [component])
    if viscous:
        system.add_viscosity(points, 1.0)
    return system, points


def small_mixed():
    """Points, rotations, scalars, whitened residuals: of all kinds of blocks, few enough to be small."""
    system, *_ = mixed_system(n=8)
    points = system.ids([f"P{k}" for k in range(8)])
    system.add_prior(points, system.values(points), 0.5)
    return system, points


def changing(system, number):
    """Measurements and sigmas that are replaced on the way."""
    batch = system.batches[0]
    batch.observations = batch.observations + 0.001 * (number == 1)
    batch.sigmas = batch.sigmas * (1.1 if number == 2 else 1.0)


CASES = {
    "priors": trilateration,
    "robust": lambda: trilateration("huber", blunder=1.0),
    "frozen": lambda: trilateration(frozen=[(0, 0), (0, 1), (0, 2), (3, 1)]),
    "all kinds": small_mixed,
}


@pytest.mark.parametrize("make", CASES.values(), ids=CASES)
@pytest.mark.parametrize("before", [None, changing], ids=["as it is", "changing"])
def test_both_ways_are_one(make, before, step_by_step):
    (system, points), (other, _) = make(), make()
    assert system.equations().solve_at_once() is not None
    found = system.solve(before_iteration=before)
    step_by_step()
    expected = other.solve(before_iteration=before)
    assert found.values(points) == pytest.approx(expected.values(points), rel=1e-13, abs=1e-13)
    assert (found.stop_reason, found.evaluations) == (expected.stop_reason, expected.evaluations)
    assert found.squares == pytest.approx(expected.squares, rel=1e-12)
    for one, two in zip(found.iterations, expected.iterations, strict=True):
        assert (one.cost, one.sigma0) == pytest.approx((two.cost, two.sigma0), rel=1e-10)
        assert (one.length, one.max_step) == pytest.approx((two.length, two.max_step), rel=1e-6, abs=1e-9)
        assert one.squares.keys() == two.squares.keys()


def test_the_matrix_and_the_gradient_are_those_of_assembly():
    system, _ = small_mixed()
    equations = system.equations()
    solved = equations.solve_at_once()
    matrix, kept = solved.values.copy(), solved.gradient.copy()
    whole = equations.assemble()
    assert np.array_equal(matrix, whole.values)
    assert np.array_equal(kept, whole.gradient)
    assert np.array_equal(solved.diagonal, whole.diagonal)
    normal = equations.pattern.matrix(matrix).toarray()
    assert solved.step == pytest.approx(np.linalg.solve(normal, -kept), rel=1e-9, abs=1e-12)
    assert solved.length**2 == pytest.approx(-kept @ solved.step, rel=1e-12)


def test_a_weak_matrix_goes_to_the_solver_which_names_what_is_free():
    system = LeastSquares()
    points = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    system.freeze(points[:1])
    system.add("Dist3D", {"p1": points[0], "p2": points[1]}, [1.0], 0.1)
    assert system.equations().solve_at_once() is None
    with pytest.raises(SingularSystemError, match=r"B\.y"):
        system.solve()


def test_undefined_equations_are_named_and_leave_nothing_behind():
    system, points = trilateration()
    values = system.values(points)
    system.set_values(points[1:2], values[:1])
    assert system.equations().solve_at_once() is None
    with pytest.raises(DivergenceError, match="Dist3D A -> B"):
        system.solve()
    system.set_values(points[1:2], values[1:2])
    assert np.isfinite(system.equations().solve_at_once().step).all()


def test_infinite_squares_of_finite_equations_are_no_small_matter():
    system, _ = trilateration()
    system.batches[0].observations = np.full((6, 1), 1e160)
    assert system.equations().solve_at_once() is None
    with pytest.raises(DivergenceError, match="overflow"):
        system.solve()


def test_what_is_not_small():
    assert trilateration(viscous=True)[0].equations().small is None
    system, points = trilateration()
    system.eliminate(points[:1])
    assert system.equations(reduced=True).small is None
    many = LeastSquares()
    scalars = many.add_scalars(list(map(str, range(MOST_UNKNOWNS + 1))), np.zeros(MOST_UNKNOWNS + 1))
    many.add_prior(scalars, np.zeros((MOST_UNKNOWNS + 1, 1)), 1.0)
    assert many.equations().small is None
    many.freeze(scalars[:1])
    assert many.equations().small is not None


def viscous_network():
    return trilateration(viscous=True)


def network_on_datum():
    system, points = trilateration()
    system.set_datum(points)
    return system, points


LARGER = {"viscous": viscous_network, "on a datum": network_on_datum}


@pytest.mark.parametrize("name", [*CASES, *LARGER])
def test_one_step_moves_as_one_iteration_does(name):
    make = {**CASES, **LARGER}[name]
    (alone, points), (whole, _) = make(), make()
    alone.analysis(reduced=True).step()
    whole.solve(max_iterations=1)
    np.testing.assert_array_equal(alone.values(points), whole.values(points))
    for one, other in zip(alone.batches, whole.batches, strict=True):
        np.testing.assert_array_equal(alone.residuals(one), whole.residuals(other))


def test_a_step_that_nothing_determines_is_refused():
    system, points = trilateration()
    before = system.values(points).copy()
    for batch in system.batches:
        batch.active = np.zeros(batch.n, bool)
    with pytest.raises(SingularSystemError):
        system.analysis(reduced=True).step()
    np.testing.assert_array_equal(system.values(points), before)
