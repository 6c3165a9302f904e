"""Sparse matrices by rows: every product is that of plain arrays, whatever the order of entries."""

import numpy as np
import pytest

from obseq.leastsquares.sparse import Sparse, on_diagonal, stacked


def scattered(n, k, seed):
    """A matrix with entries at random, some twice and some rows without any; the same as a plain array."""
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(0, max(n - 2, 1), 2 * n), rng.integers(0, k, 2 * n)
    values, dense = rng.normal(size=2 * n), np.zeros((n, k))
    np.add.at(dense, (rows, columns), values)
    return Sparse.of_entries(values, rows, columns, (n, k)), dense


@pytest.mark.parametrize(("n", "k", "m"), [(1, 1, 1), (7, 5, 9), (40, 60, 30)])
def test_products_are_those_of_plain_arrays(n, k, m):
    (first, one), (second, two) = scattered(n, k, 1), scattered(k, m, 2)
    assert first.toarray() == pytest.approx(one)
    assert first.T.toarray() == pytest.approx(one.T)
    assert (first @ second).toarray() == pytest.approx(one @ two)
    assert first @ two == pytest.approx(one @ two)
    assert first @ two[:, 0] == pytest.approx(one @ two[:, 0])
    beside = np.random.default_rng(6).normal(size=(n, 3))
    assert first.transposed_times(beside) == pytest.approx(one.T @ beside)
    assert first.transposed_times(beside[:, 0]) == pytest.approx(one.T @ beside[:, 0])
    rows = np.arange(n)[::-2]
    assert first.some(rows).toarray() == pytest.approx(one[rows])
    assert first.scaled(np.arange(n) + 0.5).toarray() == pytest.approx((np.arange(n) + 0.5)[:, None] * one)
    assert first.with_columns_scaled(np.arange(k) + 0.5).toarray() == pytest.approx(
        one * (np.arange(k) + 0.5)
    )
    third, three = scattered(n, k, 3)
    assert first.dots(third) == pytest.approx((one * three).sum(axis=1))
    assert first.dots(first) == pytest.approx((one * one).sum(axis=1))


def test_matrices_are_put_together_along_a_diagonal_and_below_each_other():
    blocks = np.random.default_rng(4).normal(size=(3, 2, 2))
    (other, dense), parts = scattered(4, 6, 5), Sparse.of_blocks(blocks)
    whole = np.zeros((10, 12))
    for k, block in enumerate(blocks):
        whole[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = block
    assert parts.diagonal() == pytest.approx(np.diag(whole[:6, :6]))
    assert stacked([parts, other]).toarray() == pytest.approx(np.vstack([whole[:6, :6], dense]))
    whole[6:, 6:] = dense
    assert on_diagonal([parts, other]).toarray() == pytest.approx(whole)
    assert on_diagonal([]).shape == (0, 0)
    assert Sparse.of_diagonal(np.arange(3.0)).toarray() == pytest.approx(np.diag(np.arange(3.0)))
    assert Sparse.of_dense(dense).toarray() == pytest.approx(dense)


def test_matrices_that_do_not_fit_have_no_product():
    with pytest.raises(ValueError, match=r"\(2, 2\) and \(3, 3\)"):
        Sparse.of_dense(np.eye(2)) @ np.eye(3)
