"""A network in Helmert blocks is the network at once, also when a worker has lost its leaves."""

from concurrent.futures import Future

import numpy as np
import pytest

from obseq.errors import FormulaError, InputError
from obseq.leastsquares import LeastSquares, solve_in_blocks
from obseq.leastsquares.helmert.cutting import cut, homes
from obseq.leastsquares.helmert.leaves import LEAVES


def network(n=12):
    """A square of points measured from plumb stations on every other one: directions, zeniths, distances."""
    rng = np.random.default_rng(3)
    system = LeastSquares()
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) * 100.0
    true = np.column_stack([grid + rng.uniform(-20, 20, grid.shape), rng.uniform(0, 30, len(grid))])
    points = system.add_points([f"P{k}" for k in range(len(true))], true + rng.normal(0, 0.05, true.shape))
    system.add_prior(points[[0, n - 1, -1]], true[[0, n - 1, -1]], [0.01, 0.01, 0.02])
    origins = np.arange(0, len(true), 2)
    turns = system.add_rotations([f"R{k}" for k in origins], np.tile(np.eye(3), (len(origins), 1, 1)))
    system.freeze(turns, ["rotation.x", "rotation.y"])
    near = np.linalg.norm(true[origins][:, None] - true[None], axis=2)
    station, target = np.nonzero((near < 250.0) & (near > 0.0))
    east, north, up = (true[target] - true[origins[station]]).T
    observed = {
        "TopoHz": [np.arctan2(east, north)],
        "TopoZen": [np.zeros(len(up)), np.arctan2(np.hypot(east, north), up)],
    }
    blocks = {
        "station.centre": points[origins[station]],
        "station.rotation": turns[station],
        "target": points[target],
    }
    for formula, columns in observed.items():
        columns[-1] += rng.normal(0, 1e-5, len(up))
        system.add(formula, blocks, np.column_stack(columns), 1e-5)
    lengths = np.sqrt(east**2 + north**2 + up**2) + rng.normal(0, 0.002, len(up))
    system.add("Dist3D", {"p1": points[origins[station]], "p2": points[target]}, lengths[:, None], 0.002)
    return system, points, turns


class Forgetful:
    """An executor that has lost all leaves before each task."""

    def submit(self, function, *arguments):
        LEAVES.clear()
        future = Future()
        future.set_result(function(*arguments))
        return future


@pytest.mark.parametrize("executor", [None, Forgetful()], ids=["keeps leaves", "loses leaves"])
def test_blocks_give_what_one_machine_gives(executor):
    whole, points, turns = network()
    system, *_ = network()
    expected = whole.solve(covariance=True)
    found = solve_in_blocks(system, 2, executor)
    assert found.converged
    assert found.redundancy == expected.redundancy
    assert found.sigma0 == pytest.approx(expected.sigma0, rel=1e-9)
    assert np.abs(system.values(points) - whole.values(points)).max() < 1e-9
    assert np.abs(system.values(turns) - whole.values(turns)).max() < 1e-12
    assert np.allclose(found.variances, expected.cofactors.variances(), rtol=1e-8, atol=0.0)
    assert len(found.separators) == 3
    assert min(found.separators) > 0
    assert not LEAVES


def test_iterations_end_at_their_number():
    system, *_ = network(6)
    found = solve_in_blocks(system, 1, max_iterations=1)
    assert not found.converged
    assert len(found.costs) == 2
    assert found.costs[1] < found.costs[0]


def test_every_observation_is_in_one_part():
    system, *_ = network()
    parts = cut(system, 3).parts
    total = sum(len(observations) for part in parts for _, _, observations, _ in part.batches)
    assert total == system.n_observations
    assert sum(np.isfinite(sigmas).sum() for part in parts for *_, sigmas in part.priors) == 9


def test_a_block_is_at_home_below_all_its_observations():
    # Leaves 4 to 7: a block of leaf 5 alone; of 4 and 5 (node 2); of 5 and 6 (the root).
    touched = np.array([[0, 1, 0], [1, 1, 1], [0, 0, 1], [0, 0, 0]], dtype=bool)
    assert homes(touched).tolist() == [5, 2, 1]


def test_what_cannot_be_cut_is_refused():
    system, points, _ = network(4)
    with pytest.raises(InputError, match="halved"):
        solve_in_blocks(system, 9)
    system.batches[0].loss = "huber"
    with pytest.raises(InputError, match="TopoHz has a loss"):
        solve_in_blocks(system, 1)
    system.batches[0].loss = None
    system.constrain("Dist3D", {"p1": points[:1], "p2": points[1:2]}, [[100.0]])
    with pytest.raises(InputError, match="hard constraints"):
        solve_in_blocks(system, 1)
    linear = LeastSquares()
    places = linear.add_points(["a", "b"], np.zeros((2, 3)))
    linear.add_linear([places], [np.ones((2, 3))], np.zeros(2), 1.0)
    with pytest.raises((FormulaError, InputError)):
        solve_in_blocks(linear, 1)
