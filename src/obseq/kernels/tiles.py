"""Tiles: the records that kernels work on, and the compiled drivers that fill, run and read them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.compilation import Instruction, compiled
from obseq.kernels.layout import LANES, STRIDE

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows

call_address = Instruction("obseq.kernels.instructions", "call_address")
pointer_to = Instruction("obseq.kernels.instructions", "pointer_to")


@compiled
def call_kernel(address: int, tiles: FloatArray, n_tiles: int) -> None:
    """Runs the kernel at an address on the first tiles of an aligned array."""
    call_address(address, pointer_to(tiles, 0), n_tiles)


def aligned_tiles(n_rows: int, n_tiles: int, constants: tuple[tuple[int, float], ...] = ()) -> FloatArray:
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


@compiled(always_inline=True)
def _fill(tiles: FloatArray, at: int, rows: FloatRows, start: int) -> None:
    """Copies rows to the lanes of a tile, the last row again and again where there are no more."""
    last = len(rows) - 1
    for lane in range(LANES):
        row = min(start + lane, last)
        for i in range(rows.shape[1]):
            tiles[at + i * STRIDE + lane] = rows[row, i]


@compiled(always_inline=True)
def _read(tiles: FloatArray, at: int, rows: FloatRows, start: int) -> None:
    """Copies the lanes of a tile to rows, as many as there are."""
    for lane in range(min(LANES, len(rows) - start)):
        for i in range(rows.shape[1]):
            rows[start + lane, i] = tiles[at + i * STRIDE + lane]


@compiled
def evaluate(
    address: int,
    tiles: FloatArray,
    n_rows: int,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
    derivatives: FloatRows,
) -> None:
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
        call_kernel(address, tiles, n_tiles)
        for k in range(n_tiles):
            _read(tiles, k * tile_size + residuals, values, start + k * LANES)
            _read(tiles, k * tile_size + derived, derivatives, start + k * LANES)
