"""The pattern of a symmetric matrix."""

import numpy as np
import pytest
import scipy.sparse as sp

from obseq.errors import InputError
from obseq.leastsquares.solvers import SymmetricPattern


def test_pattern_of_a_matrix_holds_the_lower_triangle_and_the_whole_diagonal():
    matrix = np.array([[4.0, 1.0, 0.0], [1.0, 0.0, 2.0], [0.0, 2.0, 5.0]])
    pattern, values = SymmetricPattern.of(matrix)
    np.testing.assert_array_equal(pattern.indptr, [0, 2, 4, 5])
    np.testing.assert_array_equal(pattern.indices, [0, 1, 1, 2, 2])
    np.testing.assert_array_equal(values, [4.0, 1.0, 0.0, 2.0, 5.0])
    np.testing.assert_array_equal(pattern.diagonal, [0, 2, 4])
    np.testing.assert_array_equal(pattern.columns(), [0, 0, 1, 1, 2])
    assert pattern.nnz == 5


@pytest.mark.parametrize("kind", [np.asarray, sp.csc_array, sp.csr_array, sp.coo_array])
def test_matrix_and_pattern_go_both_ways(build, kind):
    matrix = build.survey(10)
    pattern, values = SymmetricPattern.of(kind(matrix))
    np.testing.assert_array_equal(pattern.matrix(values).toarray(), matrix)


def test_empty_pattern():
    assert SymmetricPattern(0, np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int32)).nnz == 0


@pytest.mark.parametrize(
    ("n", "indptr", "indices", "message"),
    [
        (2, [0, 1], [0], "indptr"),
        (2, [0, 1, 3], [0, 1], "indptr"),
        (2, [0, 1, 1], [0], "diagonal"),
        (2, [0, 1, 2], [0, 0], "diagonal"),
        (3, [0, 3, 4, 5], [0, 2, 1, 1, 2], "ascending"),
        (2, [0, 2, 3], [0, 2, 1], "below n"),
        (2, [0, 3, 4], [0, 1, 1, 1], "repetition"),
    ],
)
def test_malformed_patterns_are_refused(n, indptr, indices, message):
    with pytest.raises(InputError, match=message):
        SymmetricPattern(n, np.array(indptr), np.array(indices))


def test_indices_must_be_integers():
    with pytest.raises(InputError, match="integers"):
        SymmetricPattern(1, np.array([0, 1]), np.array([0.0]))
