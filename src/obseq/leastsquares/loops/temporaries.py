"""One group of eliminated blocks: its normal matrix gathered from the small blocks, and factored.

Groups of one block of three free unknowns, tie points, are the common case, and are written out.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IntArray
from obseq.compilation import compiled
from obseq.leastsquares.loops.loop_arguments import Groups, UnknownPlaces

TINY = 1e-14
"""A pivot below this share of its diagonal entry vanishes: the observations do not determine the unknown."""


@compiled
def entry(store: FloatArray, at: int, row: int, column: int, rows: int, columns: int) -> float:
    """One entry of a pair in the store: columns of three rows are packed when both blocks are threes."""
    if rows == 3 and columns == 3:
        return float(store[at + column * (9 - column) // 2 + row])
    return float(store[at + column * ((rows + 4) // 4 * 4) + row])


@compiled
def is_one_three(groups: Groups, group: int, unknowns: UnknownPlaces) -> bool:
    """Whether a group is one block of three free unknowns, as a tie point is."""
    t = groups.blocks[groups.block_bounds[group]]
    alone = groups.block_bounds[group + 1] == groups.block_bounds[group] + 1
    return bool(alone and unknowns.size[t] == 3 and groups.local[unknowns.start[t] + 2] == 2)


@compiled
def gather_three(store: FloatArray, at: int, normal: FloatRows, right: FloatArray) -> None:
    """`gather_group` for one block of three."""
    for j in range(3):
        right[j] = store[at + 12 + j]
        for i in range(j, 3):
            normal[i, j] = store[at + 4 * j + i]


@compiled
def gather_group(
    store: FloatArray,
    diagonal: IntArray,
    groups: Groups,
    group: int,
    unknowns: UnknownPlaces,
    normal: FloatRows,
    right: FloatArray,
) -> int:
    """Copies N_tt (lower triangle) and g_t of a group from the store; returns the number of its unknowns."""
    start, size = unknowns.start, unknowns.size
    if is_one_three(groups, group, unknowns):
        gather_three(store, 4 * diagonal[groups.blocks[groups.block_bounds[group]]], normal, right)
        return 3
    n, local = 0, groups.local
    for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
        t = groups.blocks[member]
        for i in range(size[t]):
            n = max(n, local[start[t] + i] + 1)
    normal[:n, :n] = 0.0
    for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
        t = groups.blocks[member]
        at, width = 4 * diagonal[t], (size[t] + 4) // 4 * 4
        for j in range(size[t]):
            column = local[start[t] + j]
            if column < 0:
                continue
            right[column] = store[at + size[t] * width + j]
            for i in range(j, size[t]):
                row = local[start[t] + i]
                if row >= 0:
                    normal[row, column] += store[at + j * width + i]
    for pair in range(groups.inner_bounds[group], groups.inner_bounds[group + 1]):
        place, p, q = groups.inner[pair, 0], groups.inner[pair, 1], groups.inner[pair, 2]
        for j in range(size[q]):
            column = local[start[q] + j]
            for i in range(size[p]):
                row = local[start[p] + i]
                if row < 0 or column < 0:
                    continue
                value = entry(store, place, i, j, size[p], size[q])
                normal[max(row, column), min(row, column)] += value if row != column else 2.0 * value
    return n


@compiled
def factor_three(normal: FloatRows, damping: float) -> int:
    """`factor_group` for three unknowns."""
    a = normal[0, 0] * (1.0 + damping)
    if not a > TINY * a:
        return 0
    root = np.sqrt(a)
    normal[0, 0], normal[1, 0], normal[2, 0] = root, normal[1, 0] / root, normal[2, 0] / root
    b = normal[1, 1] * (1.0 + damping)
    pivot = b - normal[1, 0] * normal[1, 0]
    if not pivot > TINY * b:
        return 1
    root = np.sqrt(pivot)
    normal[1, 1], normal[2, 1] = root, (normal[2, 1] - normal[2, 0] * normal[1, 0]) / root
    c = normal[2, 2] * (1.0 + damping)
    pivot = c - normal[2, 0] * normal[2, 0] - normal[2, 1] * normal[2, 1]
    if not pivot > TINY * c:
        return 2
    normal[2, 2] = np.sqrt(pivot)
    return -1


@compiled
def factor_group(normal: FloatRows, n: int, damping: float) -> int:
    """Cholesky factor, in place, of a damped lower triangle; the first vanishing pivot, or -1."""
    if n == 3:
        return factor_three(normal, damping)
    for j in range(n):
        for i in range(j, n):
            value = normal[i, j]
            if i == j:
                value *= 1.0 + damping
            diagonal = value
            for k in range(j):
                value -= normal[i, k] * normal[j, k]
            if i == j:
                if not value > TINY * diagonal:
                    return j
                normal[j, j] = np.sqrt(value)
            else:
                normal[i, j] = value / normal[j, j]
    return -1


@compiled
def forward(factor: FloatRows, n: int, vector: FloatArray) -> None:
    """Solves L y = vector in place."""
    for i in range(n):
        value = vector[i]
        for k in range(i):
            value -= factor[i, k] * vector[k]
        vector[i] = value / factor[i, i]


@compiled
def backward(factor: FloatRows, n: int, vector: FloatArray) -> None:
    """Solves L' x = vector in place."""
    for back in range(n):
        i = n - 1 - back
        value = vector[i]
        for k in range(i + 1, n):
            value -= factor[k, i] * vector[k]
        vector[i] = value / factor[i, i]


@compiled
def scalar_of(groups: Groups, group: int, wanted: int, unknowns: UnknownPlaces) -> int:
    """The unknown, among all, that has a number within a group."""
    for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
        t = groups.blocks[member]
        for scalar in range(unknowns.start[t], unknowns.start[t] + unknowns.size[t]):
            if groups.local[scalar] == wanted:
                return int(scalar)
    return -1
