"""What to call the equations of a block, and the errors of what they observe."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.images.adjustment.equations import LENGTHS
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import IntArray
    from obseq.images.adjustment.equations import Equations, MeasureBatch
    from obseq.images.adjustment.surveys import JoinedSurvey
    from obseq.leastsquares import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.survey.model import FieldBook


class NamedError(NamedTuple):
    """An observation and its error.

    Attributes:
        name: image and point and coordinate, control point and coordinate, length, survey observation, ...
        error: too large when positive; None where it is no number of the input.
        unit: of that; empty for the unit of the world.
    """

    name: str
    error: float | None
    unit: str


class EquationNames:
    """Names of the equations of a block.

    Attributes:
        measures: batches of image points, by the identity of their batch.
    """

    def __init__(self, equations: Equations, surveys: Sequence[JoinedSurvey]) -> None:
        self._start, self._lengths = equations.start, equations.block.lengths
        self._control, self._given = equations.control
        self.measures = {id(item.batch): item for item in equations.measures}
        self._surveys = {
            id(batch): (part.network.book, rows)
            for part in surveys
            for rows, batch in part.equations.batches.values()
        }

    def of(self, source: Batch | Prior, row: int, component: int, error: float) -> NamedError:
        """The name of one equation whose observation has this error, in the unit of its residual."""
        key = id(source)
        if key in self.measures:
            return NamedError(f"{self._measure(self.measures[key], row)} {'xy'[component]}", error, "px")
        if source is self._control:
            return self._control_coordinate(int(self._given[row, 0]), int(self._given[row, 1]), error)
        if key in self._surveys:
            return self._survey(*self._surveys[key], row, error)
        if source.group == LENGTHS:
            return NamedError(f"length {self._lengths.first[row]} to {self._lengths.second[row]}", error, "")
        return NamedError(source.label(row), None, "")

    def point_of(self, source: Batch | Prior, row: int) -> int | None:
        """The point of a measure or of a control coordinate, a position in the points of the start."""
        item = self.measures.get(id(source))
        if item is not None:
            return int(self._start.sets[item.part].point[item.rows[row]])
        return int(self._given[row, 0]) if source is self._control else None

    def _measure(self, item: MeasureBatch, row: int) -> str:
        return self._start.sets[item.part].given.measures.label(int(item.rows[row]))

    def _control_coordinate(self, point: int, axis: int, error: float) -> NamedError:
        """Correlated coordinates are tested in mixtures, which have no errors of their own."""
        name, covariance = f"control point {self._start.points[point]}", self._start.covariances[point]
        if np.any(covariance[~np.eye(3, dtype=bool)]):
            return NamedError(name, None, "")
        return NamedError(f"{name} {'xyz'[axis]}", error * float(np.sqrt(covariance[axis, axis])), "")

    def _survey(self, book: FieldBook, rows: IntArray, row: int, error: float) -> NamedError:
        place = int(rows[row])
        is_angle = BY_CODE[int(book.observations.types[place])].is_angle
        return NamedError(book.label(place), None if is_angle else error, "" if is_angle else "m")
