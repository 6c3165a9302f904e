"""Directions counted anticlockwise where only approximate coordinates tell: the network is a mirror image.

Without a third known point a network whose directions have the wrong sense fits as well as the right one. Its
points then lie as approximate coordinates do in a mirror; exchanged eastings and northings do the same.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.model import Points

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
