"""Sets of Gama's files: what is written together, with its covariance matrix."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.survey.model import FieldBook, Points

LARGEST_PART = 300
"""Uncorrelated values from which a new set begins: its matrix stays small."""


@dataclass(frozen=True, eq=False)
class GamaNetwork:
    """What is written.

    Attributes:
        points: Their coordinates in the axes of the file.
        book: The observations, numbered like the points.
        axes: Where x and y point to, such as `en`.
        turn: (3, 3) from east, north, up to the axes of the file.
        sigmas: (n,) standard deviations of the observations, with their relative parts (m, rad).
        unit_sigma: Standard deviation of unit weight.
        description: Text of the file.
    """

    points: Points
    book: FieldBook
    axes: str
    turn: FloatArray
    sigmas: FloatArray
    unit_sigma: float
    description: str = ""


class SetWriter:
    """A network by its sets.

    Attributes:
        network: What is written.
        book: Its observations.
        rows: Their columns.
        cluster: (n,) cluster of each observation; -1 for none.
    """

    def __init__(self, network: GamaNetwork) -> None:
        self.network, self.book = network, network.book
        self.rows = network.book.observations
        self._files = [Path(file).name for file in network.book.files]
        self.cluster = np.full(len(self.rows), -1, np.int64)
        for number, cluster in enumerate(self.book.clusters):
            self.cluster[cluster.rows] = number

    def by_cluster(self, rows: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Iterator[list[int]]:
        """The rows of no cluster together, then those of each cluster."""
        numbers = self.cluster[rows]
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order])) + 1
        yield from (part.tolist() for part in np.split(rows[order], starts) if part.size)

    def parts(self, rows: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Iterator[list[int]]:
        """The same, in parts of which a matrix is not too large: those of one point stay together."""
        for members in self.by_cluster(rows):
            if self.cluster[members[0]] >= 0:
                yield members
                continue
            part: list[int] = []
            for row in members:
                if (
                    len(part) >= LARGEST_PART
                    and self.rows.from_points[row] != self.rows.from_points[part[-1]]
                ):
                    yield part
                    part = []
                part.append(row)
            yield part

    def covariance_of(self, rows: Sequence[int]) -> FloatArray:
        """(k, k) of some observations: all of their clusters must be among them."""
        place = {row: k for k, row in enumerate(rows)}
        matrix = np.diag(np.square(self.network.sigmas[list(rows)]))
        for number in sorted({int(self.cluster[row]) for row in rows} - {-1}):
            cluster = self.book.clusters[number].among(self.rows.active)
            outside = [int(row) for row in cluster.rows if int(row) not in place]
            if outside:
                raise InputError(
                    f"{self.book.label(outside[0])}: it is correlated with observations of another set, "
                    "which Gama's matrices do not join"
                )
            chosen = [place[int(row)] for row in cluster.rows]
            matrix[np.ix_(chosen, chosen)] = cluster.covariance
        return matrix

    def extern(self, row: int) -> str:
        """The attribute that names our file and line."""
        return f" extern={quoteattr(f'{self._files[self.rows.file_indices[row]]}:{self.rows.lines[row]}')}"


def number(value: float) -> str:
    """A number as an attribute."""
    return f'"{value:.15g}"'


def matrix_lines(covariance: FloatArray, units: FloatArray) -> Iterator[str]:
    """A covariance (k, k) in squares of m and rad, as the narrowest band that holds it."""
    scaled = covariance / np.outer(units, units)
    rows, columns = np.nonzero(scaled)
    band = int(np.max(columns - rows, initial=0))
    dim = len(scaled)
    yield f'  <cov-mat dim="{dim}" band="{band}">'
    for row in range(dim):
        yield "    " + " ".join(f"{value:.16g}" for value in scaled[row, row : min(row + band + 1, dim)])
    yield "  </cov-mat>"
