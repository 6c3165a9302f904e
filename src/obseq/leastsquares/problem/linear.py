"""Plain linear rows: batches whose coefficients are given, and rows that stand for normal equations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import finite, listed, real
from obseq.leastsquares.problem.batches import Batch, Labels
from obseq.leastsquares.problem.shapes import linear_shape
from obseq.leastsquares.problem.unknowns import UnknownTable


def linear_batch(
    table: UnknownTable,
    columns: Sequence[ArrayLike],
    coefficients: Sequence[ArrayLike],
    values: ArrayLike,
    sigmas: ArrayLike,
    labels: Labels,
    group: str | None,
    is_tangent: bool = False,
) -> Batch:
    """Rows sum of coefficients times unknowns = value; arguments as of `Problem.add_linear`."""
    ids = [table.checked(column, "linear rows") for column in listed(columns, "linear rows")]
    parts = [real(part, "linear rows, coefficients") for part in listed(coefficients, "linear rows")]
    if not ids or len(ids) != len(parts):
        raise InputError(f"linear rows: {len(parts)} sets of coefficients for {len(ids)} blocks")
    shape, right = linear_shape(table, ids, is_tangent), real(values, "linear rows, values")
    n = max(*(len(column) for column in ids), *(len(rows) for rows in (*parts, right) if rows.ndim))
    for part, role in zip(parts, shape.roles, strict=True):
        finite(part, (n, role.size), f"linear rows, coefficients {role.name}")
    rows = np.column_stack([*parts, finite(right, (n,), "linear rows, values")])
    blocks = {role.name: column for role, column in zip(shape.roles, ids, strict=True)}
    return Batch(shape, table, blocks, rows, sigmas, labels, group, None)


def root_rows(matrix: ArrayLike, vector: ArrayLike, m: int) -> tuple[FloatArray, FloatArray]:
    """(k, m) rows R and (k,) right-hand sides s with R'R = A and R's = b, for A (m, m) of rank k and b (m,).

    Raises:
        InputError: A is not symmetric and positive semi-definite.
    """
    given = finite(matrix, (m, m), "normal equations, matrix")
    values, vectors = np.linalg.eigh(given)
    if np.abs(given - given.T).max() > 1e-9 * np.abs(given).max() or values[0] < -1e-9 * values[-1]:
        raise InputError("normal equations: the matrix must be symmetric and positive semi-definite")
    kept = values > 1e-12 * values[-1]
    roots = np.sqrt(values[kept])
    rows = vectors[:, kept].T * roots[:, None]
    return rows, vectors[:, kept].T @ finite(vector, (m,), "normal equations, vector") / roots
