"""What can be said against a network before it is computed, in the words of a surveyor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.survey.kinds.registry import IS_ANGLE, among, codes_where

if TYPE_CHECKING:
    from obseq.survey.initial.initial_values import InitialValues
    from obseq.survey.model import FieldBook, Points


LISTED = 8
"""Names given in a message before it says how many more there are."""

SHORTEST_HORIZONTAL = 1e-5
"""Horizontal distance (m) below which a direction means nothing: 1 um turns it by 0.1 rad."""


def check_datum(points: Points, book: FieldBook) -> None:
    """Raises InputError when no coordinate of any point is known, or observed, or carries a datum."""
    if not points.is_free.all() or points.in_datum.any():
        return
    absolute = among(book.observations.types, codes_where(lambda kind: kind.is_absolute))
    if not (absolute & book.observations.active).any():
        raise InputError(
            "no point is known: nothing fixes the position of the network. Give at least one point of the "
            "point file as known (flag 1) with its sigma"
        )


def check_counts(points: Points, book: FieldBook) -> None:
    """Raises InputError naming the points that have fewer observations than free coordinates."""
    observations, n = book.observations, len(points)
    count = book.counts(observations.active, n)
    lacking = np.flatnonzero(count < points.is_unknown.sum(axis=1))
    if lacking.size:
        listed = ", ".join(f"{points.names[row]} ({count[row]})" for row in lacking[:LISTED])
        more = f" and {lacking.size - LISTED} more" if lacking.size > LISTED else ""
        raise InputError(
            f"points with fewer active observations (in brackets) than unknown coordinates: {listed}{more}. "
            f"Observe them more, or remove them from the point file"
        )


def check_sights(book: FieldBook, initial: InitialValues) -> None:
    """Raises InputError at the first angle whose target is on the vertical axis of its station."""
    observations = book.observations
    is_angle = IS_ANGLE[observations.types] & (observations.stations >= 0)
    rows = np.flatnonzero(is_angle & observations.active)
    coordinates = initial.coordinates
    sights = coordinates[observations.to_points[rows]] - coordinates[observations.from_points[rows]]
    seen = np.einsum("nji,nj->ni", initial.rotations[observations.stations[rows]], sights)
    vertical = np.flatnonzero(np.hypot(seen[:, 0], seen[:, 1]) < SHORTEST_HORIZONTAL)
    if vertical.size:
        row, target = int(rows[vertical[0]]), book.point_names[observations.to_points[rows[vertical[0]]]]
        coincide = abs(seen[vertical[0], 2]) < SHORTEST_HORIZONTAL
        where = "has the coordinates of the station" if coincide else "is on the vertical of the station"
        raise InputError(
            f"{book.label(row)}: the target {where}; its direction is undefined. "
            f"Remove the line, or correct the coordinates of {target}"
        )
