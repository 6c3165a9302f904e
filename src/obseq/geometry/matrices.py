"""Many small matrices at once."""

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray, IntArray


def inverse3(matrices: npt.ArrayLike) -> FloatArray:
    """Inverses (..., 3, 3) by cofactors: not finite, instead of an error, where a matrix is singular."""
    m = np.moveaxis(np.asarray(matrices, dtype=np.float64), (-1, -2), (0, 1))
    inverses = np.empty((*m.shape[2:], 3, 3))
    for i, j in np.ndindex(3, 3):  # i - 2 is the axis after i, i - 1 the one before it
        inverses[..., i, j] = m[i - 2, j - 2] * m[i - 1, j - 1] - m[i - 2, j - 1] * m[i - 1, j - 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverses /= sum(m[0, j] * inverses[..., 0, j] for j in range(3))[..., None, None]
    return inverses


def sums_by_owner(parts: FloatArray, owner: IntArray, n: int) -> FloatArray:
    """(n, ...) sums of the parts (m, ...) of each owner (m,); zero for an owner without parts."""
    columns = [np.bincount(owner, column, n) for column in parts.reshape(len(parts), -1).T]
    return np.stack(columns, axis=1).astype(np.float64).reshape(n, *parts.shape[1:])
