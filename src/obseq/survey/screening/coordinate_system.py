"""All known points together: they contradict observations that agree with each other.

That is what a wrong coordinate system looks like. No known point is wrong by itself then, and no group of
observations; trying them one after the other would take long in a large network, and find nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.geometry import closest_rotation
from obseq.survey.screening.distances import distances_of
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.robust import GROSS, QUICK
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.model import Points
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

_LEAST_KNOWN = 6
"""Known points from which they can be said to be wrong together."""
_NEARLY_ALL = 0.9
"""Share of the known points with suspects, and..."""
_MOST = 0.5
"""...share of suspects among their observations from which they are wrong together."""
_MANY, _MANY_AT_ONE = 0.1, 0.25
"""Share of suspects, of all observations or of those at one known point, from which points outside the area
of their system say that it is another."""
_LEAST_AT_ONE = 4
"""Suspects at one known point that are more than an accident."""
_METRES_IN_DEGREE = 1000.0
"""How many times shorter than the distances a site is that must be in degrees; 100,000 is common."""
_SCALE, _TURN, _FIT = 0.08, 0.25, 0.2
"""Scale less 1, turn (rad) and misfit over size of a network that another coordinate system may explain."""


def coordinate_system_cause(trials: Trials, system: PointSystem) -> GrossError | None:
    """A wrong coordinate system of all known points; None where something else is wrong."""
    found = trials.found
    known = np.flatnonzero(~found.points.is_free.all(axis=1) & found.points.has_coordinates)
    if clear := _in_degrees(found, system, known) or _of_another_area(found, system, known):
        return clear
    if len(known) < _LEAST_KNOWN or not _are_wrong_together(found, known):
        return None
    alone = estimated(trials.model, _on_two(found.points, known), found.book, QUICK)
    if alone is None or not trials.explains(alone):
        return None
    places = found.points.coordinates[known]
    change = _change(places, alone.coordinates[known], _map_scale(system, places))
    if change is None:
        return None
    scale, turn = change
    larger = f"{1e6 * scale:+.0f} ppm larger" if abs(scale) <= _SCALE else f"{1.0 + scale:.4g} times as large"
    text = (
        f"the observations agree with each other, and place them {larger} and turned by "
        f"{found.units.angle.text(turn)}: likely the coordinate system of the points "
        f"({system.system.definition}) or the frame is wrong: correct --points-crs or --frame"
    )
    return _together(found, known, text)


def _together(found: Estimate, known: IntArray, text: str) -> GrossError:
    names = tuple(found.points.names[row] for row in known.tolist())
    rows, size = tuple(found.suspects.tolist()), float(found.ratios.max())
    what = f"all {len(known)} known points together"
    return GrossError(what, Cause.COORDINATE_SYSTEM, text, size, rows, names)


def _in_degrees(found: Estimate, system: PointSystem, known: IntArray) -> GrossError | None:
    """Longitudes and latitudes that were taken for metres: nothing is as near as they seem to be."""
    observations, places = found.book.observations, found.points.coordinates[known, :2]
    lengths = np.sort(observations.values[distances_of(found.book)])
    if system.system.kind is not crs.Kind.LOCAL or len(known) < 2 or not len(lengths):
        return None
    width, largest = np.ptp(places, axis=0).max(), np.sort(np.abs(places).max(axis=0))
    are_angles = largest[0] <= 90.0 and largest[1] <= 180.0
    if not are_angles or not 0.0 < _METRES_IN_DEGREE * width < lengths[len(lengths) // 2]:
        return None
    text = (
        f"they lie within {found.units.length.text(float(width))} of each other, and the observations "
        "contradict that: likely longitudes and latitudes in degrees: say so (--points-crs EPSG:4326, or the "
        "system that they are in)"
    )
    return _together(found, known, text)


def _of_another_area(found: Estimate, system: PointSystem, known: IntArray) -> GrossError | None:
    """A system that is used elsewhere, where many observations contradict it: no trial is needed then."""
    if len(known) < 2 or not _are_many(found, known):
        return None
    given = system.coordinates(found.points.coordinates[known])
    exchanged = given[:, [1, 0, 2]]  # it may be that of points whose easting and northing are exchanged
    if not all(crs.outside_area(system.system, points).all() for points in (given, exchanged)):
        return None
    text = (
        f"they lie outside the area where {system.system.definition} is used, and the observations "
        "contradict them: likely it is not their coordinate system: correct --points-crs, or leave it out "
        "for a local site"
    )
    return _together(found, known, text)


def _are_many(found: Estimate, known: IntArray) -> bool:
    """Whether suspects are many of all observations, or of those at a known point."""
    rows, n = found.book.observations, len(found.book.point_names)
    counts = [
        np.bincount(ends[chosen], minlength=n)
        for chosen in (rows.active, found.suspects)
        for ends in (rows.from_points, rows.to_points)
    ]
    seen, wrong = counts[0] + counts[1], counts[2] + counts[3]
    is_many = len(found.suspects) >= _MANY * np.count_nonzero(rows.active)
    return bool(is_many or (wrong[known] >= np.maximum(_MANY_AT_ONE * seen[known], _LEAST_AT_ONE)).any())


def _are_wrong_together(found: Estimate, known: IntArray) -> bool:
    """Whether nearly all known points have suspects, and most observations at them are suspects."""
    observations, is_known = found.book.observations, np.zeros(len(found.points), np.bool_)
    is_known[known] = True
    ends = observations.from_points, observations.to_points
    at_known = (is_known[ends[0]] | is_known[ends[1]]) & observations.active
    wrong = at_known & (found.ratios > GROSS)
    touched = np.zeros(len(found.points), np.bool_)
    for points in ends:
        touched[points[wrong]] = True
    return bool(touched[known].mean() >= _NEARLY_ALL and wrong.sum() >= _MOST * at_known.sum())


def _on_two(points: Points, known: IntArray) -> Points:
    """The points with all known ones but two neighbours unknown."""
    places = points.coordinates[known]
    first = int(np.argmin(np.linalg.norm(places - np.median(places, axis=0), axis=1)))
    nearest = np.argsort(np.linalg.norm(places - places[first], axis=1), kind="stable")[:2]
    others = np.delete(known, nearest)
    coordinates, sigmas = points.coordinates.copy(), points.sigmas.copy()
    coordinates[others] = sigmas[others] = np.nan
    return replace(points, coordinates=coordinates, sigmas=sigmas)


def _map_scale(system: PointSystem, places: FloatArray) -> float:
    """How much larger the map is than the ground at places (k, 3): 1.6 for a web map at 52 degrees."""
    if system.system.is_geographic:
        return 1.0
    drawn = system.system.plan_unit.factor * system.coordinates(places)[:, :2]
    true = places[:, :2]
    return float(np.linalg.norm(drawn - drawn.mean(axis=0)) / np.linalg.norm(true - true.mean(axis=0)))


def _change(given: FloatArray, found: FloatArray, map_scale: float) -> tuple[float, float] | None:
    """Scale less 1 and angle from places (k, 3) to others; None when these are not their image.

    Coordinates of another map, placed by one that is `map_scale` times too large, are found that much larger.
    """
    is_there = np.isfinite(found).all(axis=1)
    a, b = given[is_there] - given[is_there].mean(axis=0), found[is_there] - found[is_there].mean(axis=0)
    if len(a) < _LEAST_KNOWN:
        return None
    rotation = closest_rotation(b.T @ a)
    turned = a @ rotation.T
    scale = float(np.sum(b * turned) / np.sum(a * a))
    misfit = float(np.linalg.norm(b - scale * turned) / np.linalg.norm(b))
    turn = float(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))
    is_of_map = min(abs(scale - 1.0), abs(scale / map_scale - 1.0)) <= _SCALE
    return (scale - 1.0, turn) if is_of_map and turn <= _TURN and misfit <= _FIT else None
