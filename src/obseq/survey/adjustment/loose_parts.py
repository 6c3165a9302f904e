"""What a singular network leaves loose: its points and stations, each with the true reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.adjustment.labels import station_names
from obseq.survey.adjustment.links import linked_to_known
from obseq.survey.adjustment.singular_words import in_words
from obseq.survey.adjustment.undetermined import directions
from obseq.survey.initial.unplaced import ISOLATED, Unplaced

if TYPE_CHECKING:
    from obseq.errors import SingularSystemError
    from obseq.survey.initial.left_out import Determined

SINGULAR = "its observations do not determine it (the system is singular)"
ELSEWHERE = "observe it from other directions"


def singular_parts(start: Determined, error: SingularSystemError) -> list[Unplaced]:
    """The points, or else the stations, that a singular system leaves undetermined.

    Raises:
        SingularSystemError: these are all unknown points, or none: then nothing can be done without them.
    """
    names = points_of(error)
    free = start.points.is_free.any(axis=1)
    points = [row for row in np.flatnonzero(free).tolist() if start.points.names[row] in names]
    if points and len(points) == np.count_nonzero(free):
        raise in_words(error)
    found = _undetermined(start, points, error) if points else _stations(start, names)
    if not found:
        raise in_words(error)
    return found


def points_of(error: SingularSystemError) -> set[str]:
    """The names of the points and stations that a singular system does not determine."""
    return {name.rsplit(".", 1)[0] for name in error.unknowns}


def _stations(start: Determined, names: set[str]) -> list[Unplaced]:
    """The stations of these names."""
    book, called = start.book, station_names(start.points, start.book)
    found = [(k, int(book.stations.origins[k])) for k, name in enumerate(called) if name in names]
    reason = f"{SINGULAR}; {ELSEWHERE}"
    return [
        Unplaced(f"{called[k]} ({book.place(int(book.stations.observations(k)[0]))})", reason, origin, k)
        for k, origin in found
    ]


def _undetermined(start: Determined, rows: list[int], error: SingularSystemError) -> list[Unplaced]:
    """Points of a singular system, with what nothing holds of them."""
    named = [start.points.names[row] for row in rows]
    along = [()] * len(rows) if error.kernel is None else directions(named, error.unknowns, error.kernel)
    linked = linked_to_known(start.points, start.book)
    return [
        Unplaced(f"point {name}", _reason(name, axes, error, bool(linked[row])), row, None, axes or None)
        for name, row, axes in zip(named, rows, along, strict=True)
    ]


def _reason(name: str, axes: tuple[tuple[float, ...], ...], error: SingularSystemError, linked: bool) -> str:
    """Why a point is loose: it hangs on nothing, or moves together with others, or in some directions."""
    if not linked:
        return ISOLATED
    if name in error.movements and not error.movements[name].endswith(f" of {name}"):
        return f"{SINGULAR}; nothing fixes {error.movements[name]}"
    if not axes:
        return f"{SINGULAR}; {ELSEWHERE}"
    listed = " and ".join(f"({x:.2f}, {y:.2f}, {z:.2f})" for x, y, z in axes)
    return f"{SINGULAR}; {ELSEWHERE}; nothing holds it along {listed}"
