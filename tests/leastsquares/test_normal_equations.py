"""Normal equations of one adjustment as observations of another."""

import numpy as np
import pytest

from obseq import InputError
from obseq.leastsquares import LeastSquares


def two_parts(seed=0):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(size=(20, 5)), rng.normal(size=(15, 5))
    return first, rng.normal(size=20), second, rng.normal(size=15)


def blocks(system):
    points = system.add_points(["A"], [[0.0, 0.0, 0.0]])
    return np.concatenate([points, system.add_vectors(["v"], [[0.0, 0.0]])])


def rows(system, ids, design, values):
    n = len(values)
    return system.add_linear(
        [ids[:1].repeat(n), ids[1:].repeat(n)], [design[:, :3], design[:, 3:]], values, 1.0
    )


def test_adjusting_in_two_steps_is_adjusting_at_once():
    first, one, second, two = two_parts()
    whole, steps = LeastSquares(), LeastSquares()
    ids, same = blocks(whole), blocks(steps)
    rows(whole, ids, first, one)
    rows(whole, ids, second, two)
    steps.add_normal_equations(same, first.T @ first, first.T @ one)
    rows(steps, same, second, two)
    expected, found = whole.solve(covariance=True), steps.solve(covariance=True)
    for k in range(2):
        assert found.values(same[[k]]) == pytest.approx(expected.values(ids[[k]]), abs=1e-12)
        covariance = expected.covariance(ids[[k]], a_priori=True)
        assert found.covariance(same[[k]], a_priori=True) == pytest.approx(covariance, rel=1e-10)
    assert found.redundancy == 5 + 15 - 5


def test_what_a_matrix_leaves_free_gives_no_row():
    system = LeastSquares()
    ids = system.add_vectors(["v"], [[0.0, 0.0, 0.0]])
    batch = system.add_normal_equations(ids, np.diag([4.0, 0.0, 9.0]), [8.0, 0.0, -9.0])
    assert len(batch) == 2
    system.freeze(ids, (1,))
    assert system.solve().values(ids)[0] == pytest.approx([2.0, 0.0, -1.0])


@pytest.mark.parametrize("matrix", [[[1.0, 0.5], [0.0, 1.0]], [[1.0, 0.0], [0.0, -1.0]]])
def test_a_matrix_that_is_none(matrix):
    system = LeastSquares()
    ids = system.add_vectors(["v"], [[0.0, 0.0]])
    with pytest.raises(InputError, match="symmetric and positive semi-definite"):
        system.add_normal_equations(ids, matrix, [0.0, 0.0])
