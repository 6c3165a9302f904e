"""Multifrontal Cholesky factorisation, one supernode after the other.

A panel holds the columns of a supernode in all rows of its front, column-major. The update matrix of a
supernode (its rows below, squared, lower triangle) lies in the workspace until its parent has added it.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IndexArray, IntArray
from obseq.compilation import compiled
from obseq.leastsquares.solvers.blas import POTRF, SYRK, TRSM, address_of, fortran, lapack
from obseq.leastsquares.solvers.dense_loops import factor_columns
from obseq.leastsquares.solvers.symbolic import Structure

LOWER, LEFT, RIGHT = np.uint8(ord("L")), np.uint8(ord("L")), np.uint8(ord("R"))
TRANSPOSED, PLAIN, NOT_UNIT = np.uint8(ord("T")), np.uint8(ord("N")), np.uint8(ord("N"))
ONE, ZERO, MINUS = np.float64(1.0), np.float64(0.0), np.float64(-1.0)

SMALL_WIDTH = 8
SMALL_FRONT = 32
"""Fronts of so few columns and rows are treated by plain loops: a call of BLAS costs more."""


@compiled
def factor_nodes(
    nodes: IntArray,
    structure: Structure,
    update_at: IntArray,
    is_shared: BoolArray,
    room: int,
    values: FloatArray,
    panels: FloatArray,
    workspace: FloatArray,
    scratch: FloatArray,
    pivots: FloatArray,
    tolerance: float,
    stop: int,
    addresses: IntArray,
) -> None:
    """Factors some supernodes.

    Args:
        nodes: the supernodes, children first.
        structure: structure of the factor.
        update_at: (m,) where the update matrix of each supernode lies in the workspace.
        is_shared: (m,) false where that place is counted from `room`.
        room: where the room of these supernodes starts in the workspace.
        values: (nnz,) entries of the matrix.
        panels: the factor, filled.
        workspace: update matrices.
        scratch: room for the square of the widest supernode.
        pivots: (n,) diagonal entries of the matrix; pivots divided by them are filled in.
        tolerance: a relative pivot that is not above it has vanished and is replaced.
        stop: supernodes from this one on are assembled, but not factored.
        addresses: of the BLAS and LAPACK routines.
    """
    start, below_at, relative = structure.start, structure.below_at, structure.relative
    for s in nodes:
        width = start[s + 1] - start[s]
        below = below_at[s + 1] - below_at[s]
        front = width + below
        panel = structure.panel_at[s]
        update = update_at[s] if is_shared[s] else update_at[s] + room
        children = structure.children[structure.children_at[s] : structure.children_at[s + 1]]
        for k in range(panel, structure.panel_at[s + 1]):
            panels[k] = 0.0
        for e in range(structure.entry_at[s], structure.entry_at[s + 1]):
            panels[panel + structure.target[e]] = values[structure.entry[e]]
        for c in children:
            rows = relative[below_at[c] : below_at[c + 1]]
            child = update_at[c] if is_shared[c] else update_at[c] + room
            add_to_panel(rows, workspace, child, panels, panel, width, front)
        if s >= stop:
            continue
        if width <= SMALL_WIDTH and front <= SMALL_FRONT:
            factor_columns(panels, panel, width, front, front, pivots, start[s], tolerance)
            update_small(panels, panel, width, front, workspace, update)
        else:
            factor_panel(panels, panel, width, front, scratch, pivots, start[s], tolerance, addresses)
            update_large(panels, panel, width, front, workspace, update, addresses)
        for c in children:
            rows = relative[below_at[c] : below_at[c + 1]]
            child = update_at[c] if is_shared[c] else update_at[c] + room
            add_to_update(rows, workspace, child, update, width, below)


@compiled
def add_to_panel(
    relative: IndexArray,
    workspace: FloatArray,
    child: int,
    panels: FloatArray,
    panel: int,
    width: int,
    front: int,
) -> None:
    """Adds the columns of a child's update matrix that are columns of the supernode."""
    order = len(relative)
    for j in range(order):
        if relative[j] >= width:
            break
        to, source = panel + relative[j] * front, child + j * order
        for i in range(j, order):
            panels[to + relative[i]] += workspace[source + i]


@compiled
def add_to_update(
    relative: IndexArray, workspace: FloatArray, child: int, update: int, width: int, below: int
) -> None:
    """Adds the columns of a child's update matrix that are rows below of the supernode."""
    order = len(relative)
    for j in range(order - 1, -1, -1):
        if relative[j] < width:
            break
        to, source = update + (relative[j] - width) * below - width, child + j * order
        for i in range(j, order):
            workspace[to + relative[i]] += workspace[source + i]


@compiled
def update_small(
    panels: FloatArray, panel: int, width: int, front: int, workspace: FloatArray, update: int
) -> None:
    """Update matrix of a small front: minus the rows below times their transpose."""
    below = front - width
    for k in range(below):
        to = update + k * below
        factor = panels[panel + width + k]
        for i in range(k, below):
            workspace[to + i] = -factor * panels[panel + width + i]
        for j in range(1, width):
            column = panel + j * front + width
            factor = panels[column + k]
            for i in range(k, below):
                workspace[to + i] -= factor * panels[column + i]


@compiled
def factor_panel(
    panels: FloatArray,
    panel: int,
    width: int,
    front: int,
    scratch: FloatArray,
    pivots: FloatArray,
    first: int,
    tolerance: float,
    addresses: IntArray,
) -> None:
    """Factors a panel by LAPACK; its diagonal block by columns where a pivot vanishes."""
    base = address_of(panels, panel)
    for j in range(width):
        for i in range(j, width):
            scratch[i + j * width] = panels[panel + j * front + i]
    wide, tall, deep = np.int32(width), np.int32(front), np.int32(front - width)
    regular = lapack(addresses[POTRF], (LOWER, wide, base, tall)) == 0
    for j in range(width):
        regular = regular and panels[panel + j * (front + 1)] ** 2 > tolerance * pivots[first + j]
    if regular:
        for j in range(width):
            pivots[first + j] = panels[panel + j * (front + 1)] ** 2 / pivots[first + j]
    else:
        for j in range(width):
            for i in range(j, width):
                panels[panel + j * front + i] = scratch[i + j * width]
        factor_columns(panels, panel, width, front, width, pivots, first, tolerance)
    if deep > 0:
        below = base + 8 * width
        fortran(
            addresses[TRSM],
            (RIGHT, LOWER, TRANSPOSED, NOT_UNIT, deep, wide, ONE, base, tall, below, tall),
        )
    if not regular:
        for j in range(width):
            if not pivots[first + j] > tolerance:
                panels[panel + j * front + width : panel + (j + 1) * front] = 0.0


@compiled
def update_large(
    panels: FloatArray,
    panel: int,
    width: int,
    front: int,
    workspace: FloatArray,
    update: int,
    addresses: IntArray,
) -> None:
    """Update matrix of a front by BLAS."""
    if front == width:
        return
    below = np.int32(front - width)
    source = address_of(panels, panel + width)
    result = address_of(workspace, update)
    fortran(
        addresses[SYRK],
        (LOWER, PLAIN, below, np.int32(width), MINUS, source, np.int32(front), ZERO, result, below),
    )
