"""The compiled loops of the elimination of temporaries, over the small blocks that assembly has filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.compilation import compiled
from obseq.kernels.vectors import outer_padded_threes, outer_threes
from obseq.leastsquares.loops.tables import EliminationRoom, Groups, UnknownPlaces
from obseq.leastsquares.loops.temporaries import (
    backward,
    entry,
    factor_group,
    forward,
    gather_group,
    is_one_three,
    scalar_of,
)

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows, IntArray, PositionArray


@compiled
def neighbour_pairs(
    bounds: IntArray, neighbours: IntArray, first: int, last: int, n: int, keys: IntArray
) -> None:
    """Writes low * n + high for all pairs of different neighbours of the groups from `first` to `last`."""
    at = 0
    for group in range(first, last):
        for a in range(bounds[group], bounds[group + 1]):
            for b in range(bounds[group], a):
                keys[at] = neighbours[b] * n + neighbours[a]
                at += 1


@compiled
def add_threes(store: FloatArray, place: int, turned: int, record: FloatArray, at: int, width: int) -> None:
    """Adds a pair of threes, columns 0, 4 and 7 from its place on, to three rows; its transpose if turned."""
    for i in range(3):
        for j in range(3):
            row, column = (j, i) if turned else (i, j)
            record[at + i * width + j] += store[place + column * (9 - column) // 2 + row]


@compiled
def coupling_rows(
    store: FloatArray,
    groups: Groups,
    group: int,
    unknowns: UnknownPlaces,
    record: FloatArray,
    width: int,
) -> None:
    """Adds the coupling of a group to the rows of a record, each neighbour from its part on."""
    start, size, number = unknowns.start, unknowns.size, unknowns.number
    is_three = is_one_three(groups, group, unknowns)
    for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
        place, slot, k = groups.links[link, 0], groups.links[link, 1], groups.links[link, 2]
        t, turned = groups.links[link, 3], groups.links[link, 4]
        column = groups.part[slot]
        if is_three and size[k] == 3 and unknowns.n_free[k] == 3:
            if turned:
                add_threes(store, place, 1, record, column, width)
            else:
                add_threes(store, place, 0, record, column, width)
            continue
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
def forward_rows(factor: FloatRows, n: int, record: FloatArray, width: int) -> None:
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
def subtract_square_of_three(
    store: FloatArray, at: int, height: int, record: FloatArray, part: int, width: int, n: int
) -> None:
    """Subtracts y' y of three columns from the diagonal block of a neighbour, lower triangle."""
    aa, ba, ca, bb, cb, cc = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        a, b, c = (record[part + k * width], record[part + k * width + 1], record[part + k * width + 2])
        aa, ba, ca = aa + a * a, ba + b * a, ca + c * a
        bb, cb, cc = bb + b * b, cb + c * b, cc + c * c
    second, third = at + height, at + 2 * height - 1
    store[at], store[at + 1], store[at + 2] = store[at] - aa, store[at + 1] - ba, store[at + 2] - ca
    store[second], store[second + 1] = store[second] - bb, store[second + 1] - cb
    store[third] -= cc


@compiled
def subtract_pull(
    gradient: FloatArray,
    first: int,
    count: int,
    record: FloatArray,
    part: int,
    width: int,
    right: FloatArray,
    n: int,
) -> None:
    """Subtracts y' right from the gradient of a neighbour."""
    if count == 3:
        a, b, c = 0.0, 0.0, 0.0
        for k in range(n):
            at = part + k * width
            a, b, c = a + record[at] * right[k], b + record[at + 1] * right[k], c + record[at + 2] * right[k]
        gradient[first], gradient[first + 1] = gradient[first] - a, gradient[first + 1] - b
        gradient[first + 2] -= c
        return
    for i in range(count):
        value = 0.0
        for k in range(n):
            value += record[k * width + part + i] * right[k]
        gradient[first + i] -= value


@compiled
def subtract_squares(
    store: FloatArray,
    slots: IntArray,
    groups: Groups,
    unknowns: UnknownPlaces,
    offsets: PositionArray,
    pair: int,
    room: EliminationRoom,
    width: int,
    n: int,
) -> int:
    """Subtracts Y' Y from the matrix for one group; returns the number of the next pair.

    `slots`: first and last neighbour of the group. `room.record`: Y row by row, `width` apart, then -Y.
    `room.columns` gets where the columns of each neighbour begin, and the height of the first of a three.
    """
    neighbours, part, record, columns = groups.neighbours, groups.part, room.record, room.columns
    first, count, indptr = unknowns.first, unknowns.n_free, unknowns.indptr
    opposite, w, rows = n * width, np.uint64(width), np.uint64(n)
    for b in range(slots[0], slots[1]):
        slot = 2 * (b - slots[0])
        columns[slot] = indptr[first[neighbours[b]]]
        height = indptr[first[neighbours[b]] + 1] - columns[slot]
        columns[slot + 1] = height if count[neighbours[b]] == 3 and n == 3 else 0
    for a in range(slots[0], slots[1]):
        high = neighbours[a]
        is_three = count[high] == 3
        if is_three:
            top = indptr[first[high]]
            height = indptr[first[high] + 1] - top
            subtract_square_of_three(store, top, height, record, part[a], width, n)
        for j in range(0 if is_three else count[high]):
            target = indptr[first[high] + j]
            for i in range(j, count[high]):
                value = 0.0
                for k in range(n):
                    value += record[k * width + part[a] + i] * record[k * width + part[a] + j]
                store[target + i - j] -= value
        left = np.uint64(opposite + part[a])
        for b in range(slots[0], a):
            top, height = columns[2 * (b - slots[0])], columns[2 * (b - slots[0]) + 1]
            if is_three and height > 0:
                place = np.uint64(top + np.int64(offsets[pair]))
                outer_padded_threes(store, place, np.uint64(height), record, left, np.uint64(part[b]), w)
                pair += 1
                continue
            low = neighbours[b]
            top, offset = indptr[first[low]], np.int64(offsets[pair])
            pair += 1
            if count[high] == 3 and count[low] == 3:
                at, tall = np.uint64(top + offset), np.uint64(indptr[first[low] + 1] - top)
                outer_threes(store, at, tall, record, left, np.uint64(part[b]), w, rows)
                continue
            for j in range(count[low]):
                target = indptr[first[low] + j] + offset - j
                for i in range(count[high]):
                    value = 0.0
                    for k in range(n):
                        value += record[k * width + part[a] + i] * record[k * width + part[b] + j]
                    store[target + i] -= value
    return pair


@compiled
def eliminate(
    store: FloatArray,
    diagonal: IntArray,
    groups: Groups,
    unknowns: UnknownPlaces,
    offsets: PositionArray,
    damping: float,
    span: IntArray,
    target: FloatArray,
    gradient: FloatArray,
    failed: IntArray,
    room: EliminationRoom,
) -> float:
    """Subtracts the effect of some groups of eliminated blocks from a matrix and from a gradient.

    Args:
        store: the small blocks, behind the matrix.
        diagonal: (n_blocks,) place of each diagonal block in units of four doubles.
        groups: the eliminated blocks.
        unknowns: where all blocks are.
        offsets: (n_pairs,) offset of each pair of neighbours below the top of its block column.
        damping: share of the diagonal of the eliminated blocks that is added to it.
        span: (3,) first group, last one excluded, and place of the first one's pairs in `offsets`.
        target: the entries of the matrix, changed; no other thread works on them.
        gradient: (n_free,) changed.
        failed: (1,) written: the first unknown that its observations do not determine; -1 when all is well.
        room: numbers of one group, overwritten.

    Returns:
        Sum of g_t' N_tt^-1 g_t over the blocks of these groups.
    """
    bounds, neighbours, part = groups.bounds, groups.neighbours, groups.part
    factor, right, record = room.factor, room.right, room.record
    decrease, pair = 0.0, span[2]
    failed[0] = -1
    for group in range(span[0], span[1]):
        n = gather_group(store, diagonal, groups, group, unknowns, factor, right)
        bad = factor_group(factor, n, damping)
        if bad >= 0:
            failed[0] = scalar_of(groups, group, bad, unknowns)
            return decrease
        forward(factor, n, right)
        for i in range(n):
            decrease += right[i] * right[i]
        slots = bounds[group : group + 2]
        if slots[0] == slots[1]:
            continue
        last = slots[1] - 1
        width = part[last] + (unknowns.n_free[neighbours[last]] + 3) // 4 * 4
        record[: n * width] = 0.0
        coupling_rows(store, groups, group, unknowns, record, width)
        forward_rows(factor, n, record, width)
        for i in range(n * width):
            record[n * width + i] = -record[i]
        for a in range(slots[0], slots[1]):
            k = neighbours[a]
            first, count = unknowns.first[k], unknowns.n_free[k]
            subtract_pull(gradient, first, count, record, part[a], width, right, n)
        pair = subtract_squares(target, slots, groups, unknowns, offsets, pair, room, width, n)
    return decrease


@compiled
def add_product_of_threes(
    store: FloatArray, place: int, turned: int, step: FloatArray, at: int, right: FloatArray
) -> None:
    """Adds a pair of threes, or its transpose, times three steps."""
    for i in range(3):
        for j in range(3):
            row, column = (j, i) if turned else (i, j)
            right[i] += step[at + j] * store[place + column * (9 - column) // 2 + row]


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
        is_three = is_one_three(groups, group, unknowns)
        for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
            place, k = groups.links[link, 0], groups.links[link, 2]
            t, turned = groups.links[link, 3], groups.links[link, 4]
            if is_three and size[k] == 3:
                if turned:
                    add_product_of_threes(store, place, 1, step, start[k], right)
                else:
                    add_product_of_threes(store, place, 0, step, start[k], right)
                continue
            for i in range(size[t]):
                row = groups.local[start[t] + i]
                if row < 0:
                    continue
                for j in range(size[k]):
                    if turned:
                        right[row] += step[start[k] + j] * entry(store, place, j, i, size[k], size[t])
                    else:
                        right[row] += step[start[k] + j] * entry(store, place, i, j, size[t], size[k])
        forward(factor, n, right)
        backward(factor, n, right)
        for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
            t = groups.blocks[member]
            for i in range(size[t]):
                row = groups.local[start[t] + i]
                if row >= 0:
                    step[start[t] + i] = -right[row]
