"""Known points in a wrong coordinate system, where GNSS vectors say how the network lies on the Earth.

Vectors have the axes of the Earth: from one known point they place all others. In another zone of a map these
are where they would be some degrees further east or west: turned about the axis of the Earth, nothing else.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import ObseqError
from obseq.geometry import closest_rotation
from obseq.survey.kinds.kind import FirstPlace
from obseq.survey.kinds.registry import codes_placed_by
from obseq.survey.screening.findings import Cause, GrossError

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.screening.robust import Estimate, Model
    from obseq.survey.screening.trials import Trials

_FIT = 0.02
"""Misfit of any two points, over their distance, that a turn may leave, as a share of it."""
_ZONE_FIT = 3e-5
"""Misfit, over the size of a network, that a turn about the axis of the Earth may leave."""
_LEAST_ZONE, _TURNS = math.radians(0.5), (math.radians(0.1), math.radians(90.0))
"""Turns (rad) from which a zone is thought of, and between which a system is."""
_SCALE = 0.02
"""Scale less 1 of a system that a map may have."""
_LEAST_KNOWN = 3
"""Known points from which a turn about any axis says something."""


def vector_system_cause(trials: Trials, system: PointSystem) -> GrossError | None:
    """A wrong coordinate system of the known points, which vectors turn as one; None where they do not."""
    found = trials.found
    known = np.flatnonzero((~found.points.is_free & np.isfinite(found.points.coordinates)).all(axis=1))
    if len(known) < 2 or not np.isin(found.book.observations.types, codes_placed_by(FirstPlace.VECTOR)).any():
        return None
    placed = _placed_from_one(trials.model, found, known)
    if placed is None:
        return None
    rotation, _ = system.frame.geocentric_pose()
    given = found.points.coordinates[known]
    apart = [(places - places[0])[1:] @ rotation.T for places in (given, placed)]
    told = _of_zone(*apart) or (_of_system(found, *apart) if len(known) >= _LEAST_KNOWN else "")
    if not told:
        return None
    names = tuple(found.points.names[row] for row in known.tolist())
    text = (
        f"{told}: likely the coordinate system of the points ({system.system.definition}) is wrong: correct "
        "--points-crs"
    )
    rows, size = tuple(found.suspects.tolist()), float(found.ratios.max())
    what = f"{'both' if len(known) == 2 else f'all {len(known)}'} known points together"
    return GrossError(what, Cause.COORDINATE_SYSTEM, text, size, rows, names)


def _placed_from_one(model: Model, found: Estimate, known: IntArray) -> FloatArray | None:
    """(k, 3) known points as observations place them from the first one; None where they do not."""
    coordinates, sigmas = found.points.coordinates.copy(), found.points.sigmas.copy()
    coordinates[:] = sigmas[known[1:]] = np.nan
    coordinates[known[0]] = found.points.coordinates[known[0]]
    try:
        points = replace(found.points, coordinates=coordinates, sigmas=sigmas, covariance=None)
        placed = model.initial(points, found.book).coordinates[known]
    except ObseqError:
        return None
    return placed if np.isfinite(placed).all() else None


def _of_zone(given: FloatArray, placed: FloatArray) -> str:
    """By how much geocentric steps (k, 3) are turned about the axis of the Earth, in words; empty if not."""
    across = np.sum(given[:, 0] * placed[:, 1] - given[:, 1] * placed[:, 0])
    turn = math.atan2(float(across), float(np.sum(given[:, :2] * placed[:, :2])))
    cos, sin = math.cos(turn), math.sin(turn)
    turned = given @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    if abs(turn) < _LEAST_ZONE or np.linalg.norm(placed - turned) > _ZONE_FIT * np.linalg.norm(placed):
        return ""
    where = "east" if turn > 0.0 else "west"
    return (
        f"the vectors fit them {abs(math.degrees(turn)):.2f} degrees further {where}, which is another zone "
        "of the projection"
    )


def _of_system(found: Estimate, given: FloatArray, placed: FloatArray) -> str:
    """By how much geocentric steps (k, 3) are turned about any axis, in words; empty if they are not."""
    rotation = closest_rotation(placed.T @ given)
    turned = given @ rotation.T
    scale = float(np.sum(placed * turned) / np.sum(given * given))
    turn = float(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))
    steps, gaps = (np.concatenate([one, np.diff(one, axis=0)]) for one in (placed, placed - scale * turned))
    misfit = np.max(np.linalg.norm(gaps, axis=1) / np.maximum(np.linalg.norm(steps, axis=1), 1e-3))
    if abs(scale - 1.0) > _SCALE or not _TURNS[0] <= turn <= _TURNS[1] or misfit > _FIT * turn:
        return ""
    larger = f"{1e6 * abs(scale - 1.0):.0f} ppm {'larger' if scale > 1.0 else 'smaller'}"
    return f"the vectors place them turned by {found.units.angle.text(turn)} and {larger}"
