"""Many small matrices at once."""

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray, IntArray


def inverse3(matrices: npt.ArrayLike) -> FloatArray:
    """Inverses (..., 3, 3) by cofactors: not finite, instead of an error, where a matrix is singular."""
    a, b, c = np.moveaxis(np.asarray(matrices, dtype=np.float64), -1, 0)
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(rows / np.sum(a * rows[..., 0, :], axis=-1)[..., None, None])


def sums_by_owner(parts: FloatArray, owner: IntArray, n: int) -> FloatArray:
    """(n, ...) sums of the parts (m, ...) of each owner (m,); zero for an owner without parts."""
    columns = [np.bincount(owner, column, n) for column in parts.reshape(len(parts), -1).T]
    return np.stack(columns, axis=1).astype(np.float64).reshape(n, *parts.shape[1:])
