"""Tiles: the records that kernels work on, and the compiled drivers that fill, run and read them."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from obseq.kernels.layout import LANES, STRIDE

TILES_IN_BATCH = 16
"""Tiles that the drivers work on at a time: enough to hide calls, few enough to stay in cache."""


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


@njit(cache=True, error_model="numpy", nogil=True)
def evaluate(address, tiles, n_rows, unknowns, observations, first, results):  # type: ignore[no-untyped-def]
    """Runs a kernel over rows of arguments, a few tiles at a time, and copies rows of results out.

    Args:
        address: Address of the kernel.
        tiles: Aligned scratch tiles.
        n_rows: Rows of a tile.
        unknowns: (n, n_unknowns).
        observations: (n, n_observations).
        first: First row of the tile to copy out.
        results: (n, n_results), written.
    """
    n = unknowns.shape[0]
    n_unknowns, n_observations, n_results = unknowns.shape[1], observations.shape[1], results.shape[1]
    tile_size = n_rows * STRIDE
    batch = (tiles.size // tile_size) * LANES
    for start in range(0, n, batch):
        count = min(batch, n - start)
        n_tiles = (count + LANES - 1) // LANES
        for k in range(n_tiles):
            at, row = k * tile_size, start + k * LANES
            for lane in range(LANES):
                source = min(row + lane, n - 1)
                for i in range(n_unknowns):
                    tiles[at + i * STRIDE + lane] = unknowns[source, i]
                for i in range(n_observations):
                    tiles[at + (n_unknowns + i) * STRIDE + lane] = observations[source, i]
        _call_address(address, tiles.ctypes.data, n_tiles)
        for k in range(n_tiles):
            at, row = k * tile_size + first * STRIDE, start + k * LANES
            for lane in range(min(LANES, n - row)):
                for i in range(n_results):
                    results[row + lane, i] = tiles[at + i * STRIDE + lane]
