"""Hard constraints hold exactly; solutions and covariances are those of Lagrange's multipliers."""

import itertools

import numpy as np
import pytest
from networks import levelled_square

from obseq import InputError, SingularSystemError
from obseq.errors import DivergenceError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.iterations.constraints import ContradictoryConstraintsError


def bordered(normal, rhs, rows, values):
    """Solution and cofactors of min x'Nx/2 - rhs'x under rows x = values, by the bordered matrix."""
    n, m = len(normal), len(rows)
    whole = np.block([[normal, rows.T], [rows, np.zeros((m, m))]])
    inverse = np.linalg.inv(whole)
    return (inverse @ np.concatenate([rhs, values]))[:n], inverse[:n, :n]


def random_linear(seed=0, n=9, m=40):
    rng = np.random.default_rng(seed)
    design, values = rng.normal(size=(m, n)), rng.normal(size=m)
    system = LeastSquares()
    ids = system.add_vectors(["a", "b", "c"], rng.normal(size=(3, 3)))
    parts = [design[:, 3 * k : 3 * k + 3] for k in range(3)]
    system.add_linear([ids[[k]].repeat(m) for k in range(3)], parts, values, 0.5)
    return system, ids, design / 0.5, values / 0.5


@pytest.mark.parametrize("seed", range(6))
def test_linear_constraints_as_lagrange_solves_them(seed):
    system, ids, design, values = random_linear(seed)
    rng = np.random.default_rng(100 + seed)
    rows, targets = rng.normal(size=(4, 9)), rng.normal(size=4)
    for row, target in zip(rows, targets, strict=True):
        system.constrain_linear(
            [[k] for k in ids], [row[None, 3 * k : 3 * k + 3] for k in range(3)], [target]
        )
    result = system.solve(covariance="all")
    expected, cofactors = bordered(design.T @ design, design.T @ values, rows, targets)
    assert result.values(ids).ravel() == pytest.approx(expected, abs=1e-11)
    assert rows @ result.values(ids).ravel() == pytest.approx(targets, abs=1e-12)
    assert (result.n_unknowns, result.redundancy) == (5, 40 - 5)
    assert result.cost == pytest.approx(np.sum((design @ expected - values) ** 2), rel=1e-12)
    found = result.covariance(ids, a_priori=True)
    for k in range(3):
        block = cofactors[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        assert found[k] == pytest.approx(block, rel=1e-9, abs=1e-15)
    between = result.covariance_between(ids, ids, a_priori=True)
    assert between == pytest.approx(cofactors, rel=1e-9, abs=1e-14)


def test_a_heavy_weight_comes_near_what_substitution_gives():
    hard, ids, *_ = random_linear(1)
    soft, same, *_ = random_linear(1)
    ones = np.ones((1, 3))
    hard.constrain_linear([ids[:1], ids[1:2]], [ones, -2.0 * ones], [0.3])
    soft.add_linear([same[:1], same[1:2]], [ones, -2.0 * ones], [0.3], 1e-6)
    assert soft.solve().values(same) == pytest.approx(hard.solve().values(ids), abs=1e-9)


def test_constraints_and_priors_and_frozen_unknowns_together():
    """The prior competes with the observations, not with the constraint."""
    system = LeastSquares()
    x, y, z = system.add_scalars(["x", "y", "z"], [0.0, 0.0, 2.0])
    system.freeze([z])
    one = [[1.0]]
    system.add_linear([[x]], [one], [10.0], 1.0)
    system.add_prior([y], [[4.0]], 0.5)
    system.constrain_linear([[x], [y], [z]], [one, one, one], [11.0])
    result = system.solve(covariance="all")
    expected = (10.0 + 4.0 * (9.0 - 4.0)) / 5.0
    assert result.values([x, y, z]).ravel() == pytest.approx([expected, 9.0 - expected, 2.0])
    assert result.covariance([x, y, z], a_priori=True).ravel() == pytest.approx([0.2, 0.2, 0.0])
    assert result.redundancy == 1


def test_shared_unknowns_are_one_unknown():
    """Three cameras that share two of their three parameters, against one parameter put in all equations."""
    rng = np.random.default_rng(4)
    design, values = rng.normal(size=(60, 3)), rng.normal(size=60)
    camera = rng.integers(0, 3, 60)
    system = LeastSquares()
    ids = system.add_vectors(["c0", "c1", "c2"], rng.normal(size=(3, 3)), ["f", "k1", "k2"])
    system.add_linear([ids[camera]], [design], values, 1.0)
    system.share(ids, ("f", "k2"))
    result = system.solve(covariance="all")
    wide = np.zeros((60, 5))
    wide[:, 0], wide[:, 1] = design[:, 0], design[:, 2]
    wide[np.arange(60), 2 + camera] = design[:, 1]
    expected = np.linalg.lstsq(wide, values)[0]
    found = result.values(ids)
    assert found[:, 0] == pytest.approx(np.full(3, expected[0]), abs=1e-12)
    assert found[:, 2] == pytest.approx(np.full(3, expected[1]), abs=1e-12)
    assert found[:, 1] == pytest.approx(expected[2:], abs=1e-12)
    cofactors = np.linalg.inv(wide.T @ wide)
    covariance = result.covariance(ids, a_priori=True)
    assert covariance[1, 0, 2] == pytest.approx(cofactors[0, 1])
    assert covariance[2, 1, 0] == pytest.approx(cofactors[4, 0])
    assert result.n_unknowns == 5


def test_an_unknown_that_only_a_constraint_touches_is_determined_by_it():
    system, heights, _ = levelled_square()
    system.freeze(heights[:1])
    mean = system.add_scalars(["mean"], [0.0])
    one = np.ones((1, 1))
    columns = [mean, *(heights[[k]] for k in range(4))]
    system.constrain_linear(columns, [-4.0 * one, one, one, one, one], [0.0])
    result = system.solve(covariance="all")
    assert result.values(mean)[0, 0] == pytest.approx(result.values(heights).mean())
    whole = result.covariance_between(heights, heights)
    assert result.covariance(mean)[0, 0, 0] == pytest.approx(whole.sum() / 16.0)


def distances_to_known(start):
    system = LeastSquares()
    known = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]])
    base = system.add_points(["A", "B", "C", "D"], known)
    system.freeze(base)
    new = system.add_points(["E"], [start])
    target = np.array([3.0, 2.0, 4.0])
    lengths = np.linalg.norm(known - target, axis=1) + np.array([0.05, -0.03, 0.02, 0.04])
    system.add("Dist3D", {"p1": base, "p2": new}, lengths, 0.05)
    return system, base, new


def test_a_formula_as_a_constraint_is_linearised_at_each_iteration():
    """A distance that is exact: the solution is on the sphere, and the gradient is along its radius."""
    system, base, new = distances_to_known([2.0, 3.0, 3.0])
    constraint = system.constrain("Dist3D", {"p1": base[:1], "p2": new}, [5.5], ["A E (exact)"])
    result = system.solve(covariance="all", max_iterations=30)
    found = result.values(new)[0]
    assert result.converged
    assert np.linalg.norm(found) == pytest.approx(5.5, abs=1e-12)
    assert system.residuals(constraint) == pytest.approx(np.zeros((1, 1)), abs=1e-12)
    gradient = system.equations().assemble().gradient
    assert np.cross(gradient, found) == pytest.approx(np.zeros(3), abs=1e-4)
    assert np.linalg.norm(gradient) > 1.0
    assert result.covariance(new)[0] @ found == pytest.approx(np.zeros(3), abs=1e-9)
    assert result.redundancy == 4 - 2


def test_a_constraint_can_be_removed():
    system, base, new = distances_to_known([2.0, 3.0, 3.0])
    free = system.solve().values(new)
    constraint = system.constrain("Dist3D", {"p1": base[:1], "p2": new}, [5.5])
    assert not np.allclose(system.solve().values(new), free, atol=1e-3)
    system.remove_constraint(constraint)
    assert system.solve().values(new) == pytest.approx(free, abs=1e-6)
    with pytest.raises(InputError, match="not in the system"):
        system.remove_constraint(constraint)


def test_constraints_with_eliminated_blocks_elsewhere():
    values = []
    for eliminated in (False, True):
        rng = np.random.default_rng(2)
        system = LeastSquares()
        kept = system.add_vectors(["a", "b"], np.zeros((2, 3)))
        loose = system.add_vectors(["t", "u"], np.zeros((2, 3)))
        a, t = rng.integers(0, 2, 40), rng.integers(0, 2, 40)
        parts = [rng.normal(size=(40, 3)), rng.normal(size=(40, 3))]
        system.add_linear([kept[a], loose[t]], parts, rng.normal(size=40), 1.0)
        system.share(kept, (1,))
        if eliminated:
            system.eliminate(loose)
        result = system.solve(covariance="all")
        values.append(np.concatenate([result.values(kept), result.values(loose)]))
        values.append(result.covariance(loose))
    assert values[2] == pytest.approx(values[0], abs=1e-11)
    assert values[3] == pytest.approx(values[1], rel=1e-8)


def test_an_eliminated_block_takes_no_constraint():
    system, ids, *_ = random_linear()
    system.eliminate(ids[:1])
    system.share(ids[:2])
    with pytest.raises(InputError, match=r"linear b = a: it concerns 'a', .*: eliminate\(\[0\], False\)"):
        system.solve()
    system.eliminate([0], False)
    assert system.solve().converged


def test_contradictory_constraints_are_named():
    system, ids, *_ = random_linear()
    ones = np.ones((1, 3))
    system.constrain_linear([ids[:1], ids[1:2]], [ones, ones], [1.0], ["sum"])
    system.constrain_linear([ids[1:2], ids[:1]], [2 * ones, 2 * ones], [2.0], ["twice the sum"])
    result = system.solve()
    assert (result.n_unknowns, result.redundant_constraints) == (8, ("linear twice the sum",))
    system.constrain_linear([ids[:1], ids[1:2]], [ones, ones], [3.0], ["another sum"])
    with pytest.raises(ContradictoryConstraintsError, match=r"another sum contradicts linear sum.*off by 2"):
        system.solve()


def test_a_constraint_on_frozen_unknowns_only():
    system, ids, *_ = random_linear()
    system.freeze(ids[:1])
    held = float(system.values(ids[:1]).sum())
    system.constrain_linear([ids[:1]], [np.ones((1, 3))], [held], ["held"])
    assert system.solve().n_unknowns == 6
    system.constrain_linear([ids[:1]], [np.ones((1, 3))], [held + 1.0], ["broken"])
    with pytest.raises(ContradictoryConstraintsError, match="linear broken concerns frozen unknowns only"):
        system.solve()


def test_what_constraints_leave_undetermined_is_named():
    system = LeastSquares()
    ids = system.add_scalars(["x", "y", "z"], [0.0, 0.0, 0.0])
    one = np.ones((1, 1))
    system.add_linear([ids[:1]], [one], [1.0], 1.0)
    system.constrain_linear([ids[1:2], ids[2:]], [one, one], [5.0])
    with pytest.raises(SingularSystemError) as error:
        system.solve()
    assert set(error.value.unknowns) == {"y", "z"}


def test_many_shared_unknowns_are_not_quadratic():
    n = 3000
    system = LeastSquares()
    ids = system.add_scalars([f"x{k}" for k in range(n)], np.arange(n, dtype=float))
    system.add_linear([ids], [np.ones((n, 1))], np.arange(n, dtype=float), 1.0)
    system.share(ids)
    result = system.solve()
    assert result.values(ids).ravel() == pytest.approx(np.full(n, (n - 1) / 2.0))
    assert result.n_unknowns == 1


def test_a_constraint_that_is_undefined_where_it_begins_is_named():
    system = LeastSquares()
    here, there = system.add_points(["O"], np.zeros((1, 3))), system.add_points(["P"], np.zeros((1, 3)))
    system.freeze(here)
    system.add_prior(there, np.zeros((1, 3)), 1.0)
    system.constrain("Dist3D", {"p1": here, "p2": there}, [145.0])
    with pytest.raises(
        DivergenceError, match=r"constraint Dist3D .*O.*P.*: its value or its derivatives are not"
    ):
        system.solve()


FAR_STARTS = [3, 58, 103, 156, 178, 237, 301, 343]


def far_start(seed):
    """Two points from three others and from one another, 5 m off; their distance is to be 2 m more."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(-100.0, 100.0, (5, 3)) * [1.0, 1.0, 0.2]
    start = true + rng.normal(0.0, 5.0, true.shape)
    start[:3] = true[:3]
    i, j = np.tril_indices(5, -1)
    lengths = np.linalg.norm(true[i] - true[j], axis=1) + rng.normal(0.0, 0.01, len(i))
    system = LeastSquares()
    ids = system.add_points(list("ABCDE"), start)
    system.freeze(ids[:3])
    system.add("Dist3D", {"p1": ids[i], "p2": ids[j]}, lengths, 0.01)
    system.add_prior(ids[3:], true[3:], 1.0)
    far = np.linalg.norm(true[3] - true[4]) + 2.0
    return system, system.constrain("Dist3D", {"p1": ids[[3]], "p2": ids[[4]]}, [far])


@pytest.mark.parametrize("seed", FAR_STARTS)
def test_a_constraint_far_from_met_is_approached_whatever_the_cost(seed):
    """The first step raises the sum of squares: 'controlled' ended there, metres off the constraint."""
    expected = far_start(seed)[0].solve(max_iterations=100)
    for strategy in ("controlled", "levenberg-marquardt"):
        system, constraint = far_start(seed)
        result = system.solve(strategy=strategy, max_iterations=100)
        assert result.converged, result.ending
        assert system.residuals(constraint)[0, 0] == pytest.approx(0.0, abs=1e-9)
        assert result.cost <= expected.cost * (1.0 + 1e-9)


def test_a_constraint_that_holds_lets_no_step_raise_the_cost():
    """With z shared from the start the violation is 0, and stays so: nothing is restored."""
    system = LeastSquares()
    ids = system.add_points(["A", "B", "P", "Q"], [[0, 0, 0], [10, 0, 0], [1.0, 0.2, 5.0], [2.0, 0.1, 5.0]])
    system.freeze(ids[:2])
    for target in ids[2:]:
        system.add("Dist3D", {"p1": ids[:2], "p2": target}, [9.0, 9.0], 0.1)
    system.add_prior(ids[2:], [[5.0, 6.0, 3.0], [5.0, 4.0, 3.0]], 5.0)
    system.share(ids[2:], ["z"])
    result = system.solve(strategy="controlled", max_iterations=60)
    assert result.converged
    costs = [step.cost for step in result.iterations]
    assert all(after <= before * (1.0 + 1e-12) for before, after in itertools.pairwise(costs))
