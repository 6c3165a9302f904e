"""Selected inverse: entries of the inverse on the pattern of the factor, from the root down (Takahashi)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from obseq.leastsquares.solvers.blas import GEMM, POTRI, SYMM, TRSM, fortran
from obseq.leastsquares.solvers.numeric import (
    LEFT,
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

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[Any]


@njit(cache=True, nogil=True, error_model="numpy")
def invert_nodes(
    nodes: Array,
    start: Array,
    parent: Array,
    below_at: Array,
    relative: Array,
    panel_at: Array,
    entry_at: Array,
    entry: Array,
    target: Array,
    front_at: Array,
    panels: Array,
    workspace: Array,
    scratch: Array,
    selected: Array,
    addresses: Array,
) -> None:
    """Inverse on the fronts of the supernodes `nodes`, parents first; keeps the entries of the pattern.

    With L_JJ, L_RJ the panel of columns J and rows below R, and Y = L_RJ L_JJ^-1:
    Z_RJ = -Z_RR Y and Z_JJ = (L_JJ L_JJ')^-1 - Y' Z_RJ, where Z_RR is part of the parent's front.

    Args:
        nodes: the supernodes, ascending; they are visited backwards.
        start, ..., target: the structure, see `Symbolic`.
        front_at: (m,) where the inverse on the front of each supernode lies in the workspace.
        panels: the factor.
        workspace: inverses on fronts (lower triangles), those of the ancestors of the current one.
        scratch: room for the largest panel.
        selected: (nnz,) entries of the inverse, filled for these supernodes.
        addresses: of the BLAS and LAPACK routines.
    """
    for index in range(len(nodes) - 1, -1, -1):
        s = nodes[index]
        width = start[s + 1] - start[s]
        below = below_at[s + 1] - below_at[s]
        front, at, panel = width + below, front_at[s], panel_at[s]
        if below > 0:
            p = parent[s]
            outer = start[p + 1] - start[p] + below_at[p + 1] - below_at[p]
            gather_from_parent(
                relative[below_at[s] : below_at[s + 1]], workspace, front_at[p], outer, at, width, front
            )
        if width <= SMALL_WIDTH and front <= SMALL_FRONT:
            invert_small(panels, panel, width, front, workspace, at, scratch)
        else:
            invert_large(panels, panel, width, front, workspace, at, scratch, addresses)
        for e in range(entry_at[s], entry_at[s + 1]):
            selected[entry[e]] = workspace[at + target[e]]


@njit(cache=True, nogil=True, error_model="numpy")
def gather_from_parent(
    relative: Array, workspace: Array, source: int, outer: int, at: int, width: int, front: int
) -> None:
    """Copies the inverse on the rows below (lower triangle) from the front of the parent."""
    order = len(relative)
    for j in range(order):
        column, to = source + relative[j] * outer, at + (width + j) * front + width
        for i in range(j, order):
            workspace[to + i] = workspace[column + relative[i]]


@njit(cache=True, nogil=True, error_model="numpy")
def invert_small(
    panels: Array, panel: int, width: int, front: int, workspace: Array, at: int, scratch: Array
) -> None:
    """Inverse on a small front by plain loops; the columns of the supernode from the last to the first.

    Column j alone: y = L_rj / l_jj for all rows r after j, Z_rj = -Z_rr y, z_jj = 1 / l_jj^2 - y' Z_rj.
    """
    for j in range(width - 1, -1, -1):
        column, to = panel + j * front, at + j * front
        inverse = 1.0 / panels[column + j]
        for i in range(j + 1, front):
            scratch[i] = panels[column + i] * inverse
            workspace[to + i] = 0.0
        for k in range(j + 1, front):
            other, y = at + k * front, scratch[k]
            total = workspace[other + k] * y
            for i in range(k + 1, front):
                workspace[to + i] -= workspace[other + i] * y
                total += workspace[other + i] * scratch[i]
            workspace[to + k] -= total
        diagonal = inverse * inverse
        for i in range(j + 1, front):
            diagonal -= scratch[i] * workspace[to + i]
        workspace[to + j] = diagonal


@njit(cache=True, nogil=True, error_model="numpy")
def invert_large(
    panels: Array,
    panel: int,
    width: int,
    front: int,
    workspace: Array,
    at: int,
    scratch: Array,
    addresses: Array,
) -> None:
    """Inverse on a front by BLAS."""
    below = front - width
    for j in range(width):
        for i in range(j, width):
            workspace[at + j * front + i] = panels[panel + j * front + i]
        for i in range(below):
            scratch[j * below + i] = panels[panel + j * front + width + i]
    result = np.int64(workspace.ctypes.data) + 8 * at
    status = np.zeros(1, np.int32)
    wide, tall, deep = np.int32(width), np.int32(front), np.int32(below)
    if below > 0:
        y, triangle = np.int64(scratch.ctypes.data), np.int64(panels.ctypes.data) + 8 * panel
        corner, side = result + 8 * (width * front + width), result + 8 * width
        fortran(addresses[TRSM], (RIGHT, LOWER, PLAIN, NOT_UNIT, deep, wide, ONE, triangle, tall, y, deep))
        fortran(addresses[SYMM], (LEFT, LOWER, deep, wide, MINUS, corner, tall, y, deep, ZERO, side, tall))
    fortran(addresses[POTRI], (LOWER, wide, result, tall, np.int64(status.ctypes.data)))
    if below > 0:
        fortran(
            addresses[GEMM],
            (TRANSPOSED, PLAIN, wide, wide, deep, MINUS, y, deep, side, tall, ONE, result, tall),
        )
