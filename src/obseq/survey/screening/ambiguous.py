"""Errors in one of several places that nothing tells apart, and places that explain several misfits."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.alternatives import Alternative, alternatives
from obseq.survey.screening.findings import (
    Cause,
    GrossError,
    coordinates_told,
    gap_of,
    units_of_coordinate,
)
from obseq.survey.screening.levelling import errors_of_levelling
from obseq.survey.screening.sight_heights import height_error
from obseq.survey.screening.values import COORDINATE, Explanation, difference, explain

if TYPE_CHECKING:
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.screening.robust import Estimate, Model

_MOST = 12
"""Suspects for which it is asked what else could be wrong."""
_MOST_WORK = 100_000
"""Observations in all the adjustments that this takes."""
_NAMED, _TOLD = 6, 3
"""How many places are named, and of how many it is told how far off they are."""
_TOLERANCE = 5.0
"""Sigmas within which two estimates of an error agree."""
_HIT = 3.0
"""Sigmas of such an estimate within which an explanation must hit."""
_AXES = ("x", "y", "height")

Place = tuple[int, int, int]


@dataclass(frozen=True)
class Ambiguity:
    """How places of errors are described.

    Attributes:
        system: the coordinates of the point files.
        found: the network.
    """

    system: PointSystem
    found: Estimate

    def errors(self, model: Model, suspects: list[int]) -> tuple[list[GrossError], list[int]]:
        """Errors in one of several places, or in one that explains several suspects; and other suspects."""
        if suspects and (told := self._of_levelling(self.levelling(model), suspects)):
            return told, []
        n = max(len(self.found.book.observations), 1)
        asked = suspects[: min(_MOST, _MOST_WORK // n)]
        choices = {row: alternatives(model, self.found, row, suspects) for row in asked}
        errors: list[GrossError] = []
        left = list(suspects)
        for row in asked:
            if row not in left:
                continue
            covered = {_place(one): self._suspects_explained_by(one, left, choices) for one in choices[row]}
            most = max(map(len, covered.values()), default=0)
            places = [one for one in choices[row] if len(covered[_place(one)]) == most]
            if most > 1 or len(places) > 1:
                rows = covered[_place(places[0])]
                errors.append(self._error(rows, places))
                left = [other for other in left if other not in rows]
        return errors, left

    def levelling(self, model: Model) -> list[list[Alternative]]:
        """The places of each error of a levelling; none where they are not told, or it is large."""
        return (
            errors_of_levelling(model, self.found) if len(self.found.book.observations) <= _MOST_WORK else []
        )

    def _of_levelling(self, errors: list[list[Alternative]], suspects: list[int]) -> list[GrossError]:
        """The errors of a levelling; none where they are the suspects, which are told one by one."""
        rows = [[one.row for one in places if one.row >= 0] for places in errors]
        if all(map(_is_observation, errors)) and set(chain.from_iterable(rows)) == set(suspects):
            return []
        told = []
        for k, places in enumerate(errors):
            others = {row for other in rows[:k] + rows[k + 1 :] for row in other}
            mine = [row for row in suspects if row not in others]
            told.append(self._error(mine or rows[k] or suspects, places))
        return told

    def _suspects_explained_by(
        self, one: Alternative, left: list[int], choices: dict[int, list[Alternative]]
    ) -> list[int]:
        """The suspects that the same error, of the same size, would explain."""
        return [row for row in left if any(self._agree(one, other) for other in choices.get(row, []))]

    def _agree(self, one: Alternative, other: Alternative) -> bool:
        spread = _TOLERANCE * self.found.scale * float(np.hypot(one.sigma, other.sigma))
        return _place(one) == _place(other) and abs(one.off - other.off) <= spread

    def _error(self, rows: list[int], places: list[Alternative]) -> GrossError:
        size = float(self.found.ratios[rows].max())
        told = sorted(
            ((one, found) for one in places if (found := self._explanation(one))),
            key=lambda pair: pair[1].chance,
        )
        points = tuple(dict.fromkeys(self.found.points.names[one.point] for one in places if one.point >= 0))
        concerned = tuple(dict.fromkeys([*rows, *(one.row for one in places if one.row >= 0)]))
        cause = told[0][1].cause if told else Cause.UNKNOWN
        if len(places) == 1:
            text = f"{self._gap(places[0])}; {_likely(told)}"
            return GrossError(self._name(places[0]), cause, text, size, concerned, points)
        names = ", ".join(self._name(one) for one in places[:_NAMED])
        more = f" and {len(places) - _NAMED} more" if len(places) > _NAMED else ""
        text = "nothing tells them apart, an error in any one of them explains it all: "
        if told:
            text += "; or ".join(
                f"{self._name(one)}: {self._gap(one)}, likely: {why.text}" for one, why in told[:_TOLD]
            )
        else:
            text += f"{self._gaps(places)}; no usual slip points to one of them"
        text += self._or_height(places)
        return GrossError(f"one of {names}{more}", cause, text, size, concerned, points, is_one=True)

    def _or_height(self, places: list[Alternative]) -> str:
        """The height of a target that does what an error of its zenith angle does, in words; or nothing."""
        heights = (height_error(self.found, one.row, [one.row]) for one in places if one.row >= 0)
        height = next(filter(None, heights), None)
        return "" if height is None else f"; or the {height.what}: {height.text}"

    def _name(self, one: Alternative) -> str:
        if one.row >= 0:
            return self.found.book.label(one.row)
        points = self.found.points
        return f"{_AXES[one.component]} of known point {points.names[one.point]} ({points.place(one.point)})"

    def _values(self, one: Alternative) -> tuple[float, float, float]:
        """The value as read, what would fit (m, rad, or the unit of the points), and what one unit is."""
        if one.row >= 0:
            observations = self.found.book.observations
            value, kind = float(observations.values[one.row]), BY_CODE[int(observations.types[one.row])]
            return value, value - difference(kind, one.off, 0.0), 1.0
        here = self.found.points.coordinates[[one.point]]
        given = float(self.system.coordinates(here)[0, one.component])
        unit = float(self.system.axes(here)[1][0, one.component])
        return given, given - one.off / unit, unit

    def _gap(self, one: Alternative) -> str:
        value, fits, _ = self._values(one)
        if one.row >= 0:
            kind = BY_CODE[int(self.found.book.observations.types[one.row])]
            return gap_of(self.found.units, kind, fits, value - fits)
        given, gap = coordinates_told(self.found.units, self.system, one.component, fits, value - fits)
        return f"the others give {given}, it is {gap} off"

    def _gaps(self, places: list[Alternative]) -> str:
        """How far off each of a few places is; of many the first."""
        if len(places) > _TOLD:
            return f"{self._gap(places[0])} if it is the first"
        return "; or ".join(f"{self._name(one)}: {self._gap(one)}" for one in places)

    def _explanation(self, one: Alternative) -> Explanation | None:
        kind = BY_CODE[int(self.found.book.observations.types[one.row])] if one.row >= 0 else COORDINATE
        value, fits, unit = self._values(one)
        tolerance = _HIT * self.found.scale * one.sigma / unit
        units = self.found.units
        if one.row < 0:
            units = units_of_coordinate(units, self.system, one.component)
        return explain(kind, value, fits, tolerance, units)


def _place(one: Alternative) -> Place:
    return one.row, one.point, one.component


def _is_observation(places: list[Alternative]) -> bool:
    """Whether it is one observation that has an error, and nothing else may have it."""
    return len(places) == 1 and places[0].row >= 0


def _likely(told: list[tuple[Alternative, Explanation]]) -> str:
    return f"likely: {told[0][1].text}" if told else "no usual slip explains it"
