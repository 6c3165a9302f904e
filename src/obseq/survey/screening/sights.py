"""Single observations that contradict the others: a wrong target, or a wrong value."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.findings import Cause, GrossError, gap_of
from obseq.survey.screening.sight_heights import height_error
from obseq.survey.screening.substitutes import End, Substitutes, substitutes, tolerance_of
from obseq.survey.screening.values import LIKELY, Explanation, difference, explain

if TYPE_CHECKING:
    from obseq.survey.screening.robust import Estimate


def single_errors(found: Estimate, suspects: list[int]) -> list[GrossError]:
    """These observations, each with its likely cause; measures of one sight to a wrong point together."""
    left = dict.fromkeys(suspects)
    errors: list[GrossError] = []
    while left:
        worst = next(iter(left))
        error = _error_of(found, worst, left)
        errors.append(error)
        for row in (worst, *error.rows):
            left.pop(row, None)
    return _with_pairs(found, errors)


def _error_of(found: Estimate, row: int, suspects: dict[int, None]) -> GrossError:
    value_cause = explanation_of(found, row)
    best = value_cause.chance if value_cause else LIKELY
    rows = _of_same_sight(found, row, suspects)
    wrong = [one for end in End if (one := substitutes(found, rows, end)) and len(one.points) == 1]
    wrong = [one for one in wrong if len(wrong) * one.chance < best]
    if wrong:
        return _wrong_point(found, wrong)
    height = height_error(found, row, suspects)
    if height is not None and len(height.rows) > 1:
        return height
    told = _wrong_value(found, row, value_cause)
    if height is None or value_cause is not None:
        return told
    return replace(told, text=f"{told.text}, unless the height of the target is wrong: {height.text}")


def explanation_of(found: Estimate, row: int) -> Explanation | None:
    """What may be wrong with the value of one observation."""
    observations = found.book.observations
    kind = BY_CODE[int(observations.types[row])]
    value, expected = float(observations.values[row]), float(found.computed[row])
    tolerance = tolerance_of(found, row)
    if kind.start is Start.DISTANCE:
        ends = found.coordinates[[observations.from_points[row], observations.to_points[row]]]
        flat = math.hypot(*(ends[1] - ends[0])[:2].tolist())
        if abs(flat - value) <= tolerance < 0.5 * abs(expected - flat):
            text = "the horizontal distance instead of the slope distance"
            return Explanation(Cause.HORIZONTAL, text, tolerance / max(value, tolerance))
    return explain(kind, value, expected, tolerance, found.units)


def _of_same_sight(found: Estimate, row: int, suspects: dict[int, None]) -> list[int]:
    """The suspects between the same two points, of the same station."""
    observations = found.book.observations
    ends = observations.from_points[row], observations.to_points[row]
    station = observations.stations[row]
    return [
        other
        for other in suspects
        if (observations.from_points[other], observations.to_points[other]) == ends
        and (observations.stations[other] == station or min(observations.stations[other], station) < 0)
    ]


def _wrong_point(found: Estimate, wrong: list[Substitutes]) -> GrossError:
    """Observations that fit with another point at one end, or at either of several."""
    rows = list(wrong[0].rows)
    names = [_names(found, one) for one in wrong]
    told = (
        f"it fits {fits}, not {written}: the name of the {one.end} is wrong"
        for one, (written, fits) in zip(wrong, names, strict=True)
    )
    size = float(found.ratios[rows].max())
    what = ", ".join(found.book.label(row) for row in rows)
    return GrossError(what, Cause.WRONG_POINT, "; or ".join(told), size, wrong[0].rows, names[0])


def _names(found: Estimate, one: Substitutes) -> tuple[str, str]:
    """The point that is written, and the one that fits."""
    observations = found.book.observations
    ends = {
        End.TARGET: observations.to_points,
        End.ORIGIN: observations.from_points,
        End.BACKSIGHT: observations.backsights,
    }[one.end]
    return found.book.point_names[ends[one.rows[0]]], found.points.names[one.points[0]]


def _wrong_value(found: Estimate, row: int, cause: Explanation | None) -> GrossError:
    observations = found.book.observations
    kind = BY_CODE[int(observations.types[row])]
    value = float(observations.values[row])
    off = difference(kind, value, float(found.computed[row]))
    words = f"likely: {cause.text}" if cause else "no usual slip explains it"
    gap = gap_of(found.units, kind, value - off, off)
    kind_of = cause.cause if cause else Cause.UNKNOWN
    return GrossError(found.book.label(row), kind_of, f"{gap}; {words}", float(found.ratios[row]), (row,))


def _with_pairs(found: Estimate, errors: list[GrossError]) -> list[GrossError]:
    """Two sights whose targets fit each other's names are one mistake: exchanged names."""
    result: list[GrossError] = []
    for error in errors:
        partner = next(
            (
                other
                for other in result
                if Cause.WRONG_POINT is other.cause is error.cause
                and other.points == error.points[::-1]
                and _origin(found, other) == _origin(found, error)
            ),
            None,
        )
        if partner is None:
            result.append(error)
            continue
        text = f"the names {partner.points[0]} and {partner.points[1]} are exchanged"
        what, size = f"{partner.what}, {error.what}", max(partner.size, error.size)
        rows = partner.rows + error.rows
        result[result.index(partner)] = GrossError(
            what, Cause.SWAPPED_NAMES, text, size, rows, partner.points
        )
    return result


def _origin(found: Estimate, error: GrossError) -> int:
    return int(found.book.observations.from_points[error.rows[0]])
