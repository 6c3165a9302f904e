"""Selected inverse: entries of the inverse on the pattern of the factor, from the root down (Takahashi)."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IndexArray, IntArray
from obseq.compilation import compiled
from obseq.compilation.digests import SUMS
from obseq.leastsquares.solvers.blas import GEMM, POTRI, SYMM, TRSM, address_of, fortran, lapack
from obseq.leastsquares.solvers.dense_loops import invert_small
from obseq.leastsquares.solvers.numeric import (
    LOWER,
    MINUS,
    NOT_UNIT,
    ONE,
    PLAIN,
    RIGHT,
    SMALL_FRONT,
    SMALL_WIDTH,
    TRANSPOSED,
    ZERO,
)
from obseq.leastsquares.solvers.symbolic import Structure

FROM_LEFT = np.uint8(ord("L"))


@compiled(flags=SUMS)
def invert_nodes(
    nodes: IntArray,
    structure: Structure,
    front_at: IntArray,
    update_at: IntArray,
    is_shared: BoolArray,
    room: int,
    panels: FloatArray,
    workspace: FloatArray,
    scratch: FloatArray,
    stop: int,
    selected: FloatArray,
    addresses: IntArray,
) -> None:
    """Inverse on the fronts of some supernodes, parents first; keeps the entries of the pattern.

    With L_JJ, L_RJ the panel of columns J and rows below R, and Y = L_RJ L_JJ^-1:
    Z_RJ = -Z_RR Y and Z_JJ = (L_JJ L_JJ')^-1 - Y' Z_RJ, where Z_RR is part of the parent's front.

    Args:
        nodes: the supernodes, children first; they are visited backwards.
        structure: structure of the factor.
        front_at: (m,) where the inverse on each front lies, counted from `room`.
        update_at: (m,) where the inverse on the rows below of the shared supernodes lies in the workspace.
        is_shared: (m,) supernodes whose parent was, or whose children will be, treated elsewhere.
        room: where the room of these supernodes starts in the workspace.
        panels: the factor.
        workspace: inverses on fronts (lower triangles), those of the ancestors of the current one.
        scratch: room for the largest panel.
        stop: supernodes from this one on have their inverse in the workspace already.
        selected: (nnz,) entries of the inverse, filled for these supernodes.
        addresses: of the BLAS and LAPACK routines.
    """
    start, below_at, relative = structure.start, structure.below_at, structure.relative
    for index in range(len(nodes) - 1, -1, -1):
        s = nodes[index]
        width = start[s + 1] - start[s]
        below = below_at[s + 1] - below_at[s]
        front, at, panel = width + below, room + front_at[s], structure.panel_at[s]
        corner = at + width * (front + 1)
        if is_shared[s]:
            copy_triangle(workspace, update_at[s], below, corner, front, below)
        elif below > 0:
            p = structure.parent[s]
            outer = start[p + 1] - start[p] + below_at[p + 1] - below_at[p]
            rows = relative[below_at[s] : below_at[s + 1]]
            gather_triangle(rows, workspace, room + front_at[p], outer, corner, front)
        if s >= stop:
            pass
        elif width <= SMALL_WIDTH and front <= SMALL_FRONT:
            invert_small(panels, panel, width, front, workspace, at, scratch)
        else:
            invert_large(panels, panel, width, front, workspace, at, scratch, addresses)
        for e in range(structure.entry_at[s], structure.entry_at[s + 1]):
            selected[structure.entry[e]] = workspace[at + structure.target[e]]
        for c in structure.children[structure.children_at[s] : structure.children_at[s + 1]]:
            if is_shared[c]:
                rows = relative[below_at[c] : below_at[c + 1]]
                gather_triangle(rows, workspace, at, front, update_at[c], len(rows))


@compiled
def gather_triangle(
    relative: IndexArray, workspace: FloatArray, source: int, outer: int, to: int, stride: int
) -> None:
    """Copies the rows and columns `relative` of the lower triangle of a front of order `outer`."""
    order = len(relative)
    for j in range(order):
        column = source + relative[j] * outer
        for i in range(j, order):
            workspace[to + j * stride + i] = workspace[column + relative[i]]


@compiled
def copy_triangle(
    workspace: FloatArray, source: int, source_stride: int, to: int, stride: int, order: int
) -> None:
    """Copies a lower triangle."""
    for j in range(order):
        for i in range(j, order):
            workspace[to + j * stride + i] = workspace[source + j * source_stride + i]


@compiled(flags=SUMS)
def invert_large(
    panels: FloatArray,
    panel: int,
    width: int,
    front: int,
    workspace: FloatArray,
    at: int,
    scratch: FloatArray,
    addresses: IntArray,
) -> None:
    """Inverse on a front by BLAS."""
    below = front - width
    for j in range(width):
        for i in range(j, width):
            workspace[at + j * front + i] = panels[panel + j * front + i]
        for i in range(below):
            scratch[j * below + i] = panels[panel + j * front + width + i]
    result = address_of(workspace, at)
    wide, tall, deep = np.int32(width), np.int32(front), np.int32(below)
    if below > 0:
        y, triangle = address_of(scratch, 0), address_of(panels, panel)
        corner, side = result + 8 * (width * front + width), result + 8 * width
        fortran(addresses[TRSM], (RIGHT, LOWER, PLAIN, NOT_UNIT, deep, wide, ONE, triangle, tall, y, deep))
        fortran(
            addresses[SYMM], (FROM_LEFT, LOWER, deep, wide, MINUS, corner, tall, y, deep, ZERO, side, tall)
        )
    lapack(addresses[POTRI], (LOWER, wide, result, tall))
    if below > 0:
        fortran(
            addresses[GEMM],
            (TRANSPOSED, PLAIN, wide, wide, deep, MINUS, y, deep, side, tall, ONE, result, tall),
        )
