"""Values of Gama's files: angles in gon or in degrees, covariance bands, default sigmas."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.reading.angles import GON, SECOND, dashed
from obseq.reading.text import parse_number, quoted
from obseq.reading.xml import Element

RADIANS_PER_GON = GON
RADIANS_PER_CC = RADIANS_PER_GON * 1e-4
MILLIMETRE = 1e-3


class Value(NamedTuple):
    """A value as written, in metres or radians.

    Attributes:
        number: The value.
        unit: Metres or radians in one unit of its standard deviation.
    """

    number: float
    unit: float


def angle(element: Element, name: str = "val") -> Value:
    """An angle in gon with sigmas in cc, or `d-m-s` in degrees with sigmas in arc seconds.

    Raises:
        InputError: It is neither.
    """
    text = element.wanted(name)
    try:
        found = dashed(text)
    except ValueError as error:
        raise element.error(f"<{element.name}> {name} {text}: {error}") from error
    if found is None:
        return Value(element.parsed(text, name) * RADIANS_PER_GON, RADIANS_PER_CC)
    return Value(found, SECOND)


def length(element: Element, name: str = "val") -> Value:
    """A length in metres, with its sigma in millimetres."""
    return Value(element.parsed(element.wanted(name), name), MILLIMETRE)


@dataclass(frozen=True)
class DistanceSigma:
    """a + b D^c in millimetres, D in kilometres."""

    a: float
    b: float = 0.0
    c: float = 1.0

    def of(self, distance: float) -> float:
        """Of a distance in metres, in millimetres."""
        return self.a + self.b * math.pow(abs(distance) / 1000.0, self.c)


def distance_sigma(element: Element, name: str) -> DistanceSigma | None:
    """The default sigma of distances, `a`, `a b` or `a b c`, if there is one.

    Raises:
        InputError: These are not one to three numbers, none below zero.
    """
    text = element.get(name)
    if text is None:
        return None
    numbers = [element.parsed(part, name) for part in text.split()]
    if len(numbers) > 3 or min(numbers) < 0.0 or numbers[0] + sum(numbers[1:2]) <= 0.0:
        raise element.error(f"<{element.name}> {name} {quoted(text)}: a b c of a + b D^c (mm, D in km)")
    return DistanceSigma(*numbers)


@dataclass(frozen=True, eq=False)
class Band:
    """A covariance matrix of limited band width.

    Attributes:
        element: Where it stands.
        rows: (dim, band + 1) diagonal and what is right of it; zero beyond the last column.
    """

    element: Element
    rows: FloatArray

    def __len__(self) -> int:
        return len(self.rows)

    def scaled(self, factors: FloatArray) -> Band:
        """In other units: entry ij times factor i and factor j (dim,)."""
        dim, width = self.rows.shape
        columns = np.minimum(np.arange(dim)[:, None] + np.arange(width), dim - 1)
        return Band(self.element, self.rows * factors[:, None] * factors[columns])

    @property
    def sigmas(self) -> FloatArray:
        """(dim,) roots of the diagonal."""
        return np.sqrt(self.rows[:, 0])

    def blocks(self) -> Iterator[tuple[int, FloatArray]]:
        """First row and dense matrix of the blocks of more than one row that hang together.

        Raises:
            InputError: A block is not positive definite.
        """
        dim, width = self.rows.shape
        last = np.arange(dim)
        for step in range(1, width):
            joined = np.flatnonzero(self.rows[:, step])
            last[joined] = joined + step
        ends = np.flatnonzero(np.maximum.accumulate(last) == np.arange(dim))
        first = 0
        for end in ends.tolist():
            if end > first:
                yield first, self._dense(first, end + 1)
            first = end + 1

    def _dense(self, first: int, stop: int) -> FloatArray:
        size = stop - first
        matrix = np.zeros((size, size))
        for step in range(min(self.rows.shape[1], size)):
            places = np.arange(size - step)
            matrix[places, places + step] = matrix[places + step, places] = self.rows[
                first : stop - step, step
            ]
        try:
            np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError as error:
            raise self.element.error(
                f"the covariance of values {first + 1} to {stop} of this set is not positive definite"
            ) from error
        return matrix


def covariance_band(element: Element, n: int) -> Band:
    """The `cov-mat` of a set of n values, in its units.

    Raises:
        InputError: It has another size, other entries than these, or a variance that is not positive.
    """
    element.allow(("dim", "band"))
    dim, band = (_whole(element, name) for name in ("dim", "band"))
    if dim != n:
        raise element.error(f"the matrix has dim {dim}, and the set holds {n} values")
    if not 0 <= band < dim:
        raise element.error(f"the band {band} goes from 0 to dim - 1, here {dim - 1}")
    texts = element.text.split()
    count = dim * (band + 1) - band * (band + 1) // 2
    if len(texts) != count:
        raise element.error(f"{len(texts)} numbers, where dim {dim} and band {band} need {count}")
    rows = np.zeros((dim, band + 1))
    inside = np.arange(dim)[:, None] + np.arange(band + 1) < dim
    try:
        rows[inside] = [parse_number(text) for text in texts]
    except ValueError as error:
        raise element.error(f"the matrix: {error}") from error
    if not (rows[:, 0] > 0.0).all():
        raise element.error("a variance is not above zero; give the standard deviation of the measure")
    return Band(element, rows)


def _whole(element: Element, name: str) -> int:
    text = element.wanted(name)
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise element.error(f"<{element.name}> {name} is {quoted(text)}; it is a whole number")
    return int(text)
