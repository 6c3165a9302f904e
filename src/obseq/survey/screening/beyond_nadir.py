"""Zenith angles that no instrument reads in its first face: below 0, or beyond the nadir.

They fit nothing wherever points are, which is seen without any trial. They are put right before anything else
is looked for: directions of the same set-ups may have the wrong sign too, and neither explains much alone.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.registry import codes_where
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.offset_effects import zenith_angles
from obseq.survey.screening.robust import GROSS
from obseq.survey.screening.substitutes import sigma_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.robust import Estimate

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LEAST = 2
"""Zenith angles from which those of a point are one mistake."""
_STEEPEST = 0.25 * math.pi
"""Elevation (rad) of most sights, put right, from which these are elevations instead."""
_MOST_NAMED = 4
_TURN = 2.0 * math.pi


def beyond_nadir(book: FieldBook) -> Rows:
    """All zenith angles, or those of points from which all of them, and several, are beyond the nadir."""
    rows = np.flatnonzero(_are(book, zenith_angles()))
    values = np.remainder(book.observations.values[rows], _TURN)
    origins, n = book.observations.from_points[rows], len(book.point_names)
    is_steep = np.abs(values - 1.5 * math.pi) > _STEEPEST
    is_beyond = values > math.pi
    if len(rows) >= _LEAST and is_beyond.all() and 2 * np.count_nonzero(is_steep) < len(rows):
        return np.asarray(rows)
    count, wrong, steep = (
        np.bincount(some, minlength=n) for some in (origins, origins[is_beyond], origins[is_steep])
    )
    return np.asarray(rows[((wrong == count) & (count >= _LEAST) & (2 * steep < count))[origins]])


def lone_beyond(book: FieldBook, *, flat: bool) -> Rows:
    """Zenith angles below 0 or beyond the nadir by more than their sigmas allow, whatever others are.

    Args:
        book: the observations.
        flat: only those that are near the horizon when they are put right; others may be elevations.
    """
    rows = np.flatnonzero(_are(book, zenith_angles()))
    values = np.remainder(book.observations.values[rows], _TURN)
    is_beyond = np.minimum(values - math.pi, _TURN - values) > GROSS * book.observations.sigmas[rows]
    is_flat = np.abs(values - 1.5 * math.pi) <= _STEEPEST
    return np.asarray(rows[is_beyond & is_flat if flat else is_beyond])


def told_alone(book: FieldBook, rows: Rows, found: Estimate) -> list[GrossError]:
    """Single zenith angles below 0 or beyond the nadir: a reading that no place of any point explains.

    Args:
        book: the observations.
        rows: of these angles.
        found: the network.
    """
    values = np.remainder(book.observations.values[rows], _TURN)
    sizes = np.minimum(values - math.pi, _TURN - values) / [sigma_of(found, row) for row in rows.tolist()]
    return [
        GrossError(
            book.label(row),
            Cause.SENSE,
            f"{found.units.angle.text(float(book.observations.values[row]))} is no zenith angle: read in the "
            f"other face, or with the wrong sign ({found.units.angle.text(_TURN - value)} would be one)",
            size,
            (row,),
        )
        for row, value, size in zip(rows.tolist(), values.tolist(), sizes.tolist(), strict=True)
    ]


def put_right(book: FieldBook, rows: Rows) -> FieldBook:
    """The observations, some angles with the other sign."""
    values = book.observations.values.copy()
    values[rows] = np.remainder(-values[rows], _TURN)
    return replace(book, observations=replace(book.observations, values=values))


def with_signs(
    book: FieldBook, rows: Rows, found: Estimate, others: Sequence[GrossError]
) -> list[GrossError]:
    """Findings, with that of zenith angles beyond the nadir: one with that of directions of the same points.

    Args:
        book: the observations as they are.
        rows: these zenith angles.
        found: the network with them put right.
        others: what was found in it.
    """
    if not len(rows):
        return list(others)
    error, circle = _finding(book, rows, found), codes_where(lambda kind: kind.is_of_circle)
    directions = {*np.flatnonzero(_are(book, circle) & _from_same(book, rows)).tolist()}
    sense = [one for one in others if one.cause is Cause.SENSE and directions and directions <= {*one.rows}]
    if not sense:
        return [error, *others]
    both = (*error.rows, *sense[0].rows)
    what = f"all {len(both)} angles{_origins(book, rows)} (the first: {book.label(min(both))})"
    text = "they look like angles with the wrong sign: directions counted anticlockwise"
    size = max(error.size, sense[0].size)
    whole = GrossError(what, Cause.SENSE, text, size, both)
    return [whole, *(one for one in others if one is not sense[0])]


def _are(book: FieldBook, codes: list[int]) -> BoolArray:
    """(k,) which active observations are of some kinds."""
    return np.asarray(book.observations.active & np.isin(book.observations.types, codes))


def _from_same(book: FieldBook, rows: Rows) -> BoolArray:
    """(k,) which observations are from points from which some are."""
    origins = book.observations.from_points
    return np.isin(origins, origins[rows])


def _finding(book: FieldBook, rows: Rows, found: Estimate) -> GrossError:
    what = f"all {len(rows)} Zen observations{_origins(book, rows)} (the first: {book.label(int(rows[0]))})"
    text = "they look like read in the other face, or with the wrong sign (400 gon minus each fits)"
    gaps = np.remainder(found.computed[rows] - book.observations.values[rows] + math.pi, _TURN) - math.pi
    sizes = np.abs(gaps) / [sigma_of(found, row) for row in rows.tolist()]
    size = float(np.nanmax(sizes)) if np.isfinite(sizes).any() else 0.0
    return GrossError(what, Cause.SENSE, text, size, tuple(rows.tolist()))


def _origins(book: FieldBook, rows: Rows) -> str:
    """From where zenith angles are; empty for all of them."""
    if len(rows) == np.count_nonzero(_are(book, zenith_angles())):
        return ""
    points = dict.fromkeys(book.observations.from_points[rows].tolist())
    names = [book.point_names[point] for point in points]
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return f" from {', '.join(names[:_MOST_NAMED])}{more}"
