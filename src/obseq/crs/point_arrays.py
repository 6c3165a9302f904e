"""Arrays of points: shapes, finiteness, and how a point is called in a message."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from obseq.arguments import ARRAY, require
from obseq.arrays import FloatArray
from obseq.errors import CrsError


def as_points(points: npt.ArrayLike) -> FloatArray:
    """Points as an array (..., 3) float64.

    Raises:
        CrsError: if the last axis does not hold x, y, z.
    """
    require("coordinates", "points", points, ARRAY)
    array = np.asarray(points, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise CrsError(
            f"Points need three coordinates on their last axis; this array has shape {array.shape}."
        )
    return array


def check_finite(
    converted: FloatArray, given: FloatArray, complaint: str, names: Sequence[str] | None = None
) -> None:
    """Raises a CrsError that names the first point of `converted` (..., 3) that is not finite.

    Args:
        converted: result of a conversion.
        given: the coordinates it came from, quoted in the message.
        complaint: end of the message, after the name and the coordinates of the point.
        names: names of the points, in order; without them the message gives the index.
    """
    finite = np.isfinite(converted)
    if finite.all():
        return
    bad = np.flatnonzero(~finite.reshape(-1, 3).all(axis=1))
    first = int(bad[0])
    coordinates = ", ".join(f"{value:.10g}" for value in given.reshape(-1, 3)[first])
    others = f" ({bad.size - 1} more points fail.)" if bad.size > 1 else ""
    raise CrsError(f"{point_name(first, names)} ({coordinates}) {complaint}{others}")


def point_name(index: int, names: Sequence[str] | None) -> str:
    """How a message calls the point of this index."""
    return f"Point {names[index]}" if names is not None else f"The point of index {index}"
