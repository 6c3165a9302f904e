"""SINEX files (.snx): estimated geocentric coordinates with their full covariance, as observed positions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import field
from pathlib import Path

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.columns import Columns, Measure
from obseq.formats.dynadjust.stations import ELLIPSOID
from obseq.formats.project import Project, Reading
from obseq.formats.sinex.normals import (
    NORMAL_MATRIX,
    NORMAL_VECTOR,
    is_singular,
    reduced,
    rows_of,
)
from obseq.reading.text import TextFile, quoted, read_text
from obseq.survey.kinds.coordinates import NORMAL_ROW
from obseq.survey.kinds.geodetic import GEO_X, GEO_Y, GEO_Z
from obseq.survey.model import Points, make_points, merge_points

TYPES = {"STAX": 0, "STAY": 1, "STAZ": 2}
KINDS = (GEO_X, GEO_Y, GEO_Z)
MATRIX = "SOLUTION/MATRIX_ESTIMATE"
ESTIMATE = "SOLUTION/ESTIMATE"
APRIORI = "SOLUTION/APRIORI"
STATISTICS = "SOLUTION/STATISTICS"
MOST_OF_NORMALS = 300
"""Points of normal equations, each row of which holds all of them."""
LARGEST = 9000
"""Parameters beyond which a matrix is not read: it is dense."""
_A_DAY = 86400.0


@dataclass(frozen=True)
class _Estimate:
    """One estimated parameter.

    Attributes:
        number: Its index, from 1.
        kind: STAX, STAY, STAZ, or another type.
        station: Code and point of its station.
        solution: Number of the solution.
        epoch: Seconds since 1950.
        value: Its value.
        sigma: Its standard deviation.
        line: Line, from 0.
    """

    number: int
    kind: str
    station: str
    solution: str
    epoch: float
    value: float
    sigma: float
    line: int


Stations = dict[str, list[_Estimate]]
"""X, Y and Z of each station, by the name of its point."""


@dataclass
class _Sinex:
    """One file.

    Attributes:
        file: Its lines.
        blocks: Lines of each block, first and last (excluded), by its name.
        suffixes: What follows the name of each block.
    """

    file: TextFile
    blocks: dict[str, tuple[int, int]] = field(default_factory=dict)
    suffixes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.file.lines[0].startswith("%=SNX"):
            raise self.file.error(0, "a SINEX file begins with %=SNX")
        opened: tuple[str, int] | None = None
        for index, line in enumerate(self.file.lines):
            if line.startswith("+"):
                if opened is not None:
                    raise self.file.error(index, f"block {opened[0]} does not end before another begins")
                name, _, rest = line[1:].strip().partition(" ")
                opened = name, index + 1
                self.suffixes[name] = rest.strip()
            elif line.startswith("-"):
                name = line[1:].strip().partition(" ")[0]
                if opened is None or opened[0] != name:
                    raise self.file.error(index, f"block {quoted(name)} ends here, and has not begun")
                self.blocks[name] = opened[1], index
                opened = None
        if opened is not None:
            raise self.file.error(opened[1] - 1, f"block {opened[0]} does not end")

    def lines(self, name: str) -> Iterator[tuple[int, str]]:
        """The lines of a block, without comments."""
        first, last = self.blocks.get(name, (0, 0))
        for index in range(first, last):
            line = self.file.lines[index]
            if line.strip() and not line.startswith("*"):
                yield index, line

    def number(self, index: int, text: str) -> float:
        """A number, of Fortran too."""
        return self.file.number(index, text.strip().upper().replace("D", "E"))

    def count(self, index: int, text: str, most: int) -> int:
        """A number of a parameter, from 1 to the most."""
        digits = text.strip()
        if not digits.isdecimal() or not 1 <= int(digits) <= most:
            raise self.file.error(index, f"{quoted(text)!r} is not the number of a parameter, 1 to {most}")
        return int(digits)

    def estimates(self, block: str = ESTIMATE) -> list[_Estimate]:
        """The parameters of a block, in the order of their numbers."""
        found = [self._estimate(index, line) for index, line in self.lines(block)]
        if not found:
            raise InputError(f"{self.file.name}: the file has no block {block} with parameters")
        if [item.number for item in found] != list(range(1, len(found) + 1)):
            raise self.file.error(found[0].line, "the parameters are not numbered 1, 2, 3, ...")
        return found

    def _estimate(self, index: int, line: str) -> _Estimate:
        station = " ".join(line[14:21].split())
        self.file.check_name(index, station)
        return _Estimate(
            self.count(index, line[1:6], LARGEST),
            line[7:13].strip(),
            station,
            line[22:26].strip(),
            self._epoch(index, line[27:39]),
            self.number(index, line[47:68]),
            self.number(index, line[69:80]),
            index,
        )

    def _epoch(self, index: int, text: str) -> float:
        """Seconds since 1950 of yy:ddd:sssss."""
        parts = text.strip().split(":")
        if len(parts) != 3 or not all(part.isdecimal() for part in parts):
            raise self.file.error(index, f"{quoted(text)!r} is not an epoch yy:ddd:sssss")
        year, day, second = (int(part) for part in parts)
        years = year % 100 + (50 if year % 100 <= 50 else -50)
        return (years * 365.25 + day) * _A_DAY + second

    def normals(self, estimates: list[_Estimate]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Normal equations (n, n), their right-hand sides (n,), and the values (n,) that they change.

        They are divided by the variance factor, as the covariance of a file is multiplied by it.
        """
        form = self.suffixes.get(NORMAL_MATRIX, "").split()
        if form not in (["L"], ["U"]) or NORMAL_VECTOR not in self.blocks:
            raise InputError(f"{self.file.name}: {NORMAL_MATRIX} with L or U and {NORMAL_VECTOR} go together")
        n, factor = len(estimates), self._variance_factor()
        vector = np.zeros(n)
        for index, line in self.lines(NORMAL_VECTOR):
            vector[self.count(index, line[1:6], n) - 1] = self.number(index, line[47:68])
        given = self.estimates(APRIORI)
        names = [(item.kind, item.station, item.solution) for item in given]
        if names != [(item.kind, item.station, item.solution) for item in estimates]:
            raise InputError(
                f"{self.file.name}: {APRIORI} has not the parameters of {ESTIMATE}, in their order"
            )
        start = np.array([item.value for item in given])
        return self._triangle(n, NORMAL_MATRIX) / factor, vector / factor, start

    def _variance_factor(self) -> float:
        for index, line in self.lines(STATISTICS):
            if line[1:31].strip() == "VARIANCE FACTOR":
                factor = self.number(index, line[31:54])
                if not factor > 0.0:
                    raise self.file.error(index, "the variance factor is not positive")
                return factor
        return 1.0

    def covariance(self, estimates: list[_Estimate]) -> FloatArray:
        """(n, n) covariance of all parameters.

        Raises:
            InputError: the matrix is missing, or cannot be understood.
        """
        form = self.suffixes.get(MATRIX, "").split()
        if MATRIX not in self.blocks or len(form) != 2 or form[0] not in "LU":
            raise InputError(
                f"{self.file.name}: a block {MATRIX} with L or U and COVA, CORR or INFO is needed: without a "
                "covariance the coordinates cannot be weighted"
            )
        matrix = self._triangle(len(estimates), MATRIX)
        sigmas = np.array([item.sigma for item in estimates])
        if form[1] == "CORR":
            sigmas = np.diag(matrix).copy()
            np.fill_diagonal(matrix, 1.0)
            matrix *= np.outer(sigmas, sigmas)
        elif form[1] == "INFO":
            matrix = self._inverse(matrix)
        elif form[1] != "COVA":
            raise InputError(f"{self.file.name}: {MATRIX} is {quoted(form[1])}; COVA, CORR or INFO is needed")
        return matrix

    def _inverse(self, matrix: FloatArray) -> FloatArray:
        try:
            return np.asarray(np.linalg.inv(matrix))
        except np.linalg.LinAlgError as error:
            raise InputError(f"{self.file.name}: the information matrix is singular") from error

    def _triangle(self, n: int, block: str) -> FloatArray:
        """(n, n) symmetric matrix of a block; elements that are left out are 0."""
        matrix = np.zeros((n, n))
        for index, line in self.lines(block):
            row, column = self.count(index, line[1:6], n) - 1, self.count(index, line[7:12], n) - 1
            for k, start in enumerate((13, 35, 57)):
                text = line[start : start + 21].strip()
                if not text:
                    break
                if column + k >= n:
                    raise self.file.error(index, f"the matrix has {n} columns")
                matrix[row, column + k] = matrix[column + k, row] = self.number(index, text)
        return matrix


def read_sinex(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads SINEX files: positions of stations are observations, correlated within each file.

    Constraints of a solution stay in it. Parameters other than positions are left to the covariance.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    columns, told = Columns(), list[str]()
    points: list[dict[str, FloatArray]] = []
    for path in paths:
        sinex = _Sinex(read_text(path, reading.encoding))
        names = _add(columns, sinex, told)
        points.append(names)
    merged: dict[str, FloatArray] = {}
    for found in points:
        for name, xyz in found.items():
            merged.setdefault(name, xyz)
    columns.warnings.extend(told)
    return Project(_points(merged), columns.field_book(), points_crs=ELLIPSOID)


def _points(places: dict[str, FloatArray]) -> Points:
    geocentric = np.array(list(places.values()))
    coordinates = crs.Transformer(crs.parse("GeoC"), crs.parse(ELLIPSOID)).forward(geocentric)
    return merge_points([make_points(list(places), coordinates)])


def _add(columns: Columns, sinex: _Sinex, told: list[str]) -> dict[str, FloatArray]:
    """Adds the positions of a file; returns them by the names of their points."""
    number = columns.open_file(sinex.file)
    estimates = sinex.estimates(ESTIMATE if ESTIMATE in sinex.blocks else APRIORI)
    others = sorted({item.kind for item in estimates if item.kind not in TYPES})
    if others:
        told.append(
            f"{sinex.file.name}: {', '.join(others)} have no part here: positions keep the covariance that "
            "these leave them"
        )
    chosen = _by_point(sinex, estimates)
    order = np.array([item.number - 1 for parts in chosen.values() for item in parts], np.int64)
    matrix = None if _is_free(sinex) else sinex.covariance(estimates)[np.ix_(order, order)]
    if matrix is None or (NORMAL_MATRIX in sinex.blocks and is_singular(matrix)):
        _check_epochs(sinex, chosen)
        _add_normals(columns, sinex, chosen, number, _normal_rows(sinex, estimates, order))
    else:
        _check(sinex, chosen, matrix)
        _add_positions(columns, sinex, chosen, number, matrix)
    return {name: np.array([item.value for item in parts]) for name, parts in chosen.items()}


def _is_free(sinex: _Sinex) -> bool:
    """Whether normal equations are all that a file has."""
    return NORMAL_MATRIX in sinex.blocks and MATRIX not in sinex.blocks


def _add_positions(
    columns: Columns, sinex: _Sinex, chosen: Stations, number: int, matrix: FloatArray
) -> None:
    """Coordinates with their covariance."""
    first, sigmas = len(columns), iter(np.sqrt(np.diag(matrix)).tolist())
    for name, parts in chosen.items():
        row = columns.point(sinex.file, parts[0].line, name)
        for kind, item in zip(KINDS, parts, strict=True):
            columns.append(Measure(kind, row, row, item.value, next(sigmas)), number, item.line)
    columns.correlate(list(range(first, len(columns))), matrix)


def _normal_rows(
    sinex: _Sinex, estimates: list[_Estimate], order: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows (r, n), values and sigmas (r,) of the normal equations of the positions."""
    if len(order) > 3 * MOST_OF_NORMALS:
        raise InputError(
            f"{sinex.file.name}: normal equations of {len(order) // 3} points; at most {MOST_OF_NORMALS} are "
            "read"
        )
    matrix, vector, start = sinex.normals(estimates)
    return rows_of(*reduced(matrix, vector, order), start[order], sinex.file.name)


def _add_normals(
    columns: Columns,
    sinex: _Sinex,
    chosen: Stations,
    number: int,
    rows: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Combinations of coordinates, as free of constraints as the normal equations."""
    points = [columns.point(sinex.file, parts[0].line, name) for name, parts in chosen.items()]
    line = sinex.blocks[NORMAL_MATRIX][0] - 1
    for row, value, sigma in zip(*(part.tolist() for part in rows), strict=True):
        group = columns.open_normal_row(tuple(points), tuple(row))
        ends = points[0], points[-1]
        columns.append(Measure(NORMAL_ROW, *ends, value, sigma, group=group), number, line)


def _by_point(sinex: _Sinex, estimates: list[_Estimate]) -> Stations:
    """X, Y and Z of each station; of each of its solutions, when there are several."""
    found: dict[tuple[str, str], list[_Estimate]] = {}
    for item in estimates:
        if item.kind in TYPES:
            found.setdefault((item.station, item.solution), []).append(item)
    counts = Counter(station for station, _ in found)
    named = {}
    for (station, solution), parts in found.items():
        if sorted(item.kind for item in parts) != sorted(TYPES):
            raise sinex.file.error(parts[0].line, f"{station} has not one each of {', '.join(TYPES)}")
        parts.sort(key=lambda item: TYPES[item.kind])
        plain = station.replace(" ", "_").removesuffix("_A")
        named[f"{plain}_{solution}" if counts[station] > 1 else plain] = parts
    return named


def _check_epochs(sinex: _Sinex, chosen: Stations) -> None:
    epochs = {parts[0].epoch: parts[0] for parts in chosen.values()}
    if not chosen:
        raise InputError(f"{sinex.file.name}: no position (STAX, STAY, STAZ) is estimated")
    if max(epochs) - min(epochs) > _A_DAY:
        raise sinex.file.error(
            epochs[max(epochs)].line,
            "the positions are of different epochs, between which points move; bring them to one epoch",
        )


def _check(sinex: _Sinex, chosen: Stations, matrix: FloatArray) -> None:
    _check_epochs(sinex, chosen)
    sigmas = np.array([item.sigma for parts in chosen.values() for item in parts])
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError as error:
        raise InputError(
            f"{sinex.file.name}: the covariance of the positions is not positive definite; that of a free "
            f"network needs {NORMAL_MATRIX} and {NORMAL_VECTOR} besides"
        ) from error
    ratio = float(np.median(np.sqrt(np.diag(matrix)) / np.where(sigmas > 0.0, sigmas, math.nan)))
    if not abs(ratio - 1.0) < 1e-2:
        raise InputError(
            f"{sinex.file.name}: the standard deviations of the estimates are 1 / {ratio:.4g} times those of "
            "the matrix; correct the one or the other (is the variance factor missing?)"
        )
