"""Shares of the observations by threads: the same equations as one thread, and the same at each run."""

import os
import subprocess
import sys

import numpy as np
import pytest
from networks import mixed_system

from obseq.errors import DivergenceError, InputError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.assembly import threads
from obseq.leastsquares.assembly.evaluation import raw_residuals
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.solvers.blas import loaded, one_blas_thread, routine_addresses


@pytest.fixture
def tiny_shares(monkeypatch):
    """Shares even where there are few observations."""
    monkeypatch.setattr(threads, "LEAST_SHARE", 1)


def equations_of(system, n_threads, eliminated=None):
    return NormalEquations(system.unknowns, system.batches, system.priors, eliminated, threads=n_threads)


def freeze_some(system, points, rotations):
    system.freeze(points[:3])
    system.freeze(points[3:5], ("x", 2))
    system.freeze(rotations[2:6], ("x", "y"))


def assert_same(found, expected):
    scale = np.abs(expected.values).max()
    assert np.abs(found.values - expected.values).max() < 1e-14 * scale
    assert np.abs(found.gradient - expected.gradient).max() < 1e-13 * np.abs(expected.gradient).max()
    assert found.cost == pytest.approx(expected.cost, rel=1e-14)


@pytest.mark.parametrize("n_threads", [2, 3, 7])
@pytest.mark.parametrize("is_frozen", [False, True])
def test_threads_assemble_the_equations_of_one(tiny_shares, n_threads, is_frozen):
    system, points, rotations, *_ = mixed_system(5, n=12)
    if is_frozen:
        freeze_some(system, points, rotations)
    expected = equations_of(system, 1).assemble()
    shared = equations_of(system, n_threads)
    assert len(shared._shares) == n_threads
    assert len(shared._shares.moves) > 0
    assert_same(shared.assemble(), expected)
    assert_same(shared.assemble(), expected)  # what was added up is cleared


def test_threads_do_not_race(tiny_shares):
    system, *_ = mixed_system(6, n=40)
    shared = equations_of(system, 4)
    first = shared.assemble()
    values, gradient = first.values.copy(), first.gradient.copy()
    for _ in range(50):
        again = shared.assemble()
        assert np.array_equal(values, again.values)
        assert np.array_equal(gradient, again.gradient)


def test_each_pair_of_points_in_another_share(tiny_shares):
    """Neighbouring 3 x 3 blocks of the matrix belong to different threads: none writes over another's."""
    n = 200
    system = LeastSquares()
    rng = np.random.default_rng(0)
    points = system.add_points([f"P{k}" for k in range(n)], rng.uniform(0.0, 9.0, (n, 3)))
    first, second = np.triu_indices(n, 1)
    order = rng.permutation(len(first))
    ends = {"p1": points[first[order]], "p2": points[second[order]]}
    system.add("Dist3D", ends, rng.uniform(1.0, 9.0, len(first)), 0.1)
    expected = equations_of(system, 1).assemble()
    shared = equations_of(system, 8)
    for _ in range(20):
        assert_same(shared.assemble(), expected)


def test_threads_with_eliminated_blocks(tiny_shares):
    system, *_ = mixed_system(7, n=12)
    lengths = system.ids(["d0", "d1"], "Scalar")
    eliminated = np.zeros(len(system.unknowns), dtype=bool)
    eliminated[lengths] = True
    one, shared = equations_of(system, 1, eliminated), equations_of(system, 3, eliminated)
    expected, found = one.assemble(0.01), shared.assemble(0.01)
    assert_same(found, expected)
    assert found.eliminated == pytest.approx(expected.eliminated, rel=1e-13)
    solved = np.linspace(-1.0, 1.0, one.pattern.n)
    assert np.allclose(shared.step(solved, found), one.step(solved, expected), rtol=1e-12, atol=0.0)


def test_residuals_by_threads_are_identical(tiny_shares):
    system, *_, batches = mixed_system(8)
    for batch in batches:
        alone, shared = raw_residuals(system.unknowns, batch), raw_residuals(system.unknowns, batch, 3)
        assert np.array_equal(alone, shared)


def test_an_undefined_equation_of_a_later_share_is_named(tiny_shares):
    system, *_, batches = mixed_system(9)
    expected = equations_of(system, 1).assemble()
    end, start = batches[0].blocks[1, -1:], batches[0].blocks[0, -1:]
    right = system.values(end)
    shared = equations_of(system, 3)
    system.set_values(end, system.values(start))
    with pytest.raises(DivergenceError, match="Dist3D"):
        shared.assemble()
    system.set_values(end, right)
    assert_same(shared.assemble(), expected)


def test_an_interrupted_assembly_leaves_nothing_behind(tiny_shares, monkeypatch):
    system, *_ = mixed_system(10)
    shared = equations_of(system, 3)
    expected = equations_of(system, 1).assemble()
    room = shared._room

    def interrupted(share, batch, table):
        if batch is shared.batches[2]:
            raise KeyboardInterrupt
        return room(share, batch, table)

    monkeypatch.setattr(shared, "_room", interrupted)
    with pytest.raises(KeyboardInterrupt):
        shared.assemble()
    monkeypatch.undo()
    assert_same(shared.assemble(), expected)


def test_small_systems_have_one_share():
    assert len(threads.share_bounds([100, 2000], 8)) == 2
    assert len(threads.share_bounds([40_000, 2000], 8)) == 6
    assert np.array_equal(threads.share_bounds([40_000, 33], 2), [[0, 0], [20_000, 32], [40_000, 33]])


@pytest.mark.parametrize("is_constrained", [False, True])
def test_solution_and_covariances_of_two_threads(tiny_shares, is_constrained):
    results = []
    for n_threads in (1, 2):
        system = LeastSquares("supernodal", threads=n_threads)
        rng = np.random.default_rng(11)
        places = rng.uniform(0.0, 100.0, (30, 3))
        points = system.add_points([f"P{k}" for k in range(30)], places + rng.normal(0.0, 0.01, (30, 3)))
        first, second = np.triu_indices(30, 1)
        lengths = np.linalg.norm(places[second] - places[first], axis=1)
        system.add("Dist3D", {"p1": points[first], "p2": points[second]}, lengths, 0.001)
        system.add_prior(points[:3], places[:3], 0.001)
        if is_constrained:
            system.share(points[[4, 5]], ("z",))
        found = system.solve(covariance="all")
        results.append((found.values(points), found.covariance(points), found.n_unknowns))
    one, two = results
    assert one[2] == two[2] == 90 - is_constrained
    assert np.allclose(one[0], two[0], rtol=0.0, atol=1e-10)
    assert np.allclose(one[1], two[1], rtol=1e-8, atol=1e-14)


def test_a_number_of_threads_that_is_none():
    with pytest.raises(InputError, match="0 threads"):
        LeastSquares(threads=0)


def test_one_thread_is_one_of_blas_too():
    """Of SciPy's and of NumPy's."""
    if not loaded():
        pytest.skip(reason="neither SciPy nor NumPy is built on its own OpenBLAS here")
    seen = []
    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    system.add_linear([x], [[[1.0]]], [2.0], 1.0)
    routine_addresses()
    before = blas_threads()
    system.solve(progress=lambda _: seen.append(blas_threads()))
    assert {number for numbers in seen for number in numbers} == {1}
    assert blas_threads() == before


def blas_threads():
    return [get() for get, _ in loaded().values()]


def test_a_library_that_is_loaded_later_is_held_as_well():
    """Loading SciPy's takes 20 ms: no small system waits for it. Once loaded, it has one thread."""
    code = """if True:
        from obseq.leastsquares.solvers.blas import loaded, one_blas_thread, routine_addresses
        with one_blas_thread():
            print("scipy" in loaded())
            routine_addresses()
            print(*{name: get() for name, (get, _) in loaded().items()}.values())
        print(*(get() for get, _ in loaded().values()))
    """
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "2"}
    command = [sys.executable, "-c", code]
    lines = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
    if "scipy" not in loaded() or "numpy" not in loaded():
        pytest.skip(reason="SciPy or NumPy is not built on its own OpenBLAS here")
    assert lines.splitlines() == ["False", "1 1", "2 2"]


def test_the_last_block_that_is_left_gives_the_threads_back():
    """Blocks of two threads of Python's need not end in the reverse order."""
    before = blas_threads()
    first, second = one_blas_thread(), one_blas_thread()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert set(blas_threads()) <= {1}
    second.__exit__(None, None, None)
    assert blas_threads() == before
