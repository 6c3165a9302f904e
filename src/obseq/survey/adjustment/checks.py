"""What can be said against a network before it is computed, in the words of a surveyor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.survey.adjustment.equations import station_names
from obseq.survey.adjustment.undetermined import directions
from obseq.survey.initial.unplaced import Unplaced
from obseq.survey.kinds.registry import BY_CODE, IS_ANGLE

if TYPE_CHECKING:
    from obseq.errors import SingularSystemError
    from obseq.survey.initial.initial_values import InitialValues
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points


SINGULAR = "its observations do not determine it (the system is singular); observe it from other directions"

LISTED = 8
"""Names given in a message before it says how many more there are."""

SHORTEST_HORIZONTAL = 1e-5
"""Horizontal distance (m) below which a direction means nothing: 1 um turns it by 0.1 rad."""


def check_datum(points: Points, book: FieldBook) -> None:
    """Raises InputError when no coordinate of any point is known, or observed, or carries a datum."""
    observed = (
        np.isin(book.observations.types, [kind.code for kind in BY_CODE.values() if kind.is_absolute])
        & book.observations.active
    )
    if points.is_free.all() and not points.in_datum.any() and not observed.any():
        raise InputError(
            "no point is known: nothing fixes the position of the network. Give at least one point of the "
            "point file as known (flag 1) with its sigma"
        )


def check_counts(points: Points, book: FieldBook) -> None:
    """Raises InputError naming the points that have fewer observations than free coordinates."""
    observations, n = book.observations, len(points)
    count = book.counts(observations.active, n)
    lacking = np.flatnonzero(count < points.is_free.sum(axis=1))
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
    vertical = rows[np.hypot(seen[:, 0], seen[:, 1]) < SHORTEST_HORIZONTAL]
    if vertical.size:
        row = int(vertical[0])
        target = book.point_names[observations.to_points[row]]
        raise InputError(
            f"{book.label(row)}: the target is on the vertical of the station; its direction is undefined. "
            f"Remove the line, or correct the coordinates of {target}"
        )


def singular_parts(start: Determined, error: SingularSystemError) -> list[Unplaced]:
    """The points, or else the stations, that a singular system leaves undetermined.

    Empty when these are all unknown points: then it is the datum that lacks, and nothing can be done without.
    """
    names = {name.rsplit(".", 1)[0] for name in error.unknowns}
    free = start.points.is_free.any(axis=1)
    points = [row for row in np.flatnonzero(free).tolist() if start.points.names[row] in names]
    if points:
        found = _undetermined(start.points, points, error)
        return found if len(found) < np.count_nonzero(free) else []
    book = start.book
    return [
        Unplaced(f"{name} ({book.place(int(book.stations.observations(k)[0]))})", SINGULAR, int(origin), k)
        for k, (name, origin) in enumerate(
            zip(station_names(start.points, book), book.stations.origins, strict=True)
        )
        if name in names
    ]


def _undetermined(points: Points, rows: list[int], error: SingularSystemError) -> list[Unplaced]:
    """Points of a singular system, with the directions in which nothing holds them."""
    named = [points.names[row] for row in rows]
    if error.kernel is None:
        return [Unplaced(f"point {name}", SINGULAR, row) for name, row in zip(named, rows, strict=True)]
    along = directions(named, error.unknowns, error.kernel)
    return [_moving(*item) for item in zip(named, rows, along, strict=True)]


def _moving(name: str, row: int, along: tuple[tuple[float, ...], ...]) -> Unplaced:
    if not along:
        return Unplaced(f"point {name}", SINGULAR, row)
    axes = " and ".join(f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in along)
    return Unplaced(f"point {name}", f"{SINGULAR}; nothing holds it along {axes}", row, None, along)
