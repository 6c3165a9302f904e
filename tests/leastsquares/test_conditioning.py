"""The condition number against that of the dense matrix."""

import numpy as np
import pytest

from obseq.leastsquares import LeastSquares
from obseq.leastsquares.solvers import SingularMatrixError
from obseq.leastsquares.statistics.conditioning import condition_number


def line(shift):
    """y = a + b x for x around a shift: the farther, the harder to tell a from b."""
    x = np.linspace(-1.0, 1.0, 20) + shift
    system = LeastSquares()
    ids = system.add_vectors(["line"], [[0.0, 0.0]])
    design = np.column_stack([np.ones(20), x])
    system.add_linear([ids.repeat(20)], [design], np.zeros(20), 0.1)
    return system, design.T @ design / 0.01


@pytest.mark.parametrize("shift", [0.0, 1.0, 30.0, 1e4])
@pytest.mark.parametrize("scaled", [True, False])
def test_it_is_that_of_the_matrix(shift, scaled):
    system, normal = line(shift)
    if scaled:
        root = np.sqrt(np.diag(normal))
        normal = normal / np.outer(root, root)
    assert condition_number(system, scaled) == pytest.approx(np.linalg.cond(normal), rel=1e-2)


def test_it_does_not_depend_on_units_when_scaled():
    rng = np.random.default_rng(0)
    design, found = rng.normal(size=(60, 4)), []
    for unit in (1.0, 1e6):
        system = LeastSquares()
        ids = system.add_vectors(["v"], np.zeros((1, 4)))
        system.add_linear([ids.repeat(60)], [design * [1.0, unit, 1.0, 1.0]], np.zeros(60), 1.0)
        found.append(condition_number(system))
    assert found[1] == pytest.approx(found[0], rel=1e-2)


@pytest.mark.parametrize("n", [1, 2, 19, 20, 21, 60])
def test_a_line_of_height_differences(n):
    # From a known height to the next, and so on: N is tridiagonal, 2 on its diagonal, 1 at its end;
    # its eigenvalues are 4 sin^2((2 k - 1) pi / (4 n + 2)), k = 1 ... n.
    system = LeastSquares()
    heights = system.add_scalars([f"h{k}" for k in range(n)], np.zeros(n))
    system.add_linear([heights[:1]], [np.ones((1, 1))], [0.0], 1.0)
    if n > 1:
        one = np.ones((n - 1, 1))
        system.add_linear([heights[:-1], heights[1:]], [-one, one], np.zeros(n - 1), 1.0)
    sines = np.sin((2 * np.array([1, n]) - 1) * np.pi / (4 * n + 2))
    assert condition_number(system, scaled=False) == pytest.approx((sines[1] / sines[0]) ** 2, rel=2e-3)


def test_a_singular_matrix_has_none():
    system = LeastSquares()
    ids = system.add_vectors(["v"], [[0.0, 0.0]])
    system.add_linear([ids.repeat(3)], [np.ones((3, 2))], np.zeros(3), 1.0)
    with pytest.raises(SingularMatrixError):
        condition_number(system)
