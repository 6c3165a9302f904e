"""Plain loops over small dense panels: factor, solution, inverse. Loading and calling BLAS costs more."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, FloatRows
from obseq.compilation import compiled
from obseq.compilation.digests import SUMS


@compiled
def factor_columns(
    panels: FloatArray,
    panel: int,
    width: int,
    front: int,
    rows: int,
    pivots: FloatArray,
    first: int,
    tolerance: float,
) -> None:
    """Factors the first `rows` rows of a panel in place, by columns; replaces the pivots that vanish.

    `pivots[first:]` holds the diagonal entries of the matrix and receives the relative pivots.
    """
    for j in range(width):
        column = panel + j * front
        diagonal, pivot = pivots[first + j], panels[column + j]
        relative = pivot / diagonal if diagonal > 0.0 else min(diagonal, 0.0)
        pivots[first + j] = relative
        if relative > tolerance:
            root = np.sqrt(pivot)
            inverse = 1.0 / root
        else:
            root = np.sqrt(diagonal) if diagonal > 0.0 else 1.0
            inverse = 0.0
        panels[column + j] = root
        for i in range(j + 1, rows):
            panels[column + i] *= inverse
        for k in range(j + 1, width):
            factor = panels[column + k]
            other = panel + k * front
            for i in range(k, rows):
                panels[other + i] -= factor * panels[column + i]


@compiled(flags=SUMS)
def invert_small(
    panels: FloatArray,
    panel: int,
    width: int,
    front: int,
    workspace: FloatArray,
    at: int,
    scratch: FloatArray,
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


@compiled(flags=SUMS)
def solve_columns(panels: FloatArray, width: int, x: FloatRows) -> None:
    """Solves L L' y = x in place for each row of x (k, width), with a factor of `factor_columns`."""
    for right in range(len(x)):
        for j in range(width):
            column = j * width
            y = x[right, j] / panels[column + j]
            x[right, j] = y
            for i in range(j + 1, width):
                x[right, i] -= y * panels[column + i]
        for j in range(width - 1, -1, -1):
            column = j * width
            y = x[right, j]
            for i in range(j + 1, width):
                y -= panels[column + i] * x[right, i]
            x[right, j] = y / panels[column + j]
