"""Eliminating blocks before the matrix is formed changes the cost of a solution, and nothing else."""

import numpy as np
import pytest
from networks import mixed_system

from obseq import InputError, SingularSystemError
from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares

NAME = "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1"
CALIBRATION = [[1.0, 0.01, 0.02, 0.03, -0.02, 0.01, 0.002, 0.001, 0.003, -0.001]]


def bundle(eliminated: bool, seed: int = 0, n_images: int = 5, n_points: int = 40):
    """Images of a cloud of points, exact but for noise; returns the system and what was put in it."""
    rng = np.random.default_rng(seed)
    system = LeastSquares()
    cloud = rng.uniform(-1.0, 1.0, (n_points, 3)) + np.array([0.0, 0.0, 5.0])
    camera = system.add_vectors(["camera"], CALIBRATION)
    centres = np.column_stack([np.linspace(-1.5, 1.5, n_images), rng.normal(0.0, 0.3, (n_images, 2))])
    turns = exponential(rng.normal(0.0, 0.1, (n_images, 3)))
    points = system.add_points([f"P{k}" for k in range(n_points)], cloud)
    places = system.add_points([f"c{k}" for k in range(n_images)], centres)
    rotations = system.add_rotations([f"c{k}" for k in range(n_images)], turns)
    seen = rng.random((n_images, n_points)) < 0.8
    image, target = np.nonzero(seen)
    blocks = {
        "point": points[target],
        "camera.centre": places[image],
        "camera.rotation": rotations[image],
        "calibration": camera,
    }
    batch = system.add(NAME, blocks, np.zeros((len(image), 2)), 1e-3)
    batch.observations = system.residuals(batch) + rng.normal(0.0, 1e-3, (len(image), 2))
    system.add_prior(points[:4], cloud[:4], 1e-3)
    system.freeze(points[4:6])
    system.freeze(points[6:8], ("y",))
    system.freeze(places[:1])
    system.freeze(camera, (4, 5, 6, 7, 8, 9))
    system.set_values(places[1:], centres[1:] + rng.normal(0.0, 0.02, (n_images - 1, 3)))
    system.set_values(points[8:], cloud[8:] + rng.normal(0.0, 0.02, (n_points - 8, 3)))
    if eliminated:
        system.eliminate(points)
    return system, points, places, rotations, camera, batch


def test_the_same_solution_residuals_and_covariances():
    whole, points, places, rotations, camera, batch = bundle(False)
    reduced, *_, same = bundle(True)
    assert reduced.equations(reduced=True).pattern.n == 4 * 3 + 5 * 3 + 4
    assert reduced.equations(reduced=True).n_unknowns == whole.equations().n_unknowns
    first, second = whole.solve(covariance="all"), reduced.solve(covariance="all")
    assert first.converged
    assert second.converged
    assert second.redundancy == first.redundancy
    assert second.n_unknowns == first.n_unknowns
    assert second.sigma0 == pytest.approx(first.sigma0, rel=1e-9)
    for ids in (points, places, rotations, camera):
        assert second.values(ids) == pytest.approx(first.values(ids), abs=1e-8)
        assert second.covariance(ids) == pytest.approx(first.covariance(ids), rel=1e-5, abs=1e-16)
    assert second.residuals(same) == pytest.approx(first.residuals(batch), abs=1e-9)


def test_each_iteration_is_the_same():
    whole, reduced = bundle(False)[0], bundle(True)[0]
    first, second = whole.solve(max_iterations=3), reduced.solve(max_iterations=3)
    for one, other in zip(first.iterations, second.iterations, strict=True):
        assert other.max_step == pytest.approx(one.max_step, rel=1e-6, abs=1e-12)
        assert other.length == pytest.approx(one.length, rel=1e-6)
        assert other.cost == pytest.approx(one.cost, rel=1e-8)


def test_the_reduced_matrix_is_the_schur_complement():
    whole, points, *_ = bundle(False, seed=3)
    reduced = bundle(True, seed=3)[0]
    full, small = whole.equations(), reduced.equations(reduced=True)
    normal = full.pattern.matrix(full.assemble().values.copy()).toarray()
    gradient = full.assemble().gradient
    gone = np.isin(full.free.scalars, whole.unknowns.scalars(points))
    inverse = np.linalg.inv(normal[np.ix_(gone, gone)])
    coupling = normal[np.ix_(~gone, gone)]
    found = small.assemble()
    expected = normal[np.ix_(~gone, ~gone)] - coupling @ inverse @ coupling.T
    scale = np.sqrt(np.diag(expected))
    gap = small.pattern.matrix(found.values).toarray() - expected
    assert np.abs(gap / np.outer(scale, scale)).max() < 1e-9
    right = gradient[~gone] - coupling @ inverse @ gradient[gone]
    assert found.gradient == pytest.approx(right, rel=1e-8, abs=1e-8 * np.abs(right).max())
    assert found.eliminated == pytest.approx(gradient[gone] @ inverse @ gradient[gone], rel=1e-9)


def test_blocks_of_all_sizes_are_eliminated():
    """Scalars and vectors, partly frozen, in both orders of arguments."""
    values = []
    for eliminated in (False, True):
        rng = np.random.default_rng(11)
        system = LeastSquares()
        kept = system.add_vectors(["a", "b", "c"], np.zeros((3, 4)))
        loose = system.add_vectors([f"t{k}" for k in range(6)], np.zeros((6, 5)))
        single = system.add_scalars(["s0", "s1"], [0.0, 0.0])
        n = 120
        a, t = rng.integers(0, 3, n), rng.integers(0, 6, n)
        one, other = rng.normal(size=(n, 4)), rng.normal(size=(n, 5))
        system.add_linear([kept[a], loose[t]], [one, other], rng.normal(size=n), 0.5)
        system.add_linear([loose[t], kept[a]], [other[::-1], one], rng.normal(size=n), 0.5)
        s = rng.integers(0, 2, n)
        system.add_linear([single[s], kept[a]], [rng.normal(size=(n, 1)), one], rng.normal(size=n), 0.7)
        system.freeze(loose[:2], (1, 3))
        if eliminated:
            system.eliminate(np.concatenate([loose, single]))
        result = system.solve()
        values.append(np.concatenate([result.values(ids).ravel() for ids in (kept, loose, single)]))
    assert values[1] == pytest.approx(values[0], abs=1e-10)


def test_everything_but_the_temporaries_frozen():
    system, points, places, rotations, camera, _ = bundle(True)
    other = bundle(False)[0]
    for each in (system, other):
        for ids in (places, rotations, camera):
            each.freeze(ids)
    first, second = other.solve(covariance="all"), system.solve(covariance="all")
    assert second.converged
    assert second.values(points) == pytest.approx(first.values(points), abs=1e-9)
    assert second.covariance(points) == pytest.approx(first.covariance(points), rel=1e-6, abs=1e-16)


def test_damping_is_that_of_the_whole_system():
    whole, reduced = bundle(False)[0], bundle(True)[0]
    full, small = whole.equations(), reduced.equations(reduced=True)
    found, damped = full.assemble(0.3), small.assemble(0.3)
    normal = full.pattern.matrix(found.values).toarray()
    small_normal = small.pattern.matrix(damped.values).toarray()
    step = full.step(np.linalg.solve(normal, -found.gradient), found)
    assert small.step(np.linalg.solve(small_normal, -damped.gradient), damped) == pytest.approx(
        step, abs=1e-10
    )


def test_poses_are_eliminated_as_groups_of_two_blocks():
    whole, points, places, rotations, camera, _ = bundle(False, seed=4)
    reduced = bundle(False, seed=4)[0]
    reduced.eliminate(places)
    reduced.eliminate(rotations)
    groups = reduced.equations(reduced=True).layout.groups
    assert sorted(np.diff(groups.block_bounds)) == [1, 2, 2, 2, 2]
    first, second = whole.solve(covariance="all"), reduced.solve(covariance="all")
    assert second.converged
    assert second.redundancy == first.redundancy
    for ids in (points, places, rotations, camera):
        assert second.values(ids) == pytest.approx(first.values(ids), abs=1e-8)


def test_blocks_that_hang_together_are_one_group():
    values = []
    for eliminated in (False, True):
        system, points, rotations, lengths, batches = mixed_system(9)
        system.problem._batches.remove(batches.pop())
        system.add_prior(points, system.values(points), 0.5)
        system.add_prior(lengths, system.values(lengths), 0.5)
        if eliminated:
            system.eliminate(points)
            system.eliminate(rotations[:3])
            assert len(system.equations(reduced=True).layout.groups.block_bounds) == 2
        result = system.solve(max_iterations=3, tolerance=-1.0)
        values.append(np.concatenate([result.values(points).ravel(), result.values(rotations).ravel()]))
    assert values[1] == pytest.approx(values[0], abs=1e-8)


def test_one_eliminated_block_in_two_arguments():
    values = []
    for eliminated in (False, True):
        rng = np.random.default_rng(8)
        system = LeastSquares()
        a = system.add_vectors(["a"], [[0.0, 0.0]])
        t = system.add_vectors(["t"], [[0.0, 0.0]])
        parts = [rng.normal(size=(9, 2)) for _ in range(3)]
        system.add_linear([t.repeat(9), a.repeat(9), t.repeat(9)], parts, rng.normal(size=9), 1.0)
        if eliminated:
            system.eliminate(t)
        values.append(np.concatenate([system.solve().values(ids) for ids in (a, t)]))
    assert values[1] == pytest.approx(values[0], abs=1e-11)


def test_a_group_that_is_too_large(monkeypatch):
    monkeypatch.setattr("obseq.leastsquares.assembly.schur.LARGEST", 20)
    system, points, *_ = mixed_system()
    system.eliminate(points)
    with pytest.raises(
        InputError, match=r"observations join 12 of the eliminated blocks \(P0, P1, P2, \.\.\.\)"
    ):
        system.solve()


def test_a_temporary_that_its_observations_do_not_determine():
    system = LeastSquares()
    a = system.add_vectors(["a"], [[0.0, 0.0]])
    t = system.add_vectors(["t"], [[0.0, 0.0]])
    ones = np.ones((3, 2))
    system.add_linear([a[[0, 0, 0]], t[[0, 0, 0]]], [np.eye(3, 2), ones], [1.0, 2.0, 3.0], 1.0)
    system.eliminate(t)
    with pytest.raises(
        SingularSystemError, match=r"t\.1 is to be eliminated, .* do not determine it"
    ) as error:
        system.solve()
    assert error.value.unknowns == ("t.1",)
