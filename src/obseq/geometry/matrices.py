"""Many small matrices at once."""

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray, IntArray


def inverse3(matrices: npt.ArrayLike) -> FloatArray:
    """Inverses (..., 3, 3) by cofactors: not finite, instead of an error, where a matrix is singular."""
    given = np.asarray(matrices, dtype=np.float64)
    a, b, c, d, e, f, g, h, i = given.reshape(-1, 9).T
    rows = (
        (e * i - f * h, c * h - b * i, b * f - c * e),
        (f * g - d * i, a * i - c * g, c * d - a * f),
        (d * h - e * g, b * g - a * h, a * e - b * d),
    )
    inverses = np.array(rows).reshape(9, -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverses /= a * inverses[0] + d * inverses[1] + g * inverses[2]
    return inverses.T.reshape(given.shape)


def sums_by_owner(parts: FloatArray, owner: IntArray, n: int) -> FloatArray:
    """(n, ...) sums of the parts (m, ...) of each owner (m,); zero for an owner without parts."""
    columns = parts.reshape(len(parts), -1).T
    sums = np.empty((n, len(columns)))
    for k, column in enumerate(columns):
        sums[:, k] = np.bincount(owner, column, n)
    return sums.reshape(n, *parts.shape[1:])
