"""The equations as stacked rows, and the steps that are computed from them instead of the normal equations.

Normal equations square the condition number and know only squares. The rows themselves, J dx = -r with every
row divided by its sigma, serve ill-conditioned systems (`qr_step`, `lsmr_step`) and the L1 norm (`l1_step`,
a robust start: at least as many residuals vanish as there are unknowns).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, StepError
from obseq.leastsquares.assembly.evaluation import jacobian_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.sparse import csr_array

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares.assembly.normal_equations import NormalEquations
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.priors import Prior


LSMR_TOLERANCE = 1e-14


@dataclass(frozen=True)
class StackedRows:
    """All equations at the current values, divided by their sigmas.

    Attributes:
        jacobian: (m, n_free) sparse, derivatives.
        residuals: (m,) computed minus observed.
    """

    jacobian: csr_array
    residuals: FloatArray


def stacked_rows(equations: NormalEquations) -> StackedRows:
    """The rows of all active observations and priors, for the free unknowns."""
    from scipy.sparse import coo_array

    parts = [_batch_rows(equations, batch) for batch in equations.batches]
    parts += [_prior_rows(equations, prior) for prior in equations.priors]
    residuals = np.concatenate([part[3] for part in parts])
    starts = np.cumsum([0] + [len(part[3]) for part in parts])
    rows = np.concatenate([part[0] + start for part, start in zip(parts, starts[:-1], strict=True)])
    columns, values = (np.concatenate([part[k] for part in parts]) for k in (1, 2))
    kept = columns >= 0
    entries = (values[kept], (rows[kept], columns[kept]))
    return StackedRows(coo_array(entries, shape=(len(residuals), equations.n_unknowns)).tocsr(), residuals)


def _batch_rows(
    equations: NormalEquations, batch: Batch
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """(row, column or -1 where frozen, value) of the derivatives; residuals of active observations."""
    if batch.clusters is not None:
        raise InputError(f"{batch.name}: steps of rows are not for observations correlated with one another")
    active = np.flatnonzero(batch.active)
    m, n_unknowns = batch.shape.n_residuals, batch.shape.n_unknowns
    rows = jacobian_rows(equations.table, batch)[:, active]
    weights = batch.weights[:, active]
    derivatives = rows[m:].reshape(m, n_unknowns, len(active)) * weights[:, None, :]
    starts = equations.table.start[batch.blocks[:, active]]
    columns = np.concatenate(
        [
            equations.free.number[start + np.arange(role.size)[:, None]]
            for start, role in zip(starts, batch.shape.roles, strict=True)
        ]
    )
    numbers = np.arange(m)[:, None] * len(active) + np.arange(len(active))
    row = np.broadcast_to(numbers[:, None, :], derivatives.shape)
    column = np.broadcast_to(columns[None], derivatives.shape)
    return row.ravel(), column.ravel(), derivatives.ravel(), (rows[:m] * weights).ravel()


def _prior_rows(
    equations: NormalEquations, prior: Prior
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    columns = equations.free.number[prior.scalars]
    residuals = prior.residuals(equations.table.values) * prior.weights
    return np.arange(len(columns)), columns, prior.weights, residuals


def qr_step(rows: StackedRows) -> FloatArray:
    """The least-squares step by a dense orthogonal factorisation with column pivoting: for small systems."""
    from scipy.linalg import lstsq

    dense = rows.jacobian.toarray()
    scale = _column_norms(rows)
    return np.asarray(lstsq(dense / scale, -rows.residuals, lapack_driver="gelsy")[0] / scale)


def lsmr_step(rows: StackedRows, max_iterations: int | None = None) -> FloatArray:
    """The least-squares step by LSMR (Fong and Saunders, 2011) on columns of unit length.

    Raises:
        StepError: It did not converge in `max_iterations` (4 times the number of unknowns when None).
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import lsmr

    scale = _column_norms(rows)
    scaled = rows.jacobian @ diags_array(1.0 / scale)
    limit = max_iterations or 4 * scaled.shape[1] + 100
    found = lsmr(scaled, -rows.residuals, atol=LSMR_TOLERANCE, btol=LSMR_TOLERANCE, conlim=0.0, maxiter=limit)
    if found[1] == 7:
        raise StepError(
            f"LSMR did not converge in {limit} iterations: the system is too ill-conditioned for it; "
            "solve it by QR, or determine its unknowns better"
        )
    return np.asarray(found[0] / scale)


def l1_step(rows: StackedRows) -> FloatArray:
    """The step that minimises the sum of absolute weighted residuals, by linear programming.

    Minimises sum(p + q) subject to J dx + r = p - q, p and q not negative.

    Raises:
        StepError: The program has no bounded solution, or the solver gave up; the message is the solver's.
    """
    from scipy.optimize import linprog
    from scipy.sparse import eye_array, hstack

    m, n = rows.jacobian.shape
    constraint = hstack([rows.jacobian, -eye_array(m), eye_array(m)], format="csr")
    cost = np.concatenate([np.zeros(n), np.ones(2 * m)])
    bounds = [(None, None)] * n + [(0.0, None)] * (2 * m)
    found = linprog(cost, A_eq=constraint, b_eq=-rows.residuals, bounds=bounds, method="highs")
    if not found.success or found.x is None:
        raise StepError(f"the L1 step was not found: {found.message}")
    return np.asarray(found.x[:n])


def _column_norms(rows: StackedRows) -> FloatArray:
    norms = np.sqrt(np.asarray(rows.jacobian.power(2).sum(axis=0)).ravel())
    return np.where(norms > 0.0, norms, 1.0)


ROW_STEPS: dict[str, Callable[[StackedRows], FloatArray]] = {"qr": qr_step, "lsmr": lsmr_step, "l1": l1_step}
"""The steps that go by the rows, by the names of strategies."""
