"""Tiles: the records that kernels work on, and the compiled drivers that fill, run and read them."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from obseq.kernels.layout import LANES, STRIDE


@intrinsic
def _call_address(typing_context: Any, address: Any, base: Any, n_tiles: Any) -> Any:
    """Calls the compiled kernel at an address; the driver needs no recompilation for another kernel."""
    signature = types.void(types.intp, types.intp, types.intp)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kernel = ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer(), ir.IntType(64)])
        pointer = builder.inttoptr(arguments[0], kernel.as_pointer())
        tiles = builder.inttoptr(arguments[1], ir.DoubleType().as_pointer())
        builder.call(pointer, [tiles, arguments[2]])
        return context.get_dummy_value()

    return signature, generate


@njit(error_model="numpy", inline="always")
def call_kernel(address, tiles, n_tiles):  # type: ignore[no-untyped-def]
    """Runs the kernel at an address on the first tiles of an aligned array."""
    _call_address(address, tiles.ctypes.data, n_tiles)


def aligned_tiles(
    n_rows: int, n_tiles: int, constants: tuple[tuple[int, float], ...] = ()
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Zeroed tiles, (n_tiles * n_rows * STRIDE,) float64 on a 64-byte boundary.

    Args:
        n_rows: Rows of a tile.
        n_tiles: Number of tiles.
        constants: (row, value) of the rows that kernels do not write.
    """
    size = n_tiles * n_rows * STRIDE
    raw = np.zeros(size + 8)
    tiles = raw[(-raw.ctypes.data // 8) % 8 :][:size]
    for row, value in constants:
        tiles.reshape(n_tiles, n_rows, STRIDE)[:, row, :] = value
    return tiles


@njit(error_model="numpy", forceinline=True)
def _fill(tiles, at, rows, start):  # type: ignore[no-untyped-def]
    """Copies rows to the lanes of a tile, the last row again and again where there are no more."""
    last = rows.shape[0] - 1
    for lane in range(LANES):
        row = min(start + lane, last)
        for i in range(rows.shape[1]):
            tiles[at + i * STRIDE + lane] = rows[row, i]


@njit(error_model="numpy", forceinline=True)
def _read(tiles, at, rows, start):  # type: ignore[no-untyped-def]
    """Copies the lanes of a tile to rows, as many as there are."""
    for lane in range(min(LANES, rows.shape[0] - start)):
        for i in range(rows.shape[1]):
            rows[start + lane, i] = tiles[at + i * STRIDE + lane]


@njit(cache=True, error_model="numpy", nogil=True)
def evaluate(address, tiles, n_rows, unknowns, observations, values, derivatives):  # type: ignore[no-untyped-def]
    """Runs a kernel over rows of arguments, a few tiles at a time, and copies rows of results out.

    Args:
        address: Address of the kernel.
        tiles: Aligned scratch tiles.
        n_rows: Rows of a tile.
        unknowns: (n, n_unknowns).
        observations: (n, n_observations), or what else the kernel reads after the unknowns.
        values: (n, n_residuals), written.
        derivatives: (n, what the kernel writes after the residuals), written.
    """
    tile_size = n_rows * STRIDE
    most = tiles.size // tile_size
    observed = unknowns.shape[1] * STRIDE
    residuals = observed + observations.shape[1] * STRIDE
    derived = residuals + values.shape[1] * STRIDE
    for start in range(0, unknowns.shape[0], most * LANES):
        n_tiles = min(most, (unknowns.shape[0] - start + LANES - 1) // LANES)
        for k in range(n_tiles):
            _fill(tiles, k * tile_size, unknowns, start + k * LANES)
            _fill(tiles, k * tile_size + observed, observations, start + k * LANES)
        _call_address(address, tiles.ctypes.data, n_tiles)
        for k in range(n_tiles):
            _read(tiles, k * tile_size + residuals, values, start + k * LANES)
            _read(tiles, k * tile_size + derived, derivatives, start + k * LANES)
