"""Whether known points have stayed: both epochs formed by their observations alone, and fitted together.

Known coordinates that hold in both epochs a point that has moved bend all the others. What the observations
alone say of the known points does not depend on that.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.errors import ObseqError
from obseq.stopwatch import Stopwatch
from obseq.survey.adjustment.computation import Computation
from obseq.survey.adjustment.datum import Datum, DatumKind, freed, without_azimuths
from obseq.survey.adjustment.inner import require_whole
from obseq.survey.adjustment.quality import Quality
from obseq.survey.epochs.common_knowledge import SAME
from obseq.survey.epochs.grounds import fits
from obseq.survey.equations.frame import Frame
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.initial.initial_values import values_by
from obseq.survey.initial.left_out import Determined
from obseq.survey.model import join
from obseq.survey.sights.kept_graphs import Graphs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.model import Points

ITERATIONS = 25
TOLERANCE = 1e-6


def known_points(epochs: Sequence[Adjustment], names: Sequence[str]) -> tuple[str, ...]:
    """Those of the names of which both epochs hold, or tie, a coordinate, and the same ones alike."""
    one, two = map(_given, epochs)
    return tuple(name for name in names if name in one and name in two and _is_one(one[name], two[name]))


def by_observations(epoch: Adjustment, names: Sequence[str]) -> Adjustment | None:
    """An epoch on inner constraints of known points, which are free; None where that determines no network.

    Args:
        epoch: As adjusted with its known coordinates.
        names: The known points.
    """
    computation = _computation(epoch)
    points, book = epoch.points.points, without_azimuths(epoch.book)[0]
    places = np.where(_known(points)[:, None], points.coordinates, epoch.points.places)
    free, book = join(freed(_released(points), places, Datum(DatumKind.INNER, tuple(names))), book)
    try:
        frame = computation.frame
        start = Determined(free, book, values_by(Graphs(frame.bend), free, book, frame.plumb))
        start.initial.require_complete()
        found = computation.determined(start, strict=True)
        require_whole(found.undetermined)
    except ObseqError:
        return None
    # observations that agree with one another hold no gross error: they contradicted the known coordinates
    diagnosis = None if fits(found) else epoch.diagnosis
    return replace(found, diagnosis=diagnosis, left_out=epoch.left_out, shown=epoch.shown)


def _computation(epoch: Adjustment) -> Computation:
    system, given = crs.parse(epoch.frame), crs.parse(epoch.points_crs)
    frame = Frame(system) if epoch.refraction is None else Frame(system, epoch.refraction)
    return Computation(frame, given, None, ITERATIONS, TOLERANCE, Stopwatch(), Quality())


def _given(epoch: Adjustment) -> dict[str, FloatArray]:
    """(3,) coordinates of the known points by name, m in their system; NaN for those that are free."""
    points = epoch.points.points
    rows = np.flatnonzero(_known(points))
    system = PointSystem(crs.parse(epoch.frame), crs.parse(epoch.points_crs))
    there, _, metres = system.coordinates_and_axes(points.coordinates[rows])
    is_given = ~points.is_free[rows] & ~points.is_held.all(axis=0)
    found = np.where(is_given, there * metres, np.nan)
    return {points.names[row]: found[k] for k, row in enumerate(rows.tolist())}


def _is_one(first: FloatArray, second: FloatArray) -> bool:
    """Whether some component is given in both, and all of these are the same."""
    apart = np.abs(first - second)
    return bool(np.isfinite(apart).any() and (np.isnan(apart) | (apart < SAME)).all())


def _known(points: Points) -> BoolArray:
    """(n,) true for points that rest on coordinates of their own, and not on what is held of all."""
    sought = ~points.is_held.all(axis=0)
    return np.asarray((~points.is_free & sought).any(axis=1))


def _released(points: Points) -> Points:
    """The points with nothing held but what is held of all of them (the plan of a levelling)."""
    sigmas = np.where(points.is_held.all(axis=0), points.sigmas, np.nan)
    return replace(points, sigmas=sigmas, covariance=None)
