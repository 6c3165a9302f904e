"""What must not change a solution, on random networks: order, batches, elimination, ways of a constraint."""

import numpy as np
import pytest

from obseq.errors import InputError, SingularSystemError
from obseq.leastsquares import LeastSquares

SEEDS = range(5)


class RandomNetwork:
    """Distances between points of space, three of them softly known; every way to put it in a system."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.n = int(rng.integers(7, 14))
        true = rng.uniform(0, 100, (self.n, 3))
        self.start = true + rng.normal(0, 0.1, true.shape)
        first, second = np.triu_indices(self.n, 1)
        kept = rng.uniform(size=len(first)) < 0.8
        self.first, self.second = first[kept], second[kept]
        lengths = np.linalg.norm(true[self.second] - true[self.first], axis=1)
        self.sigmas = rng.uniform(0.005, 0.02, len(lengths))
        self.lengths = lengths + rng.normal(0, self.sigmas)
        self.known = true[:4] + rng.normal(0, 0.01, (4, 3))

    def system(self, order=None, parts=1, solver="auto"):
        """The system and the ids of the points, added in an order, their distances in several batches."""
        order = np.arange(self.n) if order is None else order
        system = LeastSquares(solver)
        added = system.add_points([f"P{k}" for k in order], self.start[order])
        ids = np.empty(self.n, dtype=np.int64)
        ids[order] = added
        for part in np.array_split(np.arange(len(self.lengths)), parts):
            blocks = {"p1": ids[self.first[part]], "p2": ids[self.second[part]]}
            system.add("Dist3D", blocks, self.lengths[part], self.sigmas[part])
        system.add_prior(ids[:4], self.known, 0.01)
        return system, ids


def compare(one, ids_one, other, ids_other, tolerance=1e-8):
    """Solves both; solution, fit and all covariances must be the same."""
    first, second = one.solve(covariance="all"), other.solve(covariance="all")
    np.testing.assert_allclose(second.values(ids_other), first.values(ids_one), atol=tolerance)
    assert second.redundancy == first.redundancy
    assert second.sigma0 == pytest.approx(first.sigma0, rel=1e-8)
    scale = np.abs(first.covariance(ids_one)).max()
    np.testing.assert_allclose(
        second.covariance(ids_other), first.covariance(ids_one), atol=1e-6 * scale, rtol=1e-5
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_of_the_unknowns(seed):
    network = RandomNetwork(seed)
    order = np.random.default_rng(seed + 100).permutation(network.n)
    compare(*network.system(), *network.system(order))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_split_in_batches(seed):
    network = RandomNetwork(seed)
    compare(*network.system(), *network.system(parts=4))


@pytest.mark.parametrize("seed", SEEDS)
def test_eliminating_a_point(seed):
    network = RandomNetwork(seed)
    system, ids = network.system()
    system.eliminate(ids[-1:])
    compare(*network.system(), system, ids)


@pytest.mark.parametrize("solver", ["supernodal", "superlu"])
def test_the_solver(solver):
    network = RandomNetwork(1)
    compare(*network.system(), *network.system(solver=solver))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_substituted_constraint_is_the_limit_of_a_heavy_weight(seed):
    network = RandomNetwork(seed)
    coefficients = [np.array([[1.0, 0.5, 0.0]]), np.array([[0.0, -1.0, 2.0]])]
    value = [float(sum(c @ network.start[k] for c, k in zip(coefficients, (4, 5), strict=True))[0]) + 0.05]
    hard, ids = network.system()
    hard.constrain_linear([ids[[4]], ids[[5]]], coefficients, value)
    heavy, others = network.system()
    heavy.add_linear([others[[4]], others[[5]]], coefficients, value, 1e-5)
    one, other = hard.solve(covariance="all"), heavy.solve(covariance="all")
    np.testing.assert_allclose(other.values(others), one.values(ids), atol=1e-5)
    scale = np.abs(one.covariance(ids, a_priori=True)).max()
    np.testing.assert_allclose(
        other.covariance(others, a_priori=True), one.covariance(ids, a_priori=True), atol=1e-4 * scale
    )
    assert one.redundancy == other.redundancy


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_an_observation_that_is_no_number_is_named(wrong):
    system = LeastSquares()
    ids = system.add_points(["A", "B"], np.eye(3)[:2])
    with pytest.raises(InputError, match=r"Dist3D A -> B .*not finite"):
        system.add("Dist3D", {"p1": ids[:1], "p2": ids[1:]}, [wrong], 0.01)


def test_a_sigma_of_zero_is_named():
    system = LeastSquares()
    ids = system.add_points(["A", "B"], np.eye(3)[:2])
    with pytest.raises(InputError, match=r"Dist3D A -> B .*sigma must be positive"):
        system.add("Dist3D", {"p1": ids[:1], "p2": ids[1:]}, [1.0], 0.0)


def test_an_empty_system_is_refused():
    with pytest.raises(InputError, match="no equations"):
        LeastSquares().solve()


def test_more_unknowns_than_equations_are_named():
    system = LeastSquares()
    ids = system.add_points(["A", "B"], [[0, 0, 0], [3, 4, 0]])
    system.freeze(ids[:1])
    system.add("Dist3D", {"p1": ids[:1], "p2": ids[1:]}, [5.0], 0.01)
    with pytest.raises(SingularSystemError, match=r"B\.") as error:
        system.solve()
    assert set(error.value.unknowns) == {"B.x", "B.y", "B.z"}
