"""Threads of ours share the factorisation of a whole matrix: the factor is the same but for rounding."""

import numpy as np
import pytest

from obseq.leastsquares.solvers import SingularMatrixError, SymmetricPattern
from obseq.leastsquares.solvers.dense import DenseCholesky
from obseq.leastsquares.solvers.dense_threads import factor_in_threads


def matrix_of(n, seed=0):
    """A regular symmetric matrix."""
    root = np.random.default_rng(seed).normal(size=(n, n + 3))
    return root @ root.T


@pytest.fixture
def small_steps(monkeypatch):
    monkeypatch.setattr("obseq.leastsquares.solvers.dense_threads.PANEL", 16)
    monkeypatch.setattr("obseq.leastsquares.solvers.dense.LEAST", 1)


@pytest.mark.parametrize("n", [1, 15, 16, 17, 70, 100])
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_factor(n, threads, small_steps):
    matrix = matrix_of(n)
    columns = matrix.flatten()
    assert factor_in_threads(columns, n, threads) == 0
    found = np.tril(columns.reshape(n, n).T)
    np.testing.assert_allclose(found, np.linalg.cholesky(matrix), rtol=0, atol=1e-9)


def test_the_same_digits_at_each_run(small_steps):
    columns = matrix_of(90).ravel()
    first, second = columns.copy(), columns.copy()
    factor_in_threads(first, 90, 3)
    factor_in_threads(second, 90, 3)
    np.testing.assert_array_equal(first, second)


def test_a_singular_matrix_is_treated_as_with_one_thread(small_steps):
    matrix = matrix_of(80)
    matrix[40] = matrix[:, 40] = 0.0
    found = []
    for threads in (1, 2):
        pattern, values = SymmetricPattern.of(matrix)
        solver = DenseCholesky(threads)
        solver.analyse(pattern)
        with pytest.raises(SingularMatrixError) as error:
            solver.factor(values)
        found.append(error.value.indices)
    np.testing.assert_array_equal(found[0], [40])
    np.testing.assert_array_equal(found[0], found[1])
