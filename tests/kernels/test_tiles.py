"""Tiles: aligned, prefilled, and filled lane by lane."""

import numpy as np
import pytest

from obseq.kernels import calculator, derivatives, load
from obseq.kernels.layout import LANES, STRIDE
from obseq.kernels.tiles import aligned_tiles, call_kernel, fill_lanes, read_lanes


@pytest.mark.parametrize(("rows", "n_tiles"), [(1, 1), (14, 3), (29, 16), (101, 2)])
def test_tiles_are_aligned(rows: int, n_tiles: int) -> None:
    tiles = aligned_tiles(rows, n_tiles)
    assert tiles.ctypes.data % 64 == 0
    assert tiles.shape == (rows * n_tiles * STRIDE,)
    assert not tiles.any()


def test_constant_rows_are_prefilled() -> None:
    tiles = aligned_tiles(4, 3, ((1, 2.5), (3, -1.0))).reshape(3, 4, STRIDE)
    assert (tiles[:, 1] == 2.5).all() and (tiles[:, 3] == -1.0).all()
    assert not tiles[:, [0, 2]].any()


def test_rows_follow_the_layout() -> None:
    """A 3-4-12 box has the diagonal 13: rows 0-5 are the points, 6 the distance, 7 the residual."""
    kernel = load("Dist3D")
    tiles = aligned_tiles(kernel.rows, 2)
    rows = tiles.reshape(2, kernel.rows, STRIDE)
    rows[1, 3:6, 5] = (3.0, 4.0, 12.0)
    rows[1, 6, 5] = 12.5
    call_kernel(kernel.value_and_jacobian_address, tiles, 2)
    assert rows[1, 7, 5] == 0.5
    np.testing.assert_allclose(rows[1, 8:14, 5], np.array([-3, -4, -12, 3, 4, 12]) / 13, rtol=1e-15)


@pytest.mark.parametrize("n", [1, 2, LANES - 1, LANES, LANES + 1, 16 * LANES, 5 * LANES + 7, 3001])
def test_any_number_of_rows(n: int) -> None:
    """Each row is computed alone, wherever it falls in the tiles."""
    formula = calculator("TopoHz")
    u, o = derivatives.draw(formula.kernel, n, np.random.default_rng(n))
    values, jacobian = formula.values_and_jacobian(u, o)
    assert values.shape == (n, 1) and jacobian.shape == (n, 1, 9)
    for k in {0, n // 2, n - 1}:
        alone, alone_jacobian = formula.values_and_jacobian(u[k : k + 1], o[k : k + 1])
        np.testing.assert_array_equal(values[k], alone[0])
        np.testing.assert_array_equal(jacobian[k], alone_jacobian[0])
    np.testing.assert_allclose(formula.values(u, o), values, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize(("n", "ahead"), [(LANES, 0), (LANES - 3, 0), (LANES - 2, LANES)])
def test_rows_of_any_width_go_to_lanes_and_back(n: int, ahead: int) -> None:
    for width in range(10):
        rows, tiles = np.random.default_rng(width).normal(size=(n, width)), aligned_tiles(12, 1)
        fill_lanes(tiles, STRIDE, rows, 0, ahead)
        found = tiles.reshape(12, STRIDE)
        np.testing.assert_array_equal(found[1 : 1 + width, :n], rows.T)
        assert not found[[0, *range(1 + width, 12)]].any()
        back = np.full((n, width), 7.0)
        read_lanes(tiles, STRIDE, back, 0)
        np.testing.assert_array_equal(back, rows)
