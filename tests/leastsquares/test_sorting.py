"""Numbers sorted by counting, and distinct pairs."""

import numpy as np

from obseq.leastsquares.loops.sorting import as_indices, distinct_pairs, sorted_by


def test_items_are_sorted_and_those_of_negative_numbers_left_out():
    order, bounds = sorted_by(as_indices(np.array([2, 0, -1, 2, 0, 3])), 5)
    assert order.tolist() == [1, 4, 0, 3, 5]
    assert bounds.tolist() == [0, 2, 2, 4, 5, 5]


def test_equal_numbers_keep_the_given_order():
    numbers, given = as_indices(np.array([1, 0, 1, 0])), as_indices(np.array([3, 2, 1, 0]))
    assert sorted_by(numbers, 2, given)[0].tolist() == [3, 1, 2, 0]


def test_nothing_to_sort():
    order, bounds = sorted_by(as_indices(np.array([], dtype=np.int64)), 0)
    assert order.tolist() == [] and bounds.tolist() == [0]


def test_distinct_pairs_are_those_that_numpy_finds():
    rng = np.random.default_rng(1)
    first, second = rng.integers(-1, 6, 200), rng.integers(0, 9, 200)
    found = distinct_pairs(as_indices(first), as_indices(second), 7, 9)
    expected, inverse = np.unique(np.array([first, second])[:, first >= 0], axis=1, return_inverse=True)
    assert np.array_equal([found.first, found.second], expected)
    assert np.array_equal(found.number[first >= 0], inverse)
    assert (found.number[first < 0] == -1).all()
    leads = [np.flatnonzero(found.number == k)[0] for k in range(expected.shape[1])]
    assert np.array_equal(found.leaders, leads)
    assert np.array_equal(found.starts, np.searchsorted(found.first, np.arange(8)))
