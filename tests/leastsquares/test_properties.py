"""What must not matter to a solution: numbering, order, batches, elimination, and how points are held."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares


def network(seed):
    """Stations with unknown orientation and points, of which three stations are held; plain arrays."""
    rng = np.random.default_rng(seed)
    n_points, n_stations = int(rng.integers(4, 9)), int(rng.integers(3, 5))
    points = rng.uniform(-50.0, 50.0, (n_points + n_stations, 3))
    turns = exponential(rng.normal(0.0, 0.8, (n_stations, 3)))
    station, target = np.meshgrid(np.arange(n_stations), np.arange(n_points) + n_stations, indexing="ij")
    return points, turns, station.ravel(), target.ravel(), rng


def solved(seed, order=None, shuffle=False, pieces=1, eliminate=False, constrained=False):
    """Coordinates, turns, covariances of points and sigma0 of a network set up in one of many ways."""
    points, turns, station, target, rng = network(seed)
    n, m = len(points), len(turns)
    local = np.einsum("nji,nj->ni", turns[station], points[target] - points[station])
    angles = np.arctan2(local[:, 0], local[:, 1]) + rng.normal(0.0, 1e-4, len(station))
    zeniths = np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2]) + rng.normal(
        0.0, 1e-4, len(station)
    )
    lengths = np.linalg.norm(local, axis=1) + rng.normal(0.0, 2e-3, len(station))
    start = points + rng.normal(0.0, 0.05, points.shape)
    start[:3] = points[:3]
    turned = turns @ exponential(rng.normal(0.0, 0.01, (m, 3)))
    other = np.random.default_rng(seed + 1)
    order = other.permutation(n) if order == "random" else np.arange(n)
    system = LeastSquares()
    ids, rotations = np.empty(n, dtype=np.int64), None
    if order[0] != 0:
        rotations = system.add_rotations([f"S{k}" for k in range(m)], turned)
    ids[order] = system.add_points([f"P{k}" for k in order], start[order])
    if rotations is None:
        rotations = system.add_rotations([f"S{k}" for k in range(m)], turned)
    rows = other.permutation(len(station)) if shuffle else np.arange(len(station))
    for part in np.array_split(rows, pieces):
        centre, turn, end = ids[station[part]], rotations[station[part]], ids[target[part]]
        sight = {"station.centre": centre, "station.rotation": turn, "target": end}
        system.add("TopoHz", sight, angles[part], 1e-4)
        system.add("TopoZen", sight, np.column_stack([zeniths, np.zeros_like(zeniths)])[part], 1e-4)
        system.add("TopoDist", {"origin": centre, "target": end}, lengths[part], 2e-3)
    hold(system, ids[:3], points[:3], constrained)
    if eliminate:
        system.eliminate(ids[m:])
    result = system.solve(covariance="all", max_iterations=40)
    assert result.converged
    free = ids[3:]
    return result.values(ids), result.values(rotations), result.covariance(free), result.sigma0, result


def hold(system, ids, values, constrained):
    """Keeps points where they are: frozen, or by constraints."""
    if not constrained:
        system.freeze(ids)
        return
    unit = np.tile(np.eye(3), (len(ids), 1))
    system.constrain_linear([np.repeat(ids, 3)], [unit], values.ravel())


WAYS = {
    "renumbered": {"order": "random"},
    "observations in another order": {"shuffle": True},
    "in many batches": {"pieces": 5, "shuffle": True},
    "points eliminated": {"eliminate": True},
    "held by constraints": {"constrained": True},
    "all together": {"order": "random", "shuffle": True, "pieces": 3, "eliminate": True, "constrained": True},
}


@pytest.mark.parametrize("way", WAYS)
@settings(max_examples=6, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_the_solution_is_the_same(way, seed):
    points, turns, covariance, sigma0, first = solved(seed)
    others = solved(seed, **WAYS[way])
    assert others[0] == pytest.approx(points, abs=1e-7)
    assert others[1] == pytest.approx(turns, abs=1e-8)
    scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    gap = (others[2] - covariance) / (scale[:, :, None] * scale[:, None, :])
    assert np.abs(gap).max() < 1e-4
    assert others[3] == pytest.approx(sigma0, rel=1e-6)
    assert (others[4].n_unknowns, others[4].redundancy) == (first.n_unknowns, first.redundancy)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_moving_and_turning_everything_changes_no_residual_of_distances(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-50.0, 50.0, (6, 3))
    turn, shift = exponential(rng.normal(0.0, 2.0, 3)), rng.uniform(-1e3, 1e3, 3)
    i, j = np.triu_indices(6, 1)
    measured = np.linalg.norm(points[i] - points[j], axis=1) + rng.normal(0.0, 0.01, 15)
    residuals = []
    for each in (points, points @ turn.T + shift):
        system = LeastSquares()
        ids = system.add_points([f"P{k}" for k in range(6)], each)
        batch = system.add("Dist3D", {"p1": ids[i], "p2": ids[j]}, measured, 0.01)
        residuals.append(system.residuals(batch))
    assert residuals[1] == pytest.approx(residuals[0], abs=1e-9)
