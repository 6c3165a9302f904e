"""Directions counted anticlockwise where only approximate coordinates tell: the network is a mirror image.

Without a third known point a network whose directions have the wrong sense fits as well as the right one. Its
points then lie as approximate coordinates do in a mirror; exchanged eastings and northings do the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE, codes_where
from obseq.survey.screening.beyond_nadir import put_right
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.robust import WHOLE
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from obseq.survey.initial.initial_values import InitialValues
    from obseq.survey.model import FieldBook, Points
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]
    Complex = npt.NDArray[np.complex128]

_LEAST = 3
"""Points that must have been replaced."""
_FIT, _BETTER = 0.25, 0.5
"""Misfit of a mirror image, over the size of the network, and over the misfit of an image that is none."""
_SCALES = 0.5, 2.0
_SENSE = "directions look like counted anticlockwise, or easting and northing of the points are exchanged"


def mirror_warning(points: Points, initial: InitialValues) -> tuple[str, ...]:
    """A sentence where observations place points as approximate coordinates lie in a mirror; else none."""
    if not _is_mirrored(points, initial):
        return ()
    return (
        f"the observations place {len(initial.replaced)} points as their approximate coordinates lie in a "
        f"mirror: {_SENSE}; correct that, the adjusted network is a mirror image",
    )


def mirrored_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """Directions counted anticlockwise, where approximate coordinates tell, with the network put right."""
    found = trials.found
    if not _is_mirrored(found.points, trials.model.initial(found.points, found.book)):
        return None
    turned, north = (_of_plan(found.book, is_from_north=north) for north in (False, True))
    for rows in (turned, np.concatenate([turned, north])) if len(north) else (turned,):
        right = estimated(trials.model, found.points, put_right(found.book, rows), WHOLE)
        if right and right.suspects.size <= found.suspects.size and right.lost <= found.lost:
            return _described(found, np.sort(rows)), right
    return None


def _described(found: Estimate, rows: Rows) -> GrossError:
    kinds = dict.fromkeys(BY_CODE[code].name for code in found.book.observations.types[rows].tolist())
    first = found.book.label(int(rows[0]))
    what = f"all {len(rows)} {' and '.join(kinds)} observations (the first: {first})"
    text = f"they place the points as their approximate coordinates lie in a mirror: {_SENSE}"
    return GrossError(what, Cause.SENSE, text, float(found.ratios.max()), tuple(rows.tolist()))


def _of_plan(book: FieldBook, *, is_from_north: bool) -> Rows:
    """The active directions and angles in plan, those from north or the others."""
    codes = codes_where(
        lambda kind: kind.start in (Start.HZ, Start.ANGLE) and kind.is_from_north == is_from_north
    )
    return np.flatnonzero(book.observations.active & np.isin(book.observations.types, codes))


def _is_mirrored(points: Points, initial: InitialValues) -> bool:
    """Whether points lie in plan as approximate coordinates that were replaced do in a mirror."""
    if len(initial.replaced) < _LEAST:
        return False
    places = points.coordinates[:, :2], initial.coordinates[:, :2]
    seen = np.isfinite(places[0]).all(axis=1) & np.isfinite(places[1]).all(axis=1)
    given, found = (xy[seen, 0] + 1j * xy[seen, 1] for xy in places)
    scale, mirrored = _misfit(given.conj(), found)
    return mirrored <= min(_FIT, _BETTER * _misfit(given, found)[1]) and _SCALES[0] <= scale <= _SCALES[1]


def _misfit(given: Complex, found: Complex) -> tuple[float, float]:
    """Scale and misfit, over the size of the network, of the best image of places in the complex plane."""
    start, end = given - given.mean(), found - found.mean()
    sizes = np.vdot(start, start).real, np.vdot(end, end).real
    if not min(sizes):
        return 0.0, 1.0
    factor = np.vdot(start, end) / sizes[0]
    return float(np.abs(factor)), float(np.linalg.norm(end - factor * start) / sizes[1] ** 0.5)
