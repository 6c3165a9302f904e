"""The loops between unknowns and normal equations, compiled once for all formulas.

A batch goes through in tiles of 32 observations: unknown blocks are gathered into the tile, the kernel is
called by its address, residuals and derivatives are divided by the sigmas and turned into one record per
observation, and the products of the records are added to the blocks of the normal matrix. The Jacobian
never leaves the tile.

A record holds, per residual, one part per block of the formula: the derivatives by the unknowns of the
block, then the residual, then zeros up to a multiple of four. A part times itself gives, in one go, the
diagonal block of the normal matrix and, as its last column, the block's share of the gradient J' W r.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IntArray, PositionArray
from obseq.compilation import compiled
from obseq.compilation.digests import SUMS
from obseq.kernels.layout import LANES, STRIDE
from obseq.kernels.tiles import call_kernel
from obseq.kernels.vectors import outer1, outer4, outer_threes, transpose3, transpose4
from obseq.leastsquares.loops.loop_arguments import BatchArrays, BlockTable, Present, Span

U = np.uint64
ROW = U(STRIDE)
ONE = U(1)
TWO = U(2)
THREE = U(3)
FOUR = U(4)
SIX = U(6)


@compiled
def gather_rows(
    tile: FloatArray, row: int, size: int, source: FloatArray, start: PositionArray, first: int
) -> None:
    """Copies `size` doubles of `source` per lane, from where `start` says, to rows of the tile."""
    for lane in range(0, LANES, 4):
        k = U(first) + U(lane)
        s0, s1, s2, s3 = U(start[k]), U(start[k + ONE]), U(start[k + TWO]), U(start[k + THREE])
        at = U(row) * ROW + U(lane)
        left = size
        while left >= 4:
            transpose4(source, s0, s1, s2, s3, tile, at, ROW)
            s0 += FOUR
            s1 += FOUR
            s2 += FOUR
            s3 += FOUR
            at += FOUR * ROW
            left -= 4
        if left == 3:
            transpose3(source, s0, s1, s2, s3, tile, at, ROW)
        else:
            for rest in range(left):
                shift = U(rest)
                tile[at] = source[s0 + shift]
                tile[at + ONE] = source[s1 + shift]
                tile[at + TWO] = source[s2 + shift]
                tile[at + THREE] = source[s3 + shift]
                at += ROW


@compiled
def fill_tile(tile: FloatArray, batch: BatchArrays, present: Present, first: int) -> None:
    """Gathers the unknowns, their context and the observations of 32 lanes."""
    for b in range(len(batch.blocks)):
        block = batch.blocks[b]
        gather_rows(tile, block[0], block[1], present.values, batch.starts[b], first)
        if block[2] >= 0:
            gather_rows(tile, block[2], block[3], present.context, batch.contexts[b], first)
    for k in range(len(batch.observation_rows)):
        row = U(batch.observation_rows[k]) * ROW
        for lane in range(LANES):
            tile[row + U(lane)] = batch.observations[U(k), U(first) + U(lane)]


@compiled
def linear_rows(tile: FloatArray, n_unknowns: int) -> None:
    """The kernel of plain linear rows: coefficients . unknowns - value; the coefficients."""
    coefficient, residual = U(n_unknowns) * ROW, U(2 * n_unknowns + 1) * ROW
    for lane in range(LANES):
        tile[residual + U(lane)] = -tile[residual - ROW + U(lane)]
    for u in range(n_unknowns):
        for lane in range(LANES):
            at = U(u) * ROW + U(lane)
            tile[residual + ROW + at] = tile[coefficient + at]
            tile[residual + U(lane)] += tile[at] * tile[coefficient + at]


@compiled
def add_carried(tile: FloatArray, batch: BatchArrays, first: int) -> None:
    """Adds what a movement does through what moves with it: J_a += J_b M, or J_a += m."""
    derivative = batch.first_row + batch.n_residuals
    for k in range(len(batch.carried)):
        moving, moved, rows = batch.carried[k, 0], batch.carried[k, 1], U(batch.carried[k, 2])
        for r in range(batch.n_residuals):
            row = derivative + r * batch.n_unknowns
            target = U(row + moving) * ROW
            source = U(row + max(moved, 0)) * ROW
            for lane in range(LANES):
                at, place = U(lane), U(first) + U(lane)
                x, y, z = tile[source + at], tile[source + ROW + at], tile[source + TWO * ROW + at]
                for axis in range(3):
                    how = rows + U(axis)
                    added = batch.carriers[how, place]
                    if moved >= 0:
                        added *= x
                        added += y * batch.carriers[how + THREE, place]
                        added += z * batch.carriers[how + SIX, place]
                    tile[target + U(axis) * ROW + at] += added


@compiled(flags=SUMS)
def scale_rows(
    tile: FloatArray,
    first_row: int,
    n_residuals: int,
    n_unknowns: int,
    weights: FloatRows,
    first: int,
    scaled: FloatArray,
) -> float:
    """Divides residuals and derivatives by the sigmas; returns the sum of squares of the residuals.

    `scaled` gets, per residual, the residual and the derivatives, n_unknowns + 1 rows. A lane of weight zero
    gives zeros, whatever its residual.
    """
    total = 0.0
    source = U(first_row) * ROW
    derivative = U(first_row + n_residuals) * ROW
    target = U(0)
    for r in range(n_residuals):
        for lane in range(LANES):
            weight = weights[U(r), U(first) + U(lane)]
            value = tile[source + U(lane)] * weight if weight != 0.0 else 0.0
            scaled[target + U(lane)] = value
            total += value * value
        for _ in range(n_unknowns):
            target += ROW
            for lane in range(LANES):
                weight = weights[U(r), U(first) + U(lane)]
                value = tile[derivative + U(lane)] * weight
                scaled[target + U(lane)] = value if weight != 0.0 else 0.0
            derivative += ROW
        source += ROW
        target += ROW
    return total


@compiled(flags=SUMS)
def whiten_rows(scaled: FloatArray, roots: FloatRows, n_residuals: int, rows: int, first: int) -> float:
    """Multiplies the scaled rows of each lane by an upper triangular matrix; returns the new sum of squares.

    `roots` (m (m + 1) / 2, n): entries row by row. `rows`: scaled rows per residual.
    """
    total = 0.0
    entry = U(0)
    step = U(rows * STRIDE)
    target = U(0)
    for r in range(n_residuals):
        source = target
        for s in range(r, n_residuals):
            for row in range(rows):
                shift = U(row) * ROW
                for lane in range(LANES):
                    place = shift + U(lane)
                    factor = roots[entry, U(first) + U(lane)]
                    kept = scaled[target + place] if s > r else 0.0
                    scaled[target + place] = kept + factor * scaled[source + place]
            entry += ONE
            source += step
        for lane in range(LANES):
            total += scaled[target + U(lane)] * scaled[target + U(lane)]
        target += step
    return total


@compiled
def make_records(
    scaled: FloatArray, record_rows: IntArray, n_residuals: int, rows: int, records: FloatArray
) -> None:
    """Turns scaled rows into one record per lane; `record_rows` (width,): row of each place, or -1."""
    width = len(record_rows)
    zero = U(n_residuals * rows * STRIDE)
    step = U(n_residuals * width)
    for r in range(n_residuals):
        base = r * rows * STRIDE
        for quad in range(0, width, 4):
            r0, r1, r2, r3 = zero, zero, zero, zero
            if record_rows[quad] >= 0:
                r0 = U(base + record_rows[quad] * STRIDE)
            if record_rows[quad + 1] >= 0:
                r1 = U(base + record_rows[quad + 1] * STRIDE)
            if record_rows[quad + 2] >= 0:
                r2 = U(base + record_rows[quad + 2] * STRIDE)
            if record_rows[quad + 3] >= 0:
                r3 = U(base + record_rows[quad + 3] * STRIDE)
            at = U(r * width + quad)
            for lane in range(0, LANES, 4):
                shift = U(lane)
                transpose4(
                    scaled, r0 + shift, r1 + shift, r2 + shift, r3 + shift, records, at + shift * step, step
                )


@compiled
def scatter(
    store: FloatArray, table: BlockTable, records: FloatArray, n_residuals: int, first: int, lanes: int
) -> None:
    """Adds the products of record parts to their blocks in the store."""
    width = len(table.record_rows)
    for k in range(len(table.pairs)):
        pair, positions = table.pairs[k], table.positions[k]
        codes = table.heights[pair[4]] if pair[4] >= 0 else positions
        if pair[5] == 1:
            add_pair_in_runs(store, pair, positions, codes, records, width, n_residuals, first, lanes)
        else:
            add_pair_each_row(store, pair, positions, codes, records, width, n_residuals, first, lanes)


@compiled
def add_block(
    store: FloatArray,
    at: np.uint64,
    quads: int,
    columns: int,
    records: FloatArray,
    a: np.uint64,
    b: np.uint64,
    width: np.uint64,
    n: np.uint64,
) -> None:
    """Adds the products of two parts of any size, over n rows of records, to a block of its own."""
    height = FOUR * U(quads)
    for quad in range(quads):
        place, part, column = at + FOUR * U(quad), a + FOUR * U(quad), 0
        while columns - column >= 4:
            outer4(store, place, height, records, part, b + U(column), width, n)
            place += FOUR * height
            column += 4
        while column < columns:
            outer1(store, place, height, records, part, b + U(column), width, n)
            place += height
            column += 1


@compiled
def add_pair_in_runs(
    store: FloatArray,
    pair: IntArray,
    place: PositionArray,
    codes: PositionArray,
    records: FloatArray,
    width: int,
    n_residuals: int,
    first: int,
    lanes: int,
) -> None:
    """One pair of roles whose block is shared by runs of observations: each run is summed up in registers."""
    w, n = U(width), U(n_residuals)
    a, b = U(pair[0]), U(pair[1])
    quads, columns = pair[2], pair[3]
    lane = 0
    while lane < lanes:
        k = U(first) + U(lane)
        last = lane + 1
        while (
            last < lanes and place[U(first) + U(last)] == place[k] and codes[U(first) + U(last)] == codes[k]
        ):
            last += 1
        base, rows = U(lane) * w * n, U(last - lane) * n
        if pair[4] >= 0:
            code = U(codes[k])
            shift = (b - a) * (code & ONE)
            outer_threes(
                store, U(place[k]), code >> ONE, records, base + a + shift, base + b - shift, w, rows
            )
        elif quads == 1 and columns == 4:
            outer4(store, FOUR * U(place[k]), FOUR, records, base + a, base + b, w, rows)
        else:
            add_block(store, FOUR * U(place[k]), quads, columns, records, base + a, base + b, w, rows)
        lane = last


@compiled
def add_pair_each_row(
    store: FloatArray,
    pair: IntArray,
    place: PositionArray,
    codes: PositionArray,
    records: FloatArray,
    width: int,
    n_residuals: int,
    first: int,
    lanes: int,
) -> None:
    """One pair of roles, observation by observation."""
    w, n = U(width), U(n_residuals)
    step = w * n
    a, b = U(pair[0]), U(pair[1])
    quads, columns = pair[2], pair[3]
    if pair[4] >= 0:
        swap = b - a
        for lane in range(lanes):
            k = U(first) + U(lane)
            code = U(codes[k])
            shift = swap * (code & ONE)
            base, at = U(lane) * step, U(place[k])
            if n == ONE:
                outer_threes(store, at, code >> ONE, records, base + a + shift, base + b - shift, w, ONE)
            else:
                outer_threes(store, at, code >> ONE, records, base + a + shift, base + b - shift, w, n)
    elif quads == 1 and columns == 4 and n == ONE:
        for lane in range(lanes):
            base, at = U(lane) * step, FOUR * U(place[U(first) + U(lane)])
            outer4(store, at, FOUR, records, base + a, base + b, w, ONE)
    else:
        for lane in range(lanes):
            base, at = U(lane) * step, FOUR * U(place[U(first) + U(lane)])
            add_block(store, at, quads, columns, records, base + a, base + b, w, n)


@compiled
def assemble(
    kernel: int,
    tile: FloatArray,
    batch: BatchArrays,
    span: Span,
    present: Present,
    table: BlockTable,
    scratch: FloatArray,
    store: FloatArray,
) -> float:
    """Adds normal equations of a span of a batch to the store; the sum of weighted squared residuals.

    `kernel` is the address of a value-and-Jacobian kernel, or 0 for plain linear rows.
    """
    m, rows = batch.n_residuals, batch.n_unknowns + 1
    size = LANES * m * len(table.record_rows)
    records = scratch[:size]
    scaled = scratch[size:]
    total = 0.0
    for first in range(span.first, span.last, LANES):
        fill_tile(tile, batch, present, first)
        if kernel != 0:
            call_kernel(kernel, tile, 1)
        else:
            linear_rows(tile, batch.n_unknowns)
        add_carried(tile, batch, first)
        squares = scale_rows(tile, batch.first_row, m, batch.n_unknowns, batch.weights, first, scaled)
        if len(batch.roots) > 0:
            squares = whiten_rows(scaled, batch.roots, m, rows, first)
        total += squares
        make_records(scaled, table.record_rows, m, rows, records)
        scatter(store, table, records, m, first, min(LANES, span.last - first))
    return total


@compiled
def evaluate(
    kernel: int,
    tile: FloatArray,
    batch: BatchArrays,
    span: Span,
    present: Present,
    rows: int,
    results: FloatRows,
) -> None:
    """Copies `rows` rows of each tile, from the residuals on, to `results` (rows, n padded)."""
    for first in range(span.first, span.last, LANES):
        fill_tile(tile, batch, present, first)
        if kernel != 0:
            call_kernel(kernel, tile, 1)
        else:
            linear_rows(tile, batch.n_unknowns)
        if rows > batch.n_residuals:
            add_carried(tile, batch, first)
        for row in range(rows):
            source = (batch.first_row + row) * STRIDE
            for lane in range(LANES):
                results[row, first + lane] = tile[source + lane]
