"""Error ellipses and ellipsoids of points, and the precision of points relative to each other."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.solution.result import LeastSquaresResult
from obseq.leastsquares.statistics.distributions import chi_square_limit
from obseq.leastsquares.statistics.hypothesis_tests import checked_probability

PAIRS_AT_A_TIME = 64
"""Pairs of points whose covariances are solved for together: memory is this times the number of unknowns."""


@dataclass(frozen=True)
class ErrorEllipses:
    """Ellipses of points in the plane of their first two coordinates.

    Attributes:
        names: (n,) the points, or the pairs of points.
        semi_major: (n,) in the unit of the coordinates.
        semi_minor: (n,) the same.
        bearing: (n,) of the major axis, in radians clockwise from the y axis, in [0, pi); 0 for a circle.
        level: probability that the true point is inside; None for standard ellipses: 39 %.
        factor: what multiplies the axes of the standard ellipse.
    """

    names: tuple[str, ...]
    semi_major: FloatArray
    semi_minor: FloatArray
    bearing: FloatArray
    level: float | None
    factor: float

    def columns(self) -> dict[str, list[str] | list[float]]:
        """A table by columns."""
        return {
            "point": list(self.names),
            "semi_major": self.semi_major.tolist(),
            "semi_minor": self.semi_minor.tolist(),
            "bearing": self.bearing.tolist(),
        }


@dataclass(frozen=True)
class ErrorEllipsoids:
    """Ellipsoids of points in space.

    Attributes:
        names: (n,) the points.
        semi_axes: (n, 3) descending, in the unit of the coordinates.
        directions: (n, 3, 3) unit vectors of the axes, one per row, the first component not negative.
        level: probability that the true point is inside; None for standard ellipsoids: 20 %.
        factor: what multiplies the axes of the standard ellipsoid.
    """

    names: tuple[str, ...]
    semi_axes: FloatArray
    directions: FloatArray
    level: float | None
    factor: float

    def columns(self) -> dict[str, list[str] | list[float]]:
        """A table by columns; the direction of the longest axis only."""
        axes = {f"semi_axis_{k + 1}": self.semi_axes[:, k].tolist() for k in range(3)}
        longest = {f"direction_{name}": self.directions[:, 0, k].tolist() for k, name in enumerate("xyz")}
        return {"point": list(self.names), **axes, **longest}


@dataclass(frozen=True)
class RelativePrecision:
    """Precision of points relative to each other.

    Attributes:
        first: (m,) names of the points.
        second: (m,) names of the other points.
        distance: (m,) between them.
        precision: (m,) standard deviation of the distance.
        ratio: (m,) precision over distance; 1e-6 is one part per million.
        bearing_precision: (m,) standard deviation of the bearing, in radians; infinite for a vertical line.
        covariance: (m, k, k) of the differences of coordinates, second minus first.
        redundancy: of the adjustment; None when the given sigmas were taken as they are.
    """

    first: tuple[str, ...]
    second: tuple[str, ...]
    distance: FloatArray
    precision: FloatArray
    ratio: FloatArray
    bearing_precision: FloatArray
    covariance: FloatArray = field(repr=False)
    redundancy: int | None = None

    def ellipses(self, level: float | None = None) -> ErrorEllipses:
        """Relative error ellipses: where the second point is, seen from the first."""
        names = tuple(f"{a} - {b}" for a, b in zip(self.first, self.second, strict=True))
        return ellipses_of(names, self.covariance, level, self.redundancy)

    def columns(self) -> dict[str, list[str] | list[float]]:
        """A table by columns."""
        return {
            "first": list(self.first),
            "second": list(self.second),
            "distance": self.distance.tolist(),
            "precision": self.precision.tolist(),
            "ratio": self.ratio.tolist(),
            "bearing_precision": self.bearing_precision.tolist(),
        }


def error_ellipses(
    result: LeastSquaresResult, ids: ArrayLike, level: float | None = None, a_priori: bool = False
) -> ErrorEllipses:
    """Error ellipses of points, of the first two coordinates of points in space.

    Args:
        result: a solution with covariances.
        ids: (n,) points of one kind.
        level: confidence level; standard ellipses when None.
        a_priori: with the given sigmas as they are, instead of scaled by the variance factor.
    """
    names = _names_of_points(result, ids)
    covariance = result.covariance(ids, a_priori)
    return ellipses_of(names, covariance, level, None if a_priori else result.redundancy)


def error_ellipsoids(
    result: LeastSquaresResult, ids: ArrayLike, level: float | None = None, a_priori: bool = False
) -> ErrorEllipsoids:
    """Error ellipsoids of points in space; arguments as for `error_ellipses`."""
    names = _names_of_points(result, ids)
    covariance = result.covariance(ids, a_priori)
    if covariance.shape[1] != 3:
        raise InputError("error ellipsoids are of points in space; ask for the ellipses of these points")
    factor = confidence_factor(level, 3, None if a_priori else result.redundancy)
    squares, vectors = np.linalg.eigh(covariance)
    directions = np.swapaxes(vectors, 1, 2)[:, ::-1]
    directions = np.where(directions[:, :, :1] < 0.0, -directions, directions)
    axes = factor * np.sqrt(np.clip(squares[:, ::-1], 0.0, None))
    return ErrorEllipsoids(names, axes, np.ascontiguousarray(directions), level, factor)


def relative_precision(
    result: LeastSquaresResult, first: ArrayLike, second: ArrayLike, a_priori: bool = False
) -> RelativePrecision:
    """Precision of points (m,) relative to points (m,), whether or not observations join them; by solves.

    Raises:
        InputError: covariances were not asked for, or two points of a pair are the same, or coincide.
    """
    names = _names_of_points(result, first), _names_of_points(result, second)
    a, b = (np.atleast_1d(np.asarray(ids, dtype=np.int64)) for ids in (first, second))
    if a.shape != b.shape:
        raise InputError(f"relative precision: {len(a)} first points, {len(b)} second points")
    shift = result.values(b) - result.values(a)
    distance = np.linalg.norm(shift, axis=1)
    same = np.flatnonzero(distance == 0.0)
    if same.size:
        raise InputError(
            f"relative precision: {names[0][same[0]]} and {names[1][same[0]]} are at the same place"
        )
    crossed = _crossed(result, a, b, a_priori)
    covariance = result.covariance(a, a_priori) + result.covariance(b, a_priori)
    covariance -= crossed + np.swapaxes(crossed, 1, 2)
    along = shift / distance[:, None]
    precision = np.sqrt(np.clip(np.einsum("mi,mij,mj->m", along, covariance, along), 0.0, None))
    bearing = _bearing_precision(shift, covariance)
    redundancy = None if a_priori else result.redundancy
    return RelativePrecision(
        *names, distance, precision, precision / distance, bearing, covariance, redundancy
    )


def confidence_factor(level: float | None, dimension: int, redundancy: int | None) -> float:
    """What multiplies standard axes so that the true point is inside with a probability; 1 for None.

    From the chi-square distribution when the sigmas are taken as given (`redundancy` None), else from
    Fisher's, since the variance factor is then itself an estimate.
    """
    if level is None:
        return 1.0
    checked_probability(level, "level")
    if redundancy is None:
        return float(np.sqrt(chi_square_limit(dimension, below=level)))
    from scipy.special import fdtri

    return float(np.sqrt(dimension * fdtri(dimension, redundancy, level)))


def ellipses_of(
    names: tuple[str, ...],
    covariance: FloatArray,
    level: float | None = None,
    redundancy: int | None = None,
) -> ErrorEllipses:
    """Ellipses of covariances (n, 2 or more, 2 or more), of the first two coordinates.

    Args:
        names: (n,) what they belong to.
        covariance: symmetric matrices.
        level: confidence level; standard ellipses when None.
        redundancy: of the adjustment that scaled the covariances; None when the sigmas were taken as given.
    """
    factor = confidence_factor(level, 2, redundancy)
    xx, yy, xy = covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]
    mean, gap = (xx + yy) / 2, np.hypot((yy - xx) / 2, xy)
    bearing = np.mod(0.5 * np.arctan2(xy, (yy - xx) / 2), np.pi)
    minor = np.sqrt(np.clip(mean - gap, 0.0, None))
    return ErrorEllipses(names, factor * np.sqrt(mean + gap), factor * minor, bearing, level, factor)


def _bearing_precision(shift: FloatArray, covariance: FloatArray) -> FloatArray:
    horizontal = np.hypot(shift[:, 0], shift[:, 1])
    across = np.column_stack([shift[:, 1], -shift[:, 0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.einsum("mi,mij,mj->m", across, covariance[:, :2, :2], across)
        return np.where(horizontal > 0.0, np.sqrt(np.clip(variance, 0.0, None)) / horizontal**2, np.inf)


def _crossed(result: LeastSquaresResult, a: IntArray, b: IntArray, a_priori: bool) -> FloatArray:
    """(m, k, k) covariances of each first point with its second."""
    k = result.values(a).shape[1]
    crossed = np.empty((len(a), k, k))
    for start in range(0, len(a), PAIRS_AT_A_TIME):
        part = slice(start, start + PAIRS_AT_A_TIME)
        n = len(a[part])
        joint = result.covariance_between(a[part], b[part], a_priori).reshape(n, k, n, k)
        crossed[part] = joint[np.arange(n), :, np.arange(n), :]
    return crossed


def _names_of_points(result: LeastSquaresResult, ids: ArrayLike) -> tuple[str, ...]:
    table = result.table
    array, manifold, _ = table.uniform(ids, "ellipses")
    if not manifold.is_point:
        raise InputError(
            f"{table.names[array[0]]!r} is a {manifold.label}, not a point: it has no error ellipse"
        )
    return tuple(table.names[block] for block in array)
