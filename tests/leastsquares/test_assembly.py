"""The normal equations against J' W J with J by differences, for formulas and freezing of all sorts."""

import numpy as np
import pytest
from networks import dense_normal, mixed_system

from obseq.errors import DivergenceError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.assembly.evaluation import jacobian_rows


def compare(system, batches, tolerance=1e-7):
    equations = system.equations()
    found = equations.assemble()
    normal, gradient = dense_normal(system, batches)
    kept = equations.free.scalars
    scale = np.sqrt(np.diag(normal)[kept])
    gap = equations.pattern.matrix(found.values).toarray() - normal[np.ix_(kept, kept)]
    assert np.abs(gap / np.outer(scale, scale)).max() < tolerance
    assert np.abs((found.gradient - gradient[kept]) / scale).max() < tolerance * np.sqrt(found.cost)
    return found


def test_normal_equations_of_formulas_of_all_shapes():
    system, *_, batches = mixed_system()
    found = compare(system, batches)
    squares = sum(np.sum(np.square(system.residuals(b) / b.sigmas)) for b in batches)
    assert found.cost == pytest.approx(squares, rel=1e-12)


def test_frozen_components_leave_the_system():
    system, points, rotations, lengths, batches = mixed_system(1)
    system.freeze(points[:3])
    system.freeze(points[3:5], ("x", 2))
    system.freeze(rotations[2:6], ("x", "y"))
    system.freeze(rotations[7:8])
    system.freeze(lengths[:1])
    compare(system, batches)
    assert system.equations().n_unknowns == 12 * 6 + 2 - (9 + 4 + 8 + 3 + 1)


def test_refilling_gives_the_same_numbers_again():
    system, points, *_ = mixed_system(2)
    system.freeze(points[3:5], (1,))
    first = system.equations().assemble()
    values, gradient = first.values.copy(), first.gradient.copy()
    again = system.equations().assemble()
    assert np.array_equal(values, again.values)
    assert np.array_equal(gradient, again.gradient)


def test_one_block_in_two_arguments_counts_both_ways():
    system = LeastSquares()
    x = system.add_vectors(["v", "w"], [[1.0, 2.0], [3.0, 5.0]])
    c = np.array([[2.0, -1.0]]), np.array([[0.5, 4.0]])
    batch = system.add_linear([x[[0]], x[[0]]], c, [7.0], 0.5)
    other = system.add_linear([x[[1]], x[[0]]], c, [7.0], 0.5)
    compare(system, [batch, other], 1e-9)


def test_both_orders_of_a_pair_meet_in_one_place():
    system = LeastSquares()
    points = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [3.0, 4.0, 1.0]])
    ids = {"p1": points[[0, 1, 0]], "p2": points[[1, 0, 1]]}
    compare(system, [system.add("Dist3D", ids, [5.0, 5.1, 5.2], [1.0, 2.0, 3.0])])


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 7, 8, 10])
def test_blocks_of_any_size(size):
    rng = np.random.default_rng(size)
    system = LeastSquares()
    a = system.add_vectors(["a", "b", "c"], rng.normal(size=(3, size)))
    b = system.add_vectors(["d", "e"], rng.normal(size=(2, 3)))
    left, right = rng.integers(0, 3, 50), rng.integers(0, 2, 50)
    coefficients = [rng.normal(size=(50, size)), rng.normal(size=(50, 3))]
    batch = system.add_linear([a[left], b[right]], coefficients, rng.normal(size=50), rng.uniform(1, 2, 50))
    system.freeze(a[1:2], (size - 1,))
    compare(system, [batch], 1e-9)


def test_calibration_shared_by_all_images():
    rng = np.random.default_rng(3)
    system = LeastSquares()
    points = system.add_points(
        [f"P{k}" for k in range(20)], rng.uniform(-1, 1, (20, 3)) + np.array([0.0, 0.0, 5.0])
    )
    centres = system.add_points(["c0", "c1"], [[0.0, 0.0, 0.0], [0.5, 0.1, 0.0]])
    turns = system.add_rotations(["c0", "c1"], np.tile(np.eye(3), (2, 1, 1)))
    start = [[1.0, 0.01, 0.02, 0.03, -0.02, 0.01, 0.002, 0.001, 0.003, -0.001]]
    calibration = system.add_vectors(["camera"], start)
    target, image = np.tile(np.arange(20), 3), rng.integers(0, 2, 60)
    pose = {"camera.centre": centres[image], "camera.rotation": turns[image]}
    blocks = {"point": points[target], "calibration": calibration, **pose}
    name = "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1"
    batch = system.add(name, blocks, rng.normal(0.0, 0.3, (60, 2)), 0.5)
    assert batch.shape.n_residuals == 2
    compare(system, [batch], 1e-6)


def test_inactive_observations_have_residuals_and_no_influence():
    system = LeastSquares()
    x = system.add_scalars(["x"], [1.0])
    batch = system.add_linear([x[[0, 0]]], [[[1.0], [1.0]]], [2.0, 100.0], 1.0)
    batch.active[:] = [True, False]
    batch.weights[0, 1] = 0.0
    assert batch.n_scalars == 1
    assert system.residuals(batch).ravel() == pytest.approx([-1.0, -99.0])
    assert system.equations().assemble().squares == {"linear": 1.0}


def test_an_undefined_equation_is_named():
    system = LeastSquares()
    points = system.add_points(["A", "B", "C"], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    ids = {"p1": points[[0, 1]], "p2": points[[1, 2]]}
    system.add("Dist3D", ids, [1.0, 1.0], 1.0, labels=["A B (f.obs:3)", "B C (f.obs:4)"])
    with pytest.raises(DivergenceError, match=r"Dist3D B C \(f.obs:4\).*not finite"):
        system.equations().assemble()
    system.set_values(points[2:], [[2.0, 0.0, 0.0]])
    assert system.equations().assemble().cost == pytest.approx(0.0)


def test_jacobian_on_request_is_that_of_the_differences():
    system, *_, batches = mixed_system(4)
    rows = jacobian_rows(system.unknowns, batches[2])
    assert rows.shape == (3 + 3 * 9, 33)
    assert np.allclose(rows[:3].T, system.residuals(batches[2]), rtol=0, atol=1e-14)
