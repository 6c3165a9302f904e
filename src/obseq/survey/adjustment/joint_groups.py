"""Observations that are one: the components of a vector or of a position, correlated or not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares import Batch
from obseq.leastsquares.statistics.joint_levels import joint_critical, joint_level
from obseq.leastsquares.statistics.reliability import Reliability
from obseq.records.quality import KNOWN, JointTestRecord, ReliabilityRecord
from obseq.survey.equations.equations import Equations
from obseq.survey.equations.known_coordinates import CoordinateResiduals
from obseq.survey.kinds.registry import AXIS_OF_VECTOR, IS_ANGLE
from obseq.survey.model import FieldBook, Points


@dataclass(frozen=True, eq=False)
class TestedJointly:
    """Observations, or known coordinates of a point, that are tested as one.

    Attributes:
        rows: (m,) of the field book; beyond its end, of the known coordinates.
        statistic: T; NaN where nothing controls it.
        degrees: its degrees of freedom.
        blunder: (m,) estimates of their errors (m).
        rise: estimate of an error of the height alone (m), as of an antenna; NaN where it is not known.
        rise_test: its test w; NaN likewise.
    """

    rows: IntArray
    statistic: float
    degrees: int
    blunder: FloatArray
    rise: float = float("nan")
    rise_test: float = float("nan")


def joint_groups(equations: Equations, book: FieldBook) -> dict[Batch, list[IntArray]]:
    """By batch, the rows that are one vector or one position.

    Those of a cluster between the same points; of what no covariance joins, what a file gives as one vector.
    """
    numbers, alone = _vectors(book), vector_numbers(book)
    alone[~book.observations.active] = -1
    alone[np.concatenate([np.zeros(0, np.int64), *(cluster.rows for cluster in book.clusters)])] = -1
    numbers = np.where(alone < 0, numbers, alone + numbers.max(initial=-1) + 1)
    found = {batch: _gathered(numbers[rows]) for rows, batch in equations.batches.values()}
    found |= {batch: _gathered(points) for batch, points in equations.known.together().items()}
    return {batch: groups for batch, groups in found.items() if groups}


def vector_numbers(book: FieldBook) -> IntArray:
    """(n,) the vector that each row is a component of, counted as files give them; -1 for what is none.

    They give X, Y and Z one after the other: a vector ends where an axis comes again, or other points.
    """
    observations = book.observations
    codes, axes = observations.types, AXIS_OF_VECTOR[observations.types]
    numbers = np.full(len(codes), -1, np.int64)
    rows = np.flatnonzero(axes >= 0)
    if rows.size:
        same = (
            (np.diff(rows) == 1) & (np.diff(axes[rows]) == np.diff(codes[rows])) & (np.diff(axes[rows]) > 0)
        )
        for column in (observations.from_points, observations.to_points, observations.file_indices):
            same &= np.diff(column[rows]) == 0
        numbers[rows] = np.cumsum(np.append(True, ~same)) - 1
    return numbers


def _vectors(book: FieldBook) -> IntArray:
    """(n,) numbers of the vectors: lengths of a cluster of different kinds between two points; or -1."""
    observations = book.observations
    numbers = np.full(len(observations), -1, np.int64)
    if not book.clusters:
        return numbers
    sizes = [len(cluster.rows) for cluster in book.clusters]
    rows = np.concatenate([cluster.rows for cluster in book.clusters])
    clusters = np.repeat(np.arange(len(sizes)), sizes)
    kept = observations.active[rows] & ~IS_ANGLE[observations.types[rows]]
    rows, clusters = rows[kept], clusters[kept]
    columns = observations.from_points, observations.to_points, observations.types
    keys = np.stack([clusters, *(column[rows] for column in columns)])
    order = np.lexsort(keys[::-1])
    changes = np.diff(keys[:, order], axis=1) != 0
    number = np.append(0, np.cumsum(changes[:-1].any(axis=0)))[: len(rows)]
    twice = number[1:][~changes.any(axis=0)]
    number[np.isin(number, twice)] = -1
    numbers[rows[order]] = number
    return numbers


def _gathered(numbers: IntArray) -> list[IntArray]:
    """Places of those that have the same number, of two or more; negative numbers are none."""
    order = np.argsort(numbers, kind="stable")
    order = order[numbers[order] >= 0]
    ends = np.flatnonzero(np.diff(numbers[order])) + 1
    return [places for places in np.split(order, ends) if len(places) > 1]


def tested_jointly(equations: Equations, quality: Reliability, n: int) -> tuple[TestedJointly, ...]:
    """The tests of all vectors and positions of a network with so many observations."""
    places = {batch: rows for rows, batch in equations.batches.values()}
    places |= {batch: n + rows for batch, rows in equations.known.places().items()}
    tests = [(places[part.source][test.rows], test) for part in quality.observations for test in part.joint]
    if not tests:
        return ()
    known = np.full(sum(map(len, equations.known.places().values())), np.nan)
    rises = np.append(equations.local_axes(quality.state.result.values(equations.points))[:, 2], known)
    return tuple(
        TestedJointly(rows, test.statistic, test.degrees, test.blunder, *test.along(rises[rows]))
        for rows, test in tests
    )


def joint_records(
    tests: Sequence[TestedJointly],
    levels: ReliabilityRecord | None,
    book: FieldBook,
    points: Points,
    known: CoordinateResiduals,
) -> tuple[JointTestRecord, ...]:
    """Their entries in the record of an adjustment."""
    if levels is None:
        return ()
    of_tests = (levels.level, levels.power)
    return tuple(joint_record(test, of_tests, book, points, known) for test in tests if test.degrees)


def joint_record(
    test: TestedJointly,
    levels: tuple[float, float],
    book: FieldBook,
    points: Points,
    known: CoordinateResiduals,
) -> JointTestRecord:
    """The entry of one of them, with the level of single tests and their power."""
    n = len(book.observations)
    what, file, line = _named(int(test.rows[0]), book, points, known)
    return JointTestRecord(
        what=what,
        file=file,
        line=line,
        rows=tuple(test.rows[test.rows < n].tolist()),
        statistic=test.statistic,
        degrees=test.degrees,
        critical=joint_critical(*levels, test.degrees),
        level=joint_level(*levels, test.degrees),
        blunder=tuple(test.blunder.tolist()),
        rise=test.rise if np.isfinite(test.rise) else None,
        rise_test=test.rise_test if np.isfinite(test.rise) else None,
    )


def _named(row: int, book: FieldBook, points: Points, known: CoordinateResiduals) -> tuple[str, str, int]:
    """What is tested, and the file and line of its first component."""
    observations, n = book.observations, len(book.observations)
    if row >= n:
        point = int(known.points[row - n])
        file = points.file_indices[point]
        what = f"{KNOWN}position of {points.names[point]}"
        return what, points.files[file] if file >= 0 else "", int(points.lines[point])
    origin, target = (
        book.point_names[end[row]] for end in (observations.from_points, observations.to_points)
    )
    what = f"position of {origin}" if origin == target else f"vector {origin} -> {target}"
    return what, book.files[observations.file_indices[row]], int(observations.lines[row])
