"""Tiles: the records that kernels work on, and the compiled loops that fill, run and read them."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, FloatCubes, FloatRows, IntArray
from obseq.compilation import Instruction, compiled
from obseq.kernels.layout import LANES, STRIDE
from obseq.kernels.vectors import transpose4

call_address = Instruction("obseq.kernels.instructions", "call_address")
U = np.uint64
ROW, TWO, THREE, FOUR = U(STRIDE), U(2), U(3), U(4)

pointer_to = Instruction("obseq.kernels.instructions", "pointer_to")
ask_for, stream, finish_streams = (
    Instruction("obseq.kernels.memory_instructions", name) for name in ("ask_for", "stream", "finish_streams")
)
rows_of = Instruction("obseq.kernels.array_instructions", "rows_of")
split_ones, split_twos, split_threes, join_ones, join_twos, join_threes = (
    Instruction("obseq.kernels.array_instructions", f"{what}_{width}")
    for what in ("split", "join")
    for width in ("ones", "twos", "threes")
)


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
    if constants:
        rows, values = zip(*constants, strict=True)
        tiles.reshape(n_tiles, n_rows, STRIDE)[:, rows, :] = np.array(values)[:, None]
    return tiles


@compiled
def fill_lanes(tiles: FloatArray, at: int, rows: FloatRows, start: int, ahead: int) -> None:
    """Copies rows to the lanes of a tile; where there are no more rows, lanes stay as they are.

    Rows so many `ahead` are asked for meanwhile, for arguments that no cache holds; none if it is 0.
    """
    width, lanes = rows.shape[1], min(LANES, len(rows) - start)
    whole, step = lanes // 4 * 4, U(width)
    for quad in range(0, width, 4):
        ask_for(rows, (start + ahead) * width + quad * LANES, min(width - quad, 4) * LANES if ahead else 0)
        if width < 4:
            fill_narrow(tiles, at, rows, start, whole)
            continue
        i = min(quad, width - 4)
        place, a = U(at + i * STRIDE), U(start * width + i)
        for _ in range(0, whole, 4):
            transpose4(rows, a, a + step, a + TWO * step, a + THREE * step, tiles, place, ROW)
            place, a = place + FOUR, a + FOUR * step
    for i in range(width):
        for lane in range(whole, lanes):
            tiles[at + i * STRIDE + lane] = rows[start + lane, i]


@compiled
def fill_narrow(tiles: FloatArray, at: int, rows: FloatRows, start: int, lanes: int) -> None:
    """Copies rows of at most three columns to lanes of a tile, of a multiple of four."""
    width = rows.shape[1]
    for lane in range(0, lanes, 4):
        place, a = U(at + lane), U((start + lane) * width)
        if width == 1:
            split_ones(rows, a, tiles, place, ROW)
        elif width == 2:
            split_twos(rows, a, tiles, place, ROW)
        else:
            split_threes(rows, a, tiles, place, ROW)


@compiled
def read_lanes(tiles: FloatArray, at: int, rows: FloatRows, start: int) -> None:
    """Copies the lanes of a tile to rows, as many as there are."""
    width, lanes = rows.shape[1], min(LANES, len(rows) - start)
    whole, step = lanes // 4 * 4, U(width)
    for quad in range(0, width, 4):
        if width < 4:
            read_narrow(tiles, at, rows, start, whole)
            continue
        i = min(quad, width - 4)
        a, place = U(at + i * STRIDE), U(start * width + i)
        for _ in range(0, whole, 4):
            transpose4(tiles, a, a + ROW, a + TWO * ROW, a + THREE * ROW, rows, place, step)
            a, place = a + FOUR, place + FOUR * step
    for i in range(width):
        for lane in range(whole, lanes):
            rows[start + lane, i] = tiles[at + i * STRIDE + lane]


@compiled
def read_narrow(tiles: FloatArray, at: int, rows: FloatRows, start: int, lanes: int) -> None:
    """Copies lanes of a tile, of a multiple of four, to rows of at most three columns."""
    width = rows.shape[1]
    for lane in range(0, lanes, 4):
        a, place = U(at + lane), U((start + lane) * width)
        if width == 1:
            join_ones(tiles, a, rows, place, ROW)
        elif width == 2:
            join_twos(tiles, a, rows, place, ROW)
        else:
            join_threes(tiles, a, rows, place, ROW)


@compiled
def evaluate(
    address: int,
    tiles: FloatArray,
    n_rows: int,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
    derivatives: FloatRows,
    first: int,
    last: int,
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
        first: First row of arguments; the others are left alone.
        last: The row after the last one: n, or so many after `first` that they fill all tiles each time.
    """
    tile_size = n_rows * STRIDE
    residuals = (unknowns.shape[1] + observations.shape[1]) * STRIDE
    derived = residuals + values.shape[1] * STRIDE
    for start in range(first, last, tiles.size // tile_size * LANES):
        for k in range(run_tiles(address, tiles, tile_size, unknowns, observations, start, 0)):
            read_lanes(tiles, k * tile_size + residuals, values, start + k * LANES)
            read_lanes(tiles, k * tile_size + derived, derivatives, start + k * LANES)


@compiled
def run_tiles(
    address: int,
    tiles: FloatArray,
    tile_size: int,
    unknowns: FloatRows,
    observations: FloatRows,
    start: int,
    ahead: int,
) -> int:
    """Fills tiles with rows of arguments, from row `start` on, and runs a kernel; how many tiles it took.

    Rows so many `ahead` are asked for meanwhile, for arguments that no cache holds; none if it is 0.
    """
    observed = unknowns.shape[1] * STRIDE
    n_tiles: int = min(tiles.size // tile_size, (unknowns.shape[0] - start + LANES - 1) // LANES)
    for k in range(n_tiles):
        fill_lanes(tiles, k * tile_size, unknowns, start + k * LANES, ahead)
        fill_lanes(tiles, k * tile_size + observed, observations, start + k * LANES, ahead)
    call_kernel(address, tiles, n_tiles)
    return n_tiles


@compiled
def evaluate_to_memory(
    address: int,
    tiles: FloatArray,
    n_rows: int,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
    derivatives: FloatRows,
    first: int,
    last: int,
    rows: FloatRows,
) -> None:
    """Does what `evaluate` does, for derivatives that no cache holds: they go straight to memory.

    Args: those of `evaluate`, and rows: (LANES, what the kernel writes after the residuals), scratch.
    """
    tile_size, width = n_rows * STRIDE, derivatives.shape[1]
    residuals = (unknowns.shape[1] + observations.shape[1]) * STRIDE
    derived = residuals + values.shape[1] * STRIDE
    ahead = tiles.size // tile_size * LANES
    for start in range(first, last, ahead):
        for k in range(run_tiles(address, tiles, tile_size, unknowns, observations, start, ahead)):
            place = start + k * LANES
            read_lanes(tiles, k * tile_size + residuals, values, place)
            read_lanes(tiles, k * tile_size + derived, rows, 0)
            stream(rows, derivatives, place * width, min(LANES, len(derivatives) - place) * width)
    finish_streams()


@compiled
def evaluate_rows(
    address: int,
    tiles: FloatArray,
    n_rows: int,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
    derivatives: FloatRows,
    first: int,
    last: int,
    rows: FloatRows,
) -> None:
    """Either: straight to memory where there are scratch rows, `evaluate` where there are none."""
    if len(rows) == 0:
        evaluate(address, tiles, n_rows, unknowns, observations, values, derivatives, first, last)
    else:
        evaluate_to_memory(
            address, tiles, n_rows, unknowns, observations, values, derivatives, first, last, rows
        )


@compiled
def fits(plan: IntArray, unknowns: FloatRows, observations: FloatRows, values: FloatRows) -> bool:
    """Whether arrays have the shapes of a plan, and no more rows than it takes at once."""
    n = len(unknowns)
    rows = n <= plan[2] and len(observations) == n and len(values) == n
    columns = unknowns.shape[1] == plan[3] and observations.shape[1] == plan[4] and values.shape[1] == plan[5]
    return rows and columns


@compiled(at_once=True)
def evaluate_values(
    plan: IntArray,
    tiles: FloatArray,
    nothing: FloatRows,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
) -> int:
    """Runs a kernel of values over a few rows, if all shapes are as they must be.

    Args:
        plan: Address of the kernel, rows of its tiles, most rows of arguments, numbers of unknowns,
            observations and residuals.
        tiles: Aligned scratch tiles, of this kernel alone.
        nothing: (0, 0), for the derivatives that there are not.
        unknowns: (n, n_unknowns).
        observations: (n, n_observations).
        values: (n, n_residuals), written.

    Returns:
        0, or 1 when it did nothing.
    """
    if not fits(plan, unknowns, observations, values):
        return 1
    evaluate(plan[0], tiles, plan[1], unknowns, observations, values, nothing, 0, len(unknowns))
    return 0


@compiled(at_once=True)
def evaluate_jacobian(
    plan: IntArray,
    tiles: FloatArray,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
    jacobian: FloatCubes,
) -> int:
    """The same with derivatives: (n, n_residuals, n_unknowns), written."""
    n, m, k = jacobian.shape
    if not fits(plan, unknowns, observations, values) or n != len(values) or m != plan[5] or k != plan[3]:
        return 1
    evaluate(plan[0], tiles, plan[1], unknowns, observations, values, rows_of(jacobian), 0, n)
    return 0
