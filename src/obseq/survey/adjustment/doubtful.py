"""Points that converged, and of which the observations say next to nothing all the same."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.records.adjustment import DoubtfulRecord
from obseq.survey.initial.approximations import nearest_sights
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import codes_for
from obseq.survey.model import FieldBook

LEAST = 1.0
"""Standard deviation of a coordinate (m) below which no point is called doubtful."""
SHARE = 0.1
"""Of its nearest sight, as a standard deviation: beyond it the equations are no longer linear."""
CIRCLE = 0.03
"""Distance from a circle, in radii, below which a point is said to lie on it."""


def doubtful_points(
    book: FieldBook, names: Sequence[str], coordinates: FloatArray, rows: IntArray, sigmas: FloatArray
) -> Iterator[DoubtfulRecord]:
    """The points less precise than a tenth of their nearest sight, and than a metre.

    There the ellipse of a linear adjustment says little: the equations bend. It happens on the danger circle
    of a resection, and to heights that only the curvature of the Earth gives.

    Args:
        book: The observations.
        names: The points.
        coordinates: (n, 3) of all points, m, in axes at right angles.
        rows: (k,) the points that are asked for.
        sigmas: (k, 3) their standard deviations a priori, m.
    """
    lengths = nearest_sights(book, coordinates, rows)
    known = np.where(np.isfinite(sigmas), sigmas, 0.0)
    worst = known.max(axis=1, initial=0.0)
    for at in np.flatnonzero(worst > np.maximum(SHARE * lengths, LEAST)).tolist():
        row = int(rows[at])
        axis = "xyz"[int(known[at].argmax())]
        circle = tuple(names[target] for target in _on_circle(book, coordinates, row))
        yield DoubtfulRecord(names[row], axis, float(worst[at]), float(lengths[at]), circle)


def _on_circle(book: FieldBook, coordinates: FloatArray, row: int) -> list[int]:
    """The targets of a point's directions, where all of them and it lie on one circle."""
    targets = _targets(book, row, len(coordinates))
    if len(targets) < 3:
        return []
    return targets if _off_circle(coordinates[[row, *targets]]) < CIRCLE else []


def _targets(book: FieldBook, row: int, n: int) -> list[int]:
    """The points that directions are read to from a point, by name."""
    observations = book.observations
    read = np.isin(observations.types, codes_for(Start.HZ)) & (observations.from_points == row)
    found = np.unique(observations.to_points[read & observations.active])
    return [target for target in found.tolist() if target < n]


def _off_circle(places: FloatArray) -> float:
    """How far points (n, 3) are from one circle in their plane, in radii; infinite for a line."""
    centred = places - places.mean(axis=0)
    plan = centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T
    scale = float(np.abs(plan).max())
    if not (math.isfinite(scale) and scale):
        return math.inf
    plan = plan / scale
    columns = np.column_stack([2 * plan, np.ones(len(plan))])
    found, _, rank, _ = np.linalg.lstsq(columns, (plan**2).sum(axis=1), rcond=1e-6)
    radius = math.sqrt(max(found[2] + found[0] ** 2 + found[1] ** 2, 0.0))
    if rank < 3 or not radius:
        return math.inf
    return float(np.abs(np.linalg.norm(plan - found[:2], axis=1) / radius - 1.0).max())
