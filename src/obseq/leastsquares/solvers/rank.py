"""Which of the unknowns with suspicious pivots the matrix really leaves undetermined.

A pivot alone does not tell. Where it should vanish, rounding leaves eps z' diag(N) z / (n_jj z_j^2) of the
diagonal entry, z the vector of the kernel that ends with unknown j: 1e-16 to 1e-10, and any more where j has
little part in it (a height of one image in the scale of a large block). A system that a weak prior holds has
pivots of that size too. The quotient z' N z / z' diag(N) z of the vectors in question does tell: its own
rounding stays near 1e-16.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from obseq.arrays import FloatArray, IntArray
from obseq.leastsquares.solvers.protocol import Defect, SymmetricPattern

SUSPICIOUS = 1e-8
"""A pivot that is not above this share of its diagonal entry is replaced, and the unknown examined."""

CLEAR = 1e-5
"""A pivot above this share is no rounding: what ends a vector of the kernel has more part in it."""

VANISHING = 1e-14
"""A vector whose quotient is not above this is in the kernel: a prior sigma may be 1e7 times the others."""

INVERSE_STEPS = 3
"""Each brings a vector nearer to the kernel, by what its quotient is below those of the other vectors."""

LARGEST_EXAMINED = 64
"""Beyond this number of suspicious unknowns all are taken as undetermined: whole parts are not observed."""


_NONE: IntArray = np.zeros(0, dtype=np.int64)
_NO_PIVOTS: FloatArray = np.zeros(0)


def replacement_pivots(diagonal: FloatArray) -> FloatArray:
    """What replaces vanishing pivots: the diagonal entries of the matrix, 1 where they are not positive."""
    return np.where(diagonal > 0.0, diagonal, 1.0)


def relative_pivots(pivots: FloatArray, diagonal: FloatArray) -> FloatArray:
    """Pivots divided by the diagonal entries; 0 where the diagonal entry is zero or negative."""
    return np.where(diagonal > 0.0, pivots / replacement_pivots(diagonal), np.minimum(diagonal, 0.0))


def defect_of(pivots: FloatArray, tolerance: float) -> Defect:
    """The unknowns whose relative pivots ((n,), in the order of the unknowns) are not above the tolerance."""
    least = float(pivots.min(initial=1.0))
    if least > tolerance:
        return Defect(_NONE, _NO_PIVOTS, least)
    is_above = pivots > tolerance
    indices: IntArray = np.flatnonzero(~is_above)
    return Defect(indices, pivots[indices], float(pivots[is_above].min(initial=1.0)))


def factor_stepwise(
    pattern: SymmetricPattern,
    values: FloatArray,
    tolerance: float,
    attempt: Callable[[FloatArray, FloatArray], FloatArray],
    order: Callable[[], NDArray[np.integer]],
) -> Defect:
    """Factors with a library that cannot replace a pivot on its way: adds to the diagonal and starts again.

    The first pivot that is too small, in the order of elimination, is the one that can be trusted to be so.

    Args:
        pattern: pattern of the matrix.
        values: (nnz,) entries of the matrix.
        tolerance: a pivot is too small if it is not above this share of the diagonal entry.
        attempt: factors the matrix of these values; returns its pivots divided by the second argument.
        order: unknowns in the order of elimination of the last attempt.
    """
    scale = replacement_pivots(values[pattern.diagonal])
    added = np.where(values[pattern.diagonal] <= 0.0, 1.0, 0.0)
    while True:
        shifted = values.copy()
        shifted[pattern.diagonal] += added * scale
        pivots = attempt(shifted, scale)
        small = order()[~(pivots[order()] > tolerance)]
        if len(small) == 0:
            indices: IntArray = np.flatnonzero(added)
            weakest = float(np.min(pivots[added == 0.0], initial=1.0))
            return Defect(indices, (pivots - added)[indices], weakest)
        added[small[0]] = max(1.0, 2.0 * added[small[0]])


def undetermined(
    suspects: Defect,
    pattern: SymmetricPattern,
    values: FloatArray,
    solve: Callable[[FloatArray], FloatArray],
) -> Defect:
    """The suspects that the matrix leaves undetermined, as many as its kernel has dimensions.

    Args:
        suspects: unknowns whose pivots were replaced.
        pattern: pattern of the matrix.
        values: (nnz,) entries of the matrix.
        solve: solves with the factor in which these pivots are replaced.
    """
    diagonal = values[pattern.diagonal[suspects.indices]]
    is_certain = (diagonal <= 0.0) | (suspects.pivots < -CLEAR)
    doubtful = suspects.indices[~is_certain]
    if len(doubtful) == 0 or suspects.dimension > LARGEST_EXAMINED:
        return suspects
    vectors = kernel(suspects.indices, pattern, values, solve)
    dimension = max(0, vectors.shape[1] - np.count_nonzero(diagonal <= 0.0))
    scaled = vectors[doubtful] * np.sqrt(diagonal[~is_certain])[:, None]
    chosen = np.sort(
        np.concatenate([suspects.indices[is_certain], doubtful[leading_rows(scaled, dimension)]])
    )
    return Defect(chosen, suspects.pivots[np.searchsorted(suspects.indices, chosen)])


def leading_rows(vectors: FloatArray, count: int) -> IntArray:
    """(count,) rows of vectors (n, k) that are the most independent ones."""
    from scipy.linalg import qr

    return np.asarray(qr(vectors.T, mode="r", pivoting=True)[1][:count], dtype=np.int64)


def hidden(
    pattern: SymmetricPattern, values: FloatArray, solve: Callable[[FloatArray], FloatArray]
) -> int | None:
    """The unknown with the largest part in a vector that a matrix leaves undetermined; None without such.

    Arguments as of `undetermined`, of a matrix whose pivots do not tell. Inverse iteration finds the vector,
    unknowns scaled by diag(N).
    """
    scale = np.sqrt(replacement_pivots(values[pattern.diagonal]))[:, None]
    vector = np.cos(np.square(np.arange(1.0, pattern.n + 1.0)))[:, None]
    for _ in range(INVERSE_STEPS):
        vector = scale * solve(scale * vector)
        vector /= np.linalg.norm(vector)
    quotient = np.sum(vector * pattern.product(values, vector / scale) / scale)
    return int(np.argmax(np.abs(vector))) if quotient <= VANISHING else None


def kernel(
    replaced: IntArray,
    pattern: SymmetricPattern,
    values: FloatArray,
    solve: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """(n, k) orthonormal basis of the kernel, from a factor in which some pivots are replaced.

    With M = N + E W E', N z = 0 gives z = M^-1 E (W E' z): the kernel is within the columns of M^-1 E. Among
    them the vectors with the least quotients are found by Rayleigh and Ritz, unknowns scaled by diag(N).
    """
    diagonal = replacement_pivots(values[pattern.diagonal])
    right = np.zeros((pattern.n, len(replaced)))
    right[replaced, np.arange(len(replaced))] = diagonal[replaced]
    scale = np.sqrt(diagonal)[:, None]
    basis = np.linalg.qr(scale * solve(right))[0]
    quotients, rotation = np.linalg.eigh(basis.T @ (pattern.product(values, basis / scale) / scale))
    return np.linalg.qr((basis @ rotation[:, quotients <= VANISHING]) / scale)[0]
