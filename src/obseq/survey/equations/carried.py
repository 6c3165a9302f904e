"""What a point carries along in the equations: the plumb line that turns with it, and what values follow.

The axes of an instrument lean by w when its point moves. Seen in them, a target at the end of the sight s has
moved by s x w: so derivatives by targets are all that is to be known of an equation. A target at a height h
above its point moves by w x h u, u along its plumb line.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from obseq.arrays import FloatArray
from obseq.leastsquares.problem.shapes import Move
from obseq.survey.equations.families import Family
from obseq.survey.equations.site import NetworkSite

FIRST = "station.centre", "station", "origin", "point"
"""What the equations call the point that they are observed from."""
LAST = "target", "point"
"""What they call the point that is observed."""


def moves_of(
    site: NetworkSite, family: Family, places: Mapping[str, int], coordinates: FloatArray
) -> list[Move]:
    """What the points of observations carry along, at coordinates (n_points, 3).

    Args:
        site: The network.
        family: The observations.
        places: Where the equation has its blocks, by their names.
        coordinates: (n_points, 3).
    """
    found = list(_of_values(site, family, places, coordinates))
    if site.frame.has_turning_vertical:
        found += _of_plumb_lines(site, family, places, coordinates)
    return found


def _of_plumb_lines(
    site: NetworkSite, family: Family, places: Mapping[str, int], coordinates: FloatArray
) -> Iterator[Move]:
    """Through the plumb lines of both ends."""
    kind, rows, observations = family.kinds[0][0], family.rows, site.book.observations
    first, last = _place(places, FIRST), _place(places, LAST)
    if first is None or last is None:
        return
    ends = observations.from_points[rows], observations.to_points[rows]
    is_raised = (kind.takes_heights or kind.is_raised) and family.has_heights
    if kind.has_axes:
        turns = site.turns_of_axes(rows, coordinates)
        raised = site.offsets(rows, coordinates) if is_raised else 0.0
        seen = {last: ends[1]}
        if "backsight" in places:
            seen[places["backsight"]] = observations.backsights[rows]
        for place, points in seen.items():
            yield Move(first, place, _levers(coordinates[points] - coordinates[ends[0]] + raised, turns))
    if is_raised:
        heights = observations.from_heights[rows], -observations.to_heights[rows]
        for place, points, height in zip((first, last), ends, heights, strict=True):
            if height.any():
                up = site.plumb.axes(points.astype(np.int64), coordinates)[:, 2]
                yield Move(place, last, _levers(height[:, None] * up, site.plumb.turns(points, coordinates)))


def _of_values(
    site: NetworkSite, family: Family, places: Mapping[str, int], coordinates: FloatArray
) -> Iterator[Move]:
    """Through values that are corrected for where the points are."""
    slopes = [kind.slopes(site, family.rows[at], coordinates) for kind, at in family.kinds]
    if any(slope is not None for slope in slopes):
        filled = [
            np.zeros((len(at), 6)) if slope is None else slope
            for slope, (_, at) in zip(slopes, family.kinds, strict=True)
        ]
        for names, slope in zip((FIRST, LAST), np.split(family.gathered(filled), 2, axis=1), strict=True):
            place = _place(places, names)
            assert place is not None
            yield Move(place, None, slope)


def _place(places: Mapping[str, int], names: tuple[str, ...]) -> int | None:
    return next((places[name] for name in names if name in places), None)


def _levers(sights: FloatArray, turns: FloatArray) -> FloatArray:
    """(n, 3, 3) s x w of sights (n, 3) and turns (n, 3, 3), whose columns are those of the movement."""
    x, y, z = sights.T[:, :, None]
    found = np.empty((len(sights), 3, 3))  # np.cross takes three times as long
    found[:, 0] = y * turns[:, 2] - z * turns[:, 1]
    found[:, 1] = z * turns[:, 0] - x * turns[:, 2]
    found[:, 2] = x * turns[:, 1] - y * turns[:, 0]
    return found
