"""Normal equations of SINEX files: what a solution says without the constraints that made it one."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError

NORMAL_MATRIX = "SOLUTION/NORMAL_EQUATION_MATRIX"
NORMAL_VECTOR = "SOLUTION/NORMAL_EQUATION_VECTOR"
LEAST = 1e-10
"""Share of the largest eigenvalue below which normal equations say nothing."""


def is_singular(covariance: FloatArray) -> bool:
    """Whether a covariance (n, n) leaves something exactly known: that of a free network."""
    sigmas = np.sqrt(np.diag(covariance))
    if not (sigmas > 0.0).all():
        return True
    return bool(np.linalg.eigvalsh(covariance / np.outer(sigmas, sigmas))[0] < LEAST)


def reduced(matrix: FloatArray, vector: FloatArray, kept: IntArray) -> tuple[FloatArray, FloatArray]:
    """Normal equations of some parameters, the others eliminated.

    Args:
        matrix: (n, n) of all parameters.
        vector: (n,) right-hand sides.
        kept: (m,) which are kept.
    """
    gone = np.setdiff1d(np.arange(len(vector)), kept)
    between = matrix[np.ix_(kept, gone)] @ np.linalg.pinv(
        matrix[np.ix_(gone, gone)], rcond=LEAST, hermitian=True
    )
    return (
        matrix[np.ix_(kept, kept)] - between @ matrix[np.ix_(gone, kept)],
        vector[kept] - between @ vector[gone],
    )


def rows_of(
    matrix: FloatArray, vector: FloatArray, start: FloatArray, what: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Observations that say the same: unit rows (r, n), values (r,) and sigmas (r,).

    Args:
        matrix: (n, n) normal equations.
        vector: (n,) their right-hand sides, for changes from the start.
        start: (n,) values of the parameters.
        what: The file, for messages.

    Raises:
        InputError: The matrix has negative eigenvalues, or is nothing.
    """
    eigenvalues, vectors = np.linalg.eigh(matrix)
    largest = float(eigenvalues[-1])
    if not largest > 0.0 or eigenvalues[0] < -1e-6 * largest:
        raise InputError(
            f"{what}: {NORMAL_MATRIX} is not that of normal equations: an eigenvalue is negative"
        )
    kept = eigenvalues > LEAST * largest
    rows, sizes = vectors[:, kept].T, eigenvalues[kept]
    return rows, rows @ start + (rows @ vector) / sizes, 1.0 / np.sqrt(sizes)


def normals_of(covariance: FloatArray) -> FloatArray:
    """(n, n) normal equations of a free network, from its covariance with the datum of all its points."""
    return np.asarray(np.linalg.pinv(covariance, rcond=LEAST, hermitian=True))
