"""The compiled loops of the elimination of temporaries, over the small blocks that assembly has filled."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IntArray, IntRows
from obseq.compilation import compiled
from obseq.kernels.vectors import (
    copy_threes,
    outer_columns_1,
    outer_columns_1_by_3,
    outer_columns_2,
    outer_columns_2_by_3,
    outer_columns_3,
    outer_columns_3_by_3,
    solve_threes,
)
from obseq.leastsquares.loops.loop_arguments import Bodies, EliminationRoom, Groups, UnknownPlaces
from obseq.leastsquares.loops.temporaries import (
    backward,
    entry,
    factor_group,
    forward,
    gather_group,
    scalar_of,
)

U = np.uint64


@compiled
def coupling_rows(
    store: FloatArray,
    groups: Groups,
    group: int,
    unknowns: UnknownPlaces,
    record: FloatArray,
    width: int,
) -> None:
    """Adds the coupling of a group to its rows in a record that is zero."""
    start, size, number = unknowns.start, unknowns.size, unknowns.number
    for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
        place, column, k = groups.links[link, 0], groups.links[link, 1], groups.links[link, 2]
        t, turned = groups.links[link, 3], groups.links[link, 4]
        for j in range(size[k]):
            if number[start[k] + j] < 0:
                continue
            for i in range(size[t]):
                row = groups.local[start[t] + i]
                if row >= 0 and turned:
                    record[row * width + column] += entry(store, place, j, i, size[k], size[t])
                elif row >= 0:
                    record[row * width + column] += entry(store, place, i, j, size[t], size[k])
            column += 1


@compiled
def solve_rows(factor: FloatRows, n: int, record: FloatArray, width: int) -> None:
    """Solves L Y = rows in place, for all columns together."""
    for i in range(n):
        for k in range(i):
            c = factor[i, k]
            for column in range(width):
                record[i * width + column] -= c * record[k * width + column]
        c = 1.0 / factor[i, i]
        for column in range(width):
            record[i * width + column] *= c


@compiled
def solve_three_rows(factor: FloatRows, three: FloatArray, record: FloatArray, width: int) -> None:
    """`solve_rows` for three rows; `three` (6,) is written: inverse diagonal, entries below it by columns."""
    for i in range(3):
        three[i] = 1.0 / factor[i, i]
    three[3], three[4], three[5] = factor[1, 0], factor[2, 0], factor[2, 1]
    for column in range(0, width, 4):
        solve_threes(record, U(column), U(width), three)


@compiled
def add_columns(
    sums: FloatArray,
    at: int,
    height: int,
    record: FloatArray,
    a: int,
    b: int,
    width: int,
    columns: IntArray,
    first: int,
    last: int,
    n: int,
) -> None:
    """Adds the products of a part of `height` with some columns of another, over n rows, to a pair's sums."""
    w, f, e = U(width), U(first), U(last)
    for quad in range(0, height, 12):
        place, left, rest = U(at + quad), a + quad, height - quad
        row = 0
        while row < n:
            part, other = U(left + row * width), U(b + row * width)
            if n - row >= 3:
                if rest >= 12:
                    outer_columns_3_by_3(sums, place, U(height), record, part, other, w, columns, f, e)
                elif rest >= 8:
                    outer_columns_2_by_3(sums, place, U(height), record, part, other, w, columns, f, e)
                else:
                    outer_columns_1_by_3(sums, place, U(height), record, part, other, w, columns, f, e)
                row += 3
            else:
                if rest >= 12:
                    outer_columns_3(sums, place, U(height), record, part, other, w, columns, f, e)
                elif rest >= 8:
                    outer_columns_2(sums, place, U(height), record, part, other, w, columns, f, e)
                else:
                    outer_columns_1(sums, place, U(height), record, part, other, w, columns, f, e)
                row += 1


@compiled
def add_squares(
    sums: FloatArray,
    pulls: FloatArray,
    bodies: Bodies,
    group: int,
    pair: int,
    record: FloatArray,
    width: int,
    n: int,
) -> int:
    """Adds Y' Y to the sums for one group, and Y' right to the pulls; returns the number of the next pair."""
    first = bodies.bounds[group]
    for a in range(first, bodies.bounds[group + 1]):
        high, left = bodies.slots[a], bodies.part[a]
        height = bodies.height[high]
        for b in range(first, a + 1):
            low = bodies.slots[b]
            begin, end = bodies.column_bounds[low], bodies.column_bounds[low + 1]
            at = 4 * int(bodies.places[pair])
            add_columns(sums, at, height, record, left, bodies.part[b], width, bodies.columns, begin, end, n)
            pair += 1
        pull = bodies.pulls[high]
        add_columns(pulls, pull, height, record, left, width - 4, width, bodies.columns, 0, 1, n)
    return pair


@compiled
def eliminate(
    store: FloatArray,
    diagonal: IntArray,
    groups: Groups,
    bodies: Bodies,
    unknowns: UnknownPlaces,
    damping: float,
    span: IntArray,
    sums: FloatArray,
    pulls: FloatArray,
    failed: IntArray,
    room: EliminationRoom,
) -> float:
    """Sums up what the elimination of some groups takes from the matrix and from the gradient.

    Args:
        store: the small blocks, behind the matrix.
        diagonal: (n_blocks,) place of each diagonal block in units of four doubles.
        groups: the eliminated blocks.
        bodies: what they meet.
        unknowns: where all blocks are.
        damping: share of the diagonal of the eliminated blocks that is added to it.
        span: (3,) first group, last one excluded, and place of the first one's pairs in `bodies.places`.
        sums: sums of Y' Y by pairs of bodies, changed; no other thread works on them.
        pulls: the same of Y' right by bodies.
        failed: (1,) written: the first unknown that its observations do not determine; -1 when all is well.
        room: numbers of one group, overwritten.

    Returns:
        Sum of g_t' N_tt^-1 g_t over the blocks of these groups.
    """
    decrease, pair = 0.0, span[2]
    factor, right, record = room.factor, room.right, room.record
    failed[0] = -1
    for group in range(span[0], span[1]):
        n = gather_group(store, diagonal, groups, group, unknowns, factor, right)
        bad = factor_group(factor, n, damping)
        if bad >= 0:
            failed[0] = scalar_of(groups, group, bad, unknowns)
            return decrease
        last, width = bodies.bounds[group + 1] - 1, 4
        if last >= bodies.bounds[group]:
            width += bodies.part[last] + bodies.height[bodies.slots[last]]
        if groups.threes[group]:
            for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
                place, column = groups.links[link, 0], groups.links[link, 1]
                copy_threes(store, U(place), record, U(column), U(width))
        else:
            record[: n * width] = 0.0
            coupling_rows(store, groups, group, unknowns, record, width)
        for i in range(n):
            end = (i + 1) * width
            record[end - 4] = right[i]
            record[end - 3], record[end - 2], record[end - 1] = 0.0, 0.0, 0.0
        if n == 3:
            solve_three_rows(factor, room.three, record, width)
        else:
            solve_rows(factor, n, record, width)
        for i in range(n):
            decrease += record[(i + 1) * width - 4] ** 2
        pair = add_squares(sums, pulls, bodies, group, pair, record, width, n)
    return decrease


@compiled
def subtract_sums(sums: FloatRows, summed: IntRows, unknowns: UnknownPlaces, target: FloatArray) -> None:
    """Subtracts the sums of all shares (n_shares, n) from the matrix.

    `summed` (n_pairs, 5): place of a pair of blocks in the sums, distance of its columns there, row block,
    column block, offset of the later one of the two below the top of the block column of the other.
    """
    first, count, indptr = unknowns.first, unknowns.n_free, unknowns.indptr
    for k in range(len(summed)):
        at, height, p, q = summed[k, 0], summed[k, 1], summed[k, 2], summed[k, 3]
        offset = summed[k, 4]
        for j in range(count[q]):
            for i in range(j if p == q else 0, count[p]):
                value = 0.0
                for share in range(len(sums)):
                    value += sums[share, at + i]
                if p >= q:
                    target[indptr[first[q] + j] + offset - j + i] -= value
                else:
                    target[indptr[first[p] + i] + offset - i + j] -= value
            at += height


@compiled
def add_products_of_threes(
    store: FloatArray, groups: Groups, group: int, start: IntArray, step: FloatArray, right: FloatArray
) -> None:
    """Adds N_tk k to the right-hand side of a group of `Groups.threes`."""
    a, b, c = right[0], right[1], right[2]
    for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
        at, k = U(groups.links[link, 0]), U(start[groups.links[link, 2]])
        x, y, z = step[k], step[k + U(1)], step[k + U(2)]
        a += x * store[at] + y * store[at + U(1)] + z * store[at + U(2)]
        b += x * store[at + U(4)] + y * store[at + U(5)] + z * store[at + U(6)]
        c += x * store[at + U(7)] + y * store[at + U(8)] + z * store[at + U(9)]
    right[0], right[1], right[2] = a, b, c


@compiled
def add_products(
    store: FloatArray,
    groups: Groups,
    group: int,
    unknowns: UnknownPlaces,
    step: FloatArray,
    right: FloatArray,
) -> None:
    """Adds N_tk k to the right-hand side of a group."""
    start, size = unknowns.start, unknowns.size
    for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
        place, k = groups.links[link, 0], groups.links[link, 2]
        t, turned = groups.links[link, 3], groups.links[link, 4]
        for i in range(size[t]):
            row = groups.local[start[t] + i]
            if row < 0:
                continue
            for j in range(size[k]):
                if turned:
                    right[row] += step[start[k] + j] * entry(store, place, j, i, size[k], size[t])
                else:
                    right[row] += step[start[k] + j] * entry(store, place, i, j, size[t], size[k])


@compiled
def substitute_back(
    store: FloatArray,
    diagonal: IntArray,
    groups: Groups,
    unknowns: UnknownPlaces,
    damping: float,
    span: IntArray,
    step: FloatArray,
    room: EliminationRoom,
) -> None:
    """Writes the step of the eliminated unknowns of some groups, from that of the others (n_scalars,).

    `span` and `room` are as in `eliminate`.
    """
    start, size, factor, right = unknowns.start, unknowns.size, room.factor, room.right
    for group in range(span[0], span[1]):
        n = gather_group(store, diagonal, groups, group, unknowns, factor, right)
        factor_group(factor, n, damping)
        if groups.threes[group]:
            add_products_of_threes(store, groups, group, start, step, right)
        else:
            add_products(store, groups, group, unknowns, step, right)
        forward(factor, n, right)
        backward(factor, n, right)
        for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
            t = groups.blocks[member]
            for i in range(size[t]):
                row = groups.local[start[t] + i]
                if row >= 0:
                    step[start[t] + i] = -right[row]
