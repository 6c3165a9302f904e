"""Forward and backward substitution with the factor."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, FloatArray, FloatRows, IntArray
from obseq.compilation import compiled
from obseq.compilation.digests import SUMS
from obseq.leastsquares.solvers.blas import GEMM, GEMV, TRSM, TRSV, address_of, fortran
from obseq.leastsquares.solvers.numeric import LEFT, LOWER, NOT_UNIT, ONE, PLAIN, TRANSPOSED, ZERO
from obseq.leastsquares.solvers.symbolic import Structure

SMALL_WIDTH = 8
"""Panels of so few columns are treated by plain loops."""

STRIDE = np.int32(1)


@compiled(flags=SUMS)
def substitute_forward(
    structure: Structure,
    stop: int,
    panels: FloatArray,
    x: FloatRows,
    scratch: FloatArray,
    addresses: IntArray,
) -> None:
    """Solves L y = x in place for each row of x (k, n), by the columns of the supernodes before `stop`.

    `scratch` has room for the largest number of rows below.
    """
    start, below_at = structure.start, structure.below_at
    for s in range(stop):
        first, width, panel = start[s], start[s + 1] - start[s], structure.panel_at[s]
        below = structure.rows[below_at[s] : below_at[s + 1]]
        front = width + len(below)
        wide, tall, deep = np.int32(width), np.int32(front), np.int32(len(below))
        block = address_of(panels, panel)
        for right in range(len(x)):
            if width <= SMALL_WIDTH:
                for i in range(len(below)):
                    scratch[i] = 0.0
                for j in range(width):
                    column = panel + j * front
                    y = x[right, first + j] / panels[column + j]
                    x[right, first + j] = y
                    for i in range(j + 1, width):
                        x[right, first + i] -= y * panels[column + i]
                    for i in range(len(below)):
                        scratch[i] += y * panels[column + width + i]
            else:
                part = address_of(x, right * x.shape[1] + first)
                fortran(addresses[TRSV], (LOWER, PLAIN, NOT_UNIT, wide, block, tall, part, STRIDE))
                product = address_of(scratch, 0)
                fortran(
                    addresses[GEMV],
                    (PLAIN, deep, wide, ONE, block + 8 * width, tall, part, STRIDE, ZERO, product, STRIDE),
                )
            for i in range(len(below)):
                x[right, below[i]] -= scratch[i]


@compiled(flags=SUMS)
def substitute_backward(
    structure: Structure,
    stop: int,
    panels: FloatArray,
    x: FloatRows,
    scratch: FloatArray,
    addresses: IntArray,
) -> None:
    """Solves L' y = x in place for each row of x (k, n), by the columns of the supernodes before `stop`."""
    start, below_at = structure.start, structure.below_at
    for s in range(stop - 1, -1, -1):
        first, width, panel = start[s], start[s + 1] - start[s], structure.panel_at[s]
        below = structure.rows[below_at[s] : below_at[s + 1]]
        front = width + len(below)
        wide, tall, deep = np.int32(width), np.int32(front), np.int32(len(below))
        block = address_of(panels, panel)
        for right in range(len(x)):
            for i in range(len(below)):
                scratch[i] = -x[right, below[i]]
            if width <= SMALL_WIDTH:
                for j in range(width - 1, -1, -1):
                    column = panel + j * front
                    y = x[right, first + j]
                    for i in range(j + 1, width):
                        y -= panels[column + i] * x[right, first + i]
                    for i in range(len(below)):
                        y += panels[column + width + i] * scratch[i]
                    x[right, first + j] = y / panels[column + j]
            else:
                part = address_of(x, right * x.shape[1] + first)
                known = address_of(scratch, 0)
                fortran(
                    addresses[GEMV],
                    (TRANSPOSED, deep, wide, ONE, block + 8 * width, tall, known, STRIDE, ONE, part, STRIDE),
                )
                fortran(addresses[TRSV], (LOWER, TRANSPOSED, NOT_UNIT, wide, block, tall, part, STRIDE))


@compiled(flags=SUMS)
def quadratic_forms(
    structure: Structure,
    panels: FloatArray,
    chosen: IntArray,
    starts: IntArray,
    places: IntArray,
    nodes: IntArray,
    values: FloatArray,
    x: FloatRows,
    is_met: BoolArray,
    scratch: FloatArray,
    addresses: IntArray,
    result: FloatArray,
) -> None:
    """Adds y' y with L y = b for sparse right-hand sides b (k): only supernodes above their entries are met.

    Args:
        structure: structure of the factor.
        panels: the factor.
        chosen: (k,) which right-hand sides.
        starts: where the entries of each begin, and the end of the last.
        places: (nnz,) of the entries, in the order of elimination.
        nodes: (nnz,) the supernodes of these.
        values: (nnz,) entries.
        x: (k, n) zeros, before and after.
        is_met: (m,) false, before and after.
        scratch: room for the largest number of rows below, times k.
        addresses: of the BLAS routines.
        result: what is added to, one for each right-hand side.
    """
    start, below_at, many = structure.start, structure.below_at, len(x)
    for right in range(many):
        for e in range(starts[chosen[right]], starts[chosen[right] + 1]):
            x[right, places[e]] += values[e]
            s = nodes[e]
            while s >= 0 and not is_met[s]:
                is_met[s] = True
                s = structure.parent[s]
    for s in range(len(is_met)):
        if not is_met[s]:
            continue
        is_met[s] = False
        first, width, panel = start[s], start[s + 1] - start[s], structure.panel_at[s]
        below = structure.rows[below_at[s] : below_at[s + 1]]
        deep = len(below)
        wide, tall, rows, columns = np.int32(width), np.int32(width + deep), np.int32(deep), np.int32(many)
        block, part, apart = address_of(panels, panel), address_of(x, first), np.int32(x.shape[1])
        fortran(
            addresses[TRSM],
            (LEFT, LOWER, PLAIN, NOT_UNIT, wide, columns, ONE, block, tall, part, apart),
        )
        if deep:
            product = address_of(scratch, 0)
            under = block + 8 * width
            fortran(
                addresses[GEMM],
                (PLAIN, PLAIN, rows, columns, wide, ONE, under, tall, part, apart, ZERO, product, rows),
            )
        for right in range(many):
            for i in range(deep):
                x[right, below[i]] -= scratch[right * deep + i]
            for j in range(first, first + width):
                result[chosen[right]] += x[right, j] ** 2
                x[right, j] = 0.0
