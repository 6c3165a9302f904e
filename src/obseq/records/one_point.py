"""What a record says of one point that is asked for by its name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.printable import listed

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.records.quality import EllipseRecord
    from obseq.records.rows import AnyRows

PLACES = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
"""Of xx, xy, xz, yy, yz, zz."""
MOST_NAMES = 8


def covariance(points: AnyRows, name: str) -> FloatArray:
    """(3, 3) covariance of a point in the computation frame, m^2; NaN where nothing is known of it.

    Raises:
        InputError: There is no such point.
    """
    import numpy as np

    found = np.full((3, 3), np.nan)
    upper = [
        np.nan if value is None else value for value in points[_row(points, name)].covariance or [None] * 6
    ]
    found[PLACES] = found[PLACES[::-1]] = upper
    return found


def ellipse(points: AnyRows, name: str, level: float | None, held: float | None) -> EllipseRecord:
    """The error ellipse of a point in x and y.

    Args:
        points: Of the record.
        name: Of the point.
        level: Probability that the true point is inside; None: standard ellipses.
        held: Of the ellipses of the record.

    Raises:
        InputError: There is no such point, none of that level, or the point has no ellipse.
    """
    if level != held:
        raise InputError(
            f"the record holds ellipses of level {held}, not {level}: ask for level={held}, or adjust again "
            f"with Quality(ellipses={level})"
        )
    found: EllipseRecord | None = points[_row(points, name)].ellipse
    if found is None:
        raise InputError(f"{name} has no ellipse: nothing is estimated of its x and y")
    return found


def _row(points: AnyRows, name: str) -> int:
    names = points.values("name")
    if name not in names:
        raise InputError(f"{name} is no point of this record; its points are {listed(names, MOST_NAMES)}")
    return names.index(name)
