"""Points of which the observations give the plan and nothing of the height: this is no unknown of theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import among, codes_for
from obseq.survey.model import FieldBook, Orientation, Points, automatic_fix

_IN_PLAN = Start.HZ, Start.ANGLE, Start.FLAT, Start.DX, Start.DY
"""What, read in a horizon, sees of a height no more than the curvature of the Earth lets through."""


def with_plans_only(points: Points, book: FieldBook) -> Points:
    """The points, with the heights as invented of those that are observed in plan only.

    These are free in height, and all that is observed of them is read in a horizon. One zenith angle, slope
    distance or height difference, and the height is an unknown again.

    Args:
        points: All points that observations name, and others.
        book: The observations, numbered like the points; the stations have a vertical.
    """
    found = are_in_plan_only(points, book)
    invented = points.is_invented & ~points.is_free
    invented[:, 2] |= found
    return replace(points, invented=invented) if found.any() or points.invented is not None else points


def with_heights_of_site(points: Points, book: FieldBook) -> Points:
    """The points, with a place to compute at for those of which the plan is given, and observed, alone.

    Args:
        points: All points, in a system with heights.
        book: The observations, numbered like the points.
    """
    has_plan = np.isfinite(points.coordinates[:, :2]).all(axis=1)
    found = has_plan & np.isnan(points.coordinates[:, 2])
    found &= are_in_plan_only(points, book) if found.any() else False
    if not found.any():
        return points
    heights = points.coordinates[points.has_coordinates, 2]
    coordinates, invented = points.coordinates.copy(), points.is_invented.copy()
    coordinates[found, 2], invented[found, 2] = np.median(heights) if heights.size else 0.0, True
    return replace(points, coordinates=coordinates, invented=invented)


def are_in_plan_only(points: Points, book: FieldBook) -> BoolArray:
    """(n,) the points that are free in height, and observed in plan only."""
    return np.asarray(points.is_free[:, 2] & _seen_in_plan_only(book)[: len(points)])


def _seen_in_plan_only(book: FieldBook) -> BoolArray:
    """(k,) of the points that the book names, those all of whose active observations are in a horizon."""
    rows, n = book.observations, len(book.point_names)
    is_tilted = np.append(automatic_fix(book) == Orientation.BASC.value, np.False_)[rows.stations]
    in_plan = among(rows.types, codes_for(*_IN_PLAN)) & ~is_tilted
    seen = book.counts(rows.active & in_plan, n) > 0
    return np.asarray(seen & (book.counts(rows.active & ~in_plan, n) == 0))
