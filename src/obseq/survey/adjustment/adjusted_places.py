"""Adjusted points and stations, in columns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.dataclass import dataclass
from obseq.records.adjustment import PointRecord, StationRecord
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from obseq.arrays import FloatArray
    from obseq.records.adjustment import EllipseRecord
    from obseq.survey.model import Points

COORDINATES = tuple(f"{system}{axis}" for system in ("", "s", "crs_", "crs_s") for axis in "xyz")
"""Fields of a point record, in the order in which they are filled."""
ROWS, COLUMNS = [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]
"""Of the upper triangle of a covariance."""
IN_PLAN = [0, 1, 3]
"""Those of x and y."""


@dataclass(frozen=True, eq=False)
class AdjustedPoints:
    """Adjusted points, one row each.

    Attributes:
        points: The points as they were given.
        places: (n, 3) in the computation frame, m: what was computed with, known or not.
        covariances: (n, 3, 3) in the computation frame, m^2; 0 for what was held.
        crs_coordinates: (n, 3) in the system of the points; NaN for what nothing observes.
        crs_precisions: (n, 3) m: along the axes of the system of the points; along east, north and up when
            it is in degrees or grads. NaN likewise.
    """

    points: Points
    places: FloatArray
    covariances: FloatArray
    crs_coordinates: FloatArray
    crs_precisions: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return self.points.names

    @property
    def coordinates(self) -> FloatArray:
        """(n, 3) in the computation frame, m; NaN for what nothing observes."""
        return np.where(self.points.is_invented, np.nan, self.places)

    @property
    def precisions(self) -> FloatArray:
        """(n, 3) standard deviations in the computation frame, m; NaN likewise."""
        found = np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))
        return np.where(self.points.is_invented, np.nan, found)

    def records(self, ellipses: Iterable[EllipseRecord]) -> Iterator[PointRecord]:
        """Their entries in the record, each with its ellipse."""
        upper = self.covariances[:, ROWS, COLUMNS]
        numbers = [self.coordinates, self.precisions, self.crs_coordinates, self.crs_precisions]
        rows = np.hstack(numbers)
        invented = self.points.is_invented
        upper[invented[:, ROWS] | invented[:, COLUMNS]] = np.nan
        is_planless: list[bool] = np.asarray(np.isnan(upper[:, IN_PLAN]).any(axis=1)).tolist()
        for k, (name, ellipse) in enumerate(zip(self.names, ellipses, strict=True)):
            keys: dict[str, Any] = dict(zip(COORDINATES, _known(rows[k]), strict=True))
            keys |= {"covariance": tuple(_known(upper[k])), "ellipse": None if is_planless[k] else ellipse}
            yield PointRecord(name=name, **keys)


def _known(numbers: FloatArray) -> list[float | None]:
    """The numbers; None for what is not known."""
    return [None if number != number else number for number in numbers.tolist()]


@dataclass(frozen=True, eq=False)
class AdjustedStations:
    """Adjusted stations, one row each.

    Attributes:
        origins: Names of their points.
        orientations: (m,) int8 values of `Orientation`, after the automatic #FIX.
        g0: (m,) azimuth of the zero of the horizontal circle, rad.
        rotations: (m, 3, 3) from the local vertical (or the frame, where it has none) to the instrument.
    """

    origins: tuple[str, ...]
    orientations: NDArray[np.int8]
    g0: FloatArray
    rotations: FloatArray

    def records(self) -> tuple[StationRecord, ...]:
        """Their entries in the record."""
        columns = zip(self.origins, self.orientations, self.g0.tolist(), strict=True)
        return tuple(StationRecord(origin, Orientation(status).keyword, g0) for origin, status, g0 in columns)
