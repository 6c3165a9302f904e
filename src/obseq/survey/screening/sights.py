"""Single observations that contradict the others: a wrong target, or a wrong value."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.values import GON, LIKELY, Explanation, difference, explain

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.survey.screening.robust import Estimate

_TOLERANCE = 5.0
"""Sigmas within which an explanation must hit."""


@dataclass(frozen=True)
class _WrongPoint:
    """A point that fits where another was written."""

    row: int
    chance: float


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
    rows = _of_same_sight(found, row, suspects)
    target = _other_point(found, rows, at_target=True)
    origin = None if target else _other_point(found, rows, at_target=False)
    wrong = target or origin
    best = value_cause.chance if value_cause else LIKELY
    if wrong is not None and wrong.chance < best:
        return _wrong_point(found, rows, wrong, at_target=target is not None)
    return _wrong_value(found, row, value_cause)


def tolerance_of(found: Estimate, row: int) -> float:
    """How far from what the others give a good value of an observation may be (m, rad)."""
    sigma = abs(found.misfits[row]) / max(float(found.ratios[row]), 1e-300)
    return _TOLERANCE * found.scale * float(sigma)


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
    return explain(kind, value, expected, tolerance)


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


def _other_point(found: Estimate, rows: list[int], *, at_target: bool) -> _WrongPoint | None:
    """The point whose coordinates fit all these observations where another is written."""
    observations, n = found.book.observations, len(found.points)
    located = np.asarray(np.isfinite(found.coordinates).all(axis=1))
    if not at_target and any(observations.stations[row] >= 0 for row in rows):
        return None
    if any(BY_CODE[int(observations.types[row])].start is Start.NOTHING for row in rows):
        return None
    fits, chance = located.copy(), float(np.count_nonzero(located))
    ends = [int(observations.from_points[rows[0]]), int(observations.to_points[rows[0]])]
    fits[ends] = False
    for row in rows:
        values = _to_all_points(found, row, at_target=at_target)
        kind, value = BY_CODE[int(observations.types[row])], float(observations.values[row])
        tolerance = 2.0 * tolerance_of(found, row)
        gaps = np.abs(values - value)
        if kind.is_angle:
            gaps = np.abs(np.remainder(gaps + math.pi, 2.0 * math.pi) - math.pi)
        fits &= gaps <= tolerance
        chance *= 2.0 * tolerance / (2.0 * math.pi if kind.is_angle else max(2.0 * abs(value), tolerance))
    candidates = np.flatnonzero(fits[:n])
    return _WrongPoint(int(candidates[0]), chance) if len(candidates) == 1 else None


def _to_all_points(found: Estimate, row: int, *, at_target: bool) -> FloatArray:
    """(n,) what one observation would have been to (or from) every point; NaN where it cannot be said."""
    observations = found.book.observations
    kind = BY_CODE[int(observations.types[row])]
    start, end = int(observations.from_points[row]), int(observations.to_points[row])
    base = found.coordinates[start if at_target else end]
    offsets = (found.coordinates - base) * (1.0 if at_target else -1.0)
    offsets[:, 2] += float(observations.to_heights[row] - observations.from_heights[row])
    if kind.start is Start.DISTANCE:
        return np.asarray(np.linalg.norm(offsets, axis=1))
    if kind.start is Start.FLAT:
        return np.asarray(np.hypot(offsets[:, 0], offsets[:, 1]))
    if kind.start is Start.ANGLE:
        back = found.coordinates[observations.backsights[row]]
        backwards = back - (base if at_target else found.coordinates)
        azimuths = [np.arctan2(sight[..., 0], sight[..., 1]) for sight in (offsets, backwards)]
        return np.asarray(azimuths[0] - azimuths[1])
    if kind.start is Start.RISE:
        there = found.coordinates[end if at_target else start]
        rise = found.coordinates[:, 2] - there[2]
        return np.asarray(found.computed[row] + (rise if at_target else -rise))
    if observations.stations[row] < 0:
        return np.full(len(offsets), np.nan)
    local = offsets @ found.rotations[observations.stations[row]]
    if kind.start is Start.ZENITH:
        return np.asarray(np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2]))
    if kind.is_angle:
        return np.asarray(np.arctan2(local[:, 0], local[:, 1]))
    return np.asarray(local[:, {Start.DX: 0, Start.DY: 1}.get(kind.start, 2)])


def _wrong_point(found: Estimate, rows: list[int], wrong: _WrongPoint, *, at_target: bool) -> GrossError:
    observations = found.book.observations
    ends = observations.to_points if at_target else observations.from_points
    written, fits = found.book.point_names[ends[rows[0]]], found.points.names[wrong.row]
    end = "target" if at_target else "first point"
    text = f"it fits {fits}, not {written}: the name of the {end} is wrong"
    size = float(found.ratios[rows].max())
    what = ", ".join(found.book.label(row) for row in rows)
    return GrossError(what, Cause.WRONG_POINT, text, size, tuple(rows), (written, fits))


def _wrong_value(found: Estimate, row: int, cause: Explanation | None) -> GrossError:
    observations = found.book.observations
    kind = BY_CODE[int(observations.types[row])]
    unit, name, decimals = (GON, "gon", 4) if kind.is_angle else (1.0, "m", 4)
    off = difference(kind, float(observations.values[row]), float(found.computed[row])) * unit
    expected = float(observations.values[row]) * unit - off
    words = f"likely: {cause.text}" if cause else "no usual slip explains it"
    gap = f"the others give {expected:.{decimals}f} {name}, it is {off:.{decimals}f} {name} off"
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
