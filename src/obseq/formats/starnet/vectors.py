"""GNSS vectors of STAR*NET files: lines G0 (remark), G1 (vector), G2 and G3 (its covariance)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from obseq.arrays import FloatArray
from obseq.formats.columns import Columns, Measure
from obseq.formats.starnet.values import Line
from obseq.survey.kinds.vectors import VECTOR, VECTOR_Y, VECTOR_Z

CODES = ("g0", "g1", "g2", "g3")
CORNERS = ((0, 1), (0, 2), (1, 2))
"""Which components the numbers of a line G3 join."""


class VectorLines:
    """Takes the lines of vectors into columns."""

    def __init__(self, columns: Columns, files: Mapping[str, int]) -> None:
        self._columns, self._files = columns, files
        self._open: list[Line] = []
        self.vertical_factors: dict[int, float] = {}

    def read(self, line: Line) -> None:
        """Takes one line.

        Raises:
            InputError: It is not the one that is expected after the line before.
        """
        code = line.fields[0].lower()
        if code in ("g0", "g1"):
            self.finish()
        if code == "g0":
            return
        expected = CODES[len(self._open) + 1]
        if code != expected:
            raise line.error(
                f"{line.fields[0]} stands where {expected.upper()} is expected: a vector is G1, G2 and G3"
            )
        self._open.append(line)
        if code == "g3":
            self._add(*self._open)
            self._open.clear()

    def finish(self) -> None:
        """Refuses a vector without its covariance."""
        if self._open:
            raise self._open[0].error(
                "the vector has no covariance: lines G2 and G3 after it are the only source of its precision"
            )

    def _add(self, vector: Line, diagonal: Line, corners: Line) -> None:
        values = _three(vector, 2)
        start, to = vector.names(vector.fields[1], 2)
        covariance = self._covariance(diagonal, _three(diagonal, 1), _three(corners, 1))
        origin, target = (self._columns.point(vector.file, vector.index, name) for name in (start, to))
        first, sigmas = len(self._columns), np.sqrt(np.diag(covariance)).tolist()
        for kind, value, sigma in zip((VECTOR, VECTOR_Y, VECTOR_Z), values, sigmas, strict=True):
            measure = Measure(kind, origin, target, value, sigma)
            self._columns.append(measure, self._files[vector.file.name], vector.index)
        if diagonal.options.vertical != 1.0:
            self.vertical_factors[first] = diagonal.options.vertical
        self._columns.correlate([first, first + 1, first + 2], covariance)

    @staticmethod
    def _covariance(line: Line, diagonal: list[float], corners: list[float]) -> FloatArray:
        """(3, 3) m^2, times the square of the factor of the project."""
        matrix = np.diag(diagonal)
        for (row, column), value in zip(CORNERS, corners, strict=True):
            matrix[row, column] = matrix[column, row] = value
        if line.options.correlations:
            np.fill_diagonal(matrix, 1.0)
            matrix = matrix * np.outer(diagonal, diagonal)
        matrix = matrix * line.options.factor**2
        if min(diagonal) <= 0.0 or np.linalg.eigvalsh(matrix)[0] <= 0.0:
            raise line.error("the covariance of the vector is not positive definite")
        return matrix


def _three(line: Line, place: int) -> list[float]:
    if len(line.fields) < place + 3:
        raise line.error(f"{line.fields[0]} holds {'names and ' if place == 2 else ''}three numbers")
    return [line.number(text) for text in line.fields[place : place + 3]]
