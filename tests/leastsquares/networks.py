"""Systems that several tests share: small, mixed, with an independent way to their derivatives."""

from __future__ import annotations

import numpy as np

from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares


def jacobian(system: LeastSquares, batch) -> np.ndarray:
    """(n * n_residuals, n_scalars) by differences of residuals, unknowns moved as solutions move them."""
    table, step = system.unknowns, 1e-5
    columns = []
    start = table.state()
    for k in range(table.n_scalars):
        sides = []
        for sign in (1.0, -1.0):
            moved = np.zeros(table.n_scalars)
            moved[k] = sign * step
            table.move(moved)
            sides.append(system.residuals(batch).ravel())
            table.restore(start)
        columns.append((sides[0] - sides[1]) / (2.0 * step))
    return np.array(columns).T


def dense_normal(system: LeastSquares, batches) -> tuple[np.ndarray, np.ndarray]:
    """J' W J and J' W r of all unknowns, frozen ones included."""
    n = system.unknowns.n_scalars
    normal, gradient = np.zeros((n, n)), np.zeros(n)
    for batch in batches:
        rows = jacobian(system, batch)
        weights = (batch.weights[:, : batch.n].T.ravel()) ** 2
        normal += rows.T @ (weights[:, None] * rows)
        gradient += rows.T @ (weights * system.residuals(batch).ravel())
    return normal, gradient


def mixed_system(seed: int = 0, n: int = 12):
    """Points, rotations and scalars joined by formulas of all shapes, in general position."""
    rng = np.random.default_rng(seed)
    system = LeastSquares()
    points = system.add_points([f"P{k}" for k in range(n)], rng.uniform(0.0, 10.0, (n, 3)))
    turns = exponential(rng.normal(0.0, 0.6, (n, 3)))
    rotations = system.add_rotations([f"P{k}" for k in range(n)], turns)
    lengths = system.add_scalars(["d0", "d1"], [3.0, 4.0])
    pick = lambda count: np.array([rng.permutation(n)[:2] for _ in range(count)]).T  # noqa: E731
    batches = []
    a, b = pick(70)
    batches.append(
        system.add("Dist3D", {"p1": points[a], "p2": points[b]}, rng.uniform(2, 9, 70), rng.uniform(1, 2, 70))
    )
    a, b = pick(40)
    station = {"station.centre": points[a], "station.rotation": rotations[a], "target": points[b]}
    batches.append(system.add("TopoHz", station, rng.uniform(-1, 1, 40), 0.1))
    a, b = pick(33)
    frame = {"frame": rotations[a], "p1": points[a], "p2": points[b]}
    sigmas = rng.uniform(0.5, 2.0, (33, 3))
    batches.append(system.add("TopoSubFrame", frame, rng.uniform(-3, 3, (33, 3)), sigmas))
    a, b = pick(9)
    shared = {"distance": lengths[a % 2], "p1": points[a], "p2": points[b]}
    batches.append(system.add("Dist3DParam", shared, None, 0.3))
    batches.append(system.add("BlocRigid", _rigid(points, rotations, rng, 11), None, 0.7))
    return system, points, rotations, lengths, batches


def _rigid(points, rotations, rng, n):
    chosen = np.array([rng.permutation(len(points))[:4] for _ in range(n)]).T
    names = ("camera_a", "camera_b", "place_1", "place_2")
    blocks = {f"{name}.centre": points[ids] for name, ids in zip(names, chosen, strict=True)}
    return blocks | {f"{name}.rotation": rotations[ids] for name, ids in zip(names, chosen, strict=True)}


def levelled_square():
    """Four heights, five differences: solved by hand in the tests that use it."""
    system = LeastSquares()
    heights = system.add_scalars(["A", "B", "C", "D"], np.zeros(4))
    lines = [(0, 1, 1.02), (1, 2, 2.01), (2, 3, -0.98), (3, 0, -2.02), (0, 2, 3.00)]
    start, end, values = zip(*lines, strict=True)
    minus, plus = np.full((5, 1), -1.0), np.full((5, 1), 1.0)
    batch = system.add_linear([heights[list(start)], heights[list(end)]], [minus, plus], values, 0.01)
    return system, heights, batch
