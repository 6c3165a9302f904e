"""Parts of the record of an adjusted network: what is known of points, how they fit, operations of PROJ."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from obseq import crs
from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.crs import CoordinateSystem
from obseq.dataclass import dataclass
from obseq.leastsquares import LeastSquaresResult
from obseq.leastsquares.statistics.distributions import chi_square_limit
from obseq.leastsquares.statistics.hypothesis_tests import global_test
from obseq.records.adjustment import (
    ConstraintRecord,
    GlobalTestRecord,
    OperationRecord,
    PointRecord,
    StationRecord,
    StatisticsRecord,
    defined,
)
from obseq.records.columns import Column, Texts, texts_of
from obseq.records.rows import Rows
from obseq.survey.adjustment.adjusted_quality import ReliabilityNumbers
from obseq.survey.equations.known_coordinates import COMPONENTS, CoordinateResiduals
from obseq.survey.kinds.registry import BY_CODE, codes_where
from obseq.survey.model import FieldBook, Orientation, Points

_LEAST_REDUNDANCY = 1e-6
"""Redundancy of a group below which nothing is said of its sigmas."""
_LEAST_TESTED = 1.0
"""Redundancy of a type below which its sigmas are not tested."""
_TYPES_LEVEL = 0.01
"""Probability that the test of any type fails where all sigmas are right; each has its share of it."""


def known_letters(points: Points) -> list[str]:
    """Which coordinates of each point are known, of "xyz"; those held fixed in capitals."""
    is_unknown = points.is_free | points.is_invented
    letters = np.where(is_unknown, "", np.where(points.is_held, ["X", "Y", "Z"], ["x", "y", "z"]))
    return ["".join(row) for row in letters.tolist()]


def unused_azimuths(book: FieldBook, g0: FloatArray) -> FloatArray:
    """(n,) where those directions that are not used point, clockwise from y (rad); NaN of all others.

    Args:
        book: The observations.
        g0: (m,) azimuths of the zeros of the circles of the stations.
    """
    rows = book.observations
    from_north = np.isin(rows.types, codes_where(lambda kind: kind.is_from_north))
    of_circle = np.isin(rows.types, codes_where(lambda kind: kind.is_of_circle))
    zeros = np.where(from_north, 0.0, np.append(g0, np.nan)[rows.stations])
    azimuths = rows.values + zeros
    return np.where(~rows.active & (of_circle | from_north) & np.isfinite(azimuths), azimuths, np.nan)


def moves(points: Points, coordinates: FloatArray, placeholders: Collection[str]) -> dict[str, Column]:
    """How far each point came from the coordinates that were given (m).

    Nothing where none were, or placeholders (names of points): what the observations contradict, 0 0 0 say.
    """
    shifts, there = coordinates - points.coordinates, points.has_coordinates.copy()
    shifts[points.is_invented] = np.nan
    if placeholders:
        there &= [name not in placeholders for name in points.names]
    return {"moved": finite(shifts), "moved.there": there}


def operations(systems: Sequence[CoordinateSystem]) -> tuple[OperationRecord, ...]:
    """How PROJ leads from those systems that it knows to geocentric WGS 84."""
    found: dict[str, OperationRecord] = {}
    for system in systems:
        base = system.base if isinstance(system, crs.LocalTangent) else system
        if isinstance(base, crs.ProjSystem):
            operation = base.operation
            accuracy = operation.accuracy if operation.accuracy >= 0.0 else None
            found[base.definition] = OperationRecord(base.definition, operation.description, accuracy)
    return tuple(found.values())


@dataclass(frozen=True, eq=False)
class Fit:
    """How observations fit, all (n,).

    Attributes:
        book: The observations.
        normalised: Residuals over sigmas; NaN for those not used.
        standardised: Residuals over their own sigmas; None where reliability was not asked for.
        redundancy: Redundancy numbers; None likewise.
        shares: What those that are correlated with others add to the weighted sum of squares; NaN for the
            others. None where there are none.
    """

    book: FieldBook
    normalised: FloatArray
    standardised: FloatArray | None
    redundancy: FloatArray | None
    shares: FloatArray | None = None

    @property
    def squares(self) -> FloatArray:
        """(n,) what each observation adds to the weighted sum of squares."""
        alone = np.square(self.normalised)
        return alone if self.shares is None else np.where(np.isnan(self.shares), alone, self.shares)


def by_type(fit: Fit) -> tuple[StatisticsRecord, ...]:
    """How the observations of each type fit; types that are correlated with one another also together.

    The squares of one of these alone say nothing of its sigmas: only their sum is v' P v.
    """
    types = fit.book.observations.types
    codes, groups = np.unique(types, return_inverse=True)
    found = list(_statistics(fit, groups, [BY_CODE[code].name for code in codes.tolist()]))
    found = [
        structs.replace(row, sense=BY_CODE[code].sense)
        for row, code in zip(found, codes.tolist(), strict=True)
    ]
    for members in _joined(fit.book, codes.tolist()):
        own = np.isin(groups, members)
        name = " ".join(found[k].name for k in members)
        (whole,) = _statistics(fit, np.where(own, 0, 1), [name, ""])[:1]
        for k in members:
            found[k] = structs.replace(found[k], sigma_factor=None)
        found.append(whole)
    return tested_types(found)


def tested_types(found: Sequence[StatisticsRecord]) -> tuple[StatisticsRecord, ...]:
    """Types with the limits of the factors of their sigmas, so that any is beyond them at one level."""
    count = sum(_is_tested(record) for record in found)
    return tuple(_tested(record, _TYPES_LEVEL / count) if _is_tested(record) else record for record in found)


def _joined(book: FieldBook, codes: list[int]) -> list[list[int]]:
    """Places of the types (k,) that clusters join, those that hang together in one list; of two or more."""
    sets: list[set[int]] = []
    for cluster in book.clusters:
        own = set(np.searchsorted(codes, np.unique(book.observations.types[cluster.rows])).tolist())
        apart = [one for one in sets if not one & own]
        sets = [*apart, own.union(*(one for one in sets if one & own))]
    return [sorted(one) for one in sets if len(one) > 1]


def _is_tested(record: StatisticsRecord) -> bool:
    return record.sigma_factor is not None and (record.redundancy or 0.0) >= _LEAST_TESTED


def _tested(record: StatisticsRecord, level: float) -> StatisticsRecord:
    """With the limits of its factor: its sum of squares varies no more than chi-square of its redundancy."""
    freedom = record.redundancy or 0.0
    limits = (
        chi_square_limit(freedom, below=0.5 * level) / freedom,
        chi_square_limit(freedom, above=0.5 * level) / freedom,
    )
    return structs.replace(record, lower=limits[0] ** 0.5, upper=limits[1] ** 0.5, level=level)


def by_setup(fit: Fit) -> tuple[StatisticsRecord, ...]:
    """How the observations from each point fit."""
    book = fit.book
    rows, groups = np.unique(book.observations.from_points, return_inverse=True)
    return tuple(_statistics(fit, groups, [book.point_names[row] for row in rows.tolist()]))


def _statistics(fit: Fit, groups: IntArray, names: Sequence[str]) -> list[StatisticsRecord]:
    """One record for each group of observations; groups (n,) are numbers of names."""
    n, used = len(names), np.isfinite(fit.normalised)
    residuals = np.where(used, fit.normalised, 0.0)
    counts = np.bincount(groups, used, n).astype(np.int64)
    unused = np.bincount(groups, ~used, n).astype(np.int64)
    squares, sums = np.bincount(groups, residuals**2, n), np.bincount(groups, residuals, n)
    weighted = np.maximum(np.bincount(groups, np.where(used, fit.squares, 0.0), n), 0.0)
    largest = np.zeros(n)
    judged = residuals if fit.standardised is None else np.where(used, fit.standardised, 0.0)
    np.maximum.at(largest, groups, np.abs(np.nan_to_num(judged)))
    parts = np.full(n, np.nan)
    if fit.redundancy is not None:
        parts = np.bincount(groups, np.nan_to_num(np.where(used, fit.redundancy, 0.0)), n)
    with np.errstate(divide="ignore", invalid="ignore"):
        controlled = np.where(parts > _LEAST_REDUNDANCY, parts, np.nan)
        numbers = (parts, np.sqrt(squares / counts), sums / counts, largest, np.sqrt(weighted / controlled))
    columns = (names, counts.tolist(), unused.tolist(), *map(defined, numbers))
    return list(map(StatisticsRecord, *columns))


def ellipsoid_columns(covariances: FloatArray, factor: float) -> dict[str, Column]:
    """The ellipsoids of covariances (n, 3, 3), their axes enlarged by a factor; ends above the horizon."""
    squares, vectors = np.linalg.eigh(covariances)
    ends = np.swapaxes(vectors, 1, 2)[:, ::-1]
    ends = np.where(ends[:, :, 2:] < 0.0, -ends, ends)
    return {
        "ellipsoid.axes": factor * np.sqrt(np.clip(squares[:, ::-1], 0.0, None)),
        "ellipsoid.bearings": np.mod(np.arctan2(ends[:, :, 0], ends[:, :, 1]), 2.0 * np.pi),
        "ellipsoid.elevations": np.arcsin(np.clip(ends[:, :, 2], 0.0, 1.0)),
    }


def place_records(points: Points) -> list[PointRecord]:
    """Where the points are that have coordinates (in the frame), before anything is adjusted."""
    unknown: dict[str, Any] = dict.fromkeys(("sx", "sy", "sz", "crs_x", "crs_y", "crs_z"))
    return [
        PointRecord(points.names[row], *points.coordinates[row].tolist(), **unknown)
        for row in np.flatnonzero(points.has_coordinates).tolist()
    ]


def global_test_record(solution: LeastSquaresResult) -> GlobalTestRecord | None:
    """The chi-square test of the variance factor; None without redundancy."""
    if solution.redundancy <= 0 or solution.variance_factor is None:
        return None
    test = global_test(solution)
    lower, upper = test.sigma0_limits
    return GlobalTestRecord(test.sigma0, lower, upper, test.level, test.p_value, test.passed)


def finite_number(value: float) -> float | None:
    """The number as a record holds it: None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def finite(values: FloatArray) -> FloatArray:
    """The numbers as columns of a record hold them: NaN where they are not finite."""
    return np.where(np.isfinite(values), values, np.nan)


def constraint_records(
    points: Points, known: CoordinateResiduals, quality: ReliabilityNumbers | None
) -> Rows[ConstraintRecord]:
    """How the known coordinates fit."""
    files = points.file_indices[known.points]
    columns: dict[str, Column] = {
        "point": Texts(known.points.astype(np.int32), list(points.names)),
        "coordinate": Texts(known.components.astype(np.int32), list(COMPONENTS)),
        "value": known.values,
        "sigma": known.sigmas,
        "residual": known.residuals,
        "normalised_residual": known.residuals / known.sigmas,
        "file": Texts(np.where(files >= 0, files, len(points.files)), [*points.files, ""]),
        "line": points.lines[known.points],
    }
    if quality is not None:
        columns["redundancy"] = finite(quality.redundancy)
        columns["standardised_residual"] = finite(quality.standardised)
    return Rows.of(ConstraintRecord, columns, len(known.points))


def reliability_columns(numbers: ReliabilityNumbers | None) -> dict[str, Column]:
    """Columns of observations that say how reliable they are, if that was asked for."""
    if numbers is None:
        return {}
    return {name: finite(getattr(numbers, field)) for name, field in RELIABILITY.items()}


RELIABILITY = {
    "redundancy": "redundancy",
    "standardised_residual": "standardised",
    "tau": "tau",
    "detectable": "detectable",
    "external": "external",
    "blunder": "blunder",
}
"""Columns of observations, and where they come from."""
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

    @property
    def upper(self) -> FloatArray:
        """(n, 6) covariances: xx, xy, xz, yy, yz, zz; NaN likewise."""
        invented = self.points.is_invented
        unknown = invented[:, ROWS] | invented[:, COLUMNS]
        return np.where(unknown, np.nan, self.covariances[:, ROWS, COLUMNS])

    @property
    def has_plan(self) -> BoolArray:
        """(n,) which have a place in plan."""
        unknown = np.asarray(np.isnan(self.upper[:, IN_PLAN]).any(axis=1))
        return ~unknown

    def columns(self, placeholders: Collection[str] = ()) -> dict[str, Column]:
        """Columns of their records, but for ellipses; placeholders (names) did not move."""
        parts = {"": self.coordinates, "s": self.precisions}
        parts |= {"crs_": self.crs_coordinates, "crs_s": self.crs_precisions}
        columns = {f"{key}{axis}": part[:, k] for key, part in parts.items() for k, axis in enumerate("xyz")}
        names = Texts(np.arange(len(self.names), dtype=np.int32), list(self.names))
        known = {"known": texts_of(known_letters(self.points))}
        moved = moves(self.points, self.places, placeholders)
        return {"name": names, **columns, "covariance": self.upper, **known, **moved}


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

    def records(self) -> Rows[StationRecord]:
        """Their entries in the record."""
        columns: dict[str, Column] = {
            "origin": texts_of(self.origins),
            "orientation": Texts(self.orientations, [status.keyword for status in Orientation]),
            "g0": self.g0,
        }
        return Rows.of(StationRecord, columns, len(self.origins))
