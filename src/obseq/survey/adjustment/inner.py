"""Precisions with the datum of inner constraints in place of the known points: Comp3D's second step.

The adjustment is done with the known points; then the covariances alone are computed anew, as if no point
were known and all points together carried the datum. They say how well the network knows its own shape,
whatever its known points are worth: the pseudo-inverse, on the coordinates of the points, of what the
observations alone say.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.errors import SingularSystemError
from obseq.leastsquares.diagnosis.free_motions import COMBINED, SHAPE
from obseq.printable import listed
from obseq.records.adjustment import MotionRecord
from obseq.survey.adjustment.singular import free_motions
from obseq.survey.equations.equations import Equations
from obseq.survey.initial.left_out import Determined
from obseq.survey.kinds.registry import codes_where
from obseq.survey.model import FieldBook, Points

NONE = "no precisions of inner constraints: without the known coordinates and the azimuths, "
"""How the reasons begin for which there are none."""

LISTED = 8
"""Names given in a message before it says how many more there are."""


def inner_covariances(
    equations_of: Callable[[Determined], Equations], start: Determined, adjusted: Equations
) -> FloatArray:
    """(n, 3, 3) covariances of points with the given sigmas, in the frame (m^2).

    Known coordinates and azimuths are dropped; of points that are held in part (levelled points in a
    network of heights) what is held stays so. A point that is not observed otherwise has NaN.

    Args:
        equations_of: The equations of a network whose points are given in the frame.
        start: The adjusted network, with its initial values.
        adjusted: Its equations, at their solution.

    Raises:
        SingularSystemError: Something besides the datum is undetermined, or nothing is observed.
    """
    coordinates = adjusted.system.values(adjusted.points)
    initial, book = replace(start.initial, coordinates=coordinates), _inner_book(start.book)
    observed = book.counts(book.observations.active, len(start.points)) > 0
    if not observed.any():
        raise SingularSystemError(f"{NONE}nothing is observed", ())
    points = _freed(start.points, coordinates, observed)
    equations = equations_of(replace(start, points=points, book=book, initial=initial))
    equations.system.unknowns.restore(adjusted.system.unknowns.state())
    solution = equations.system.solve(max_iterations=0, covariance=True)
    require_whole(free_motions(equations, points.names))
    covariances = solution.covariance(equations.points, a_priori=True)
    return np.where(observed[:, None, None], covariances, np.nan)


def _freed(points: Points, coordinates: FloatArray, observed: BoolArray) -> Points:
    """The points with nothing known, all carrying the datum; what is held of points held in part stays so.

    Those that are not observed (a mask) have no part.
    """
    invented = points.is_free & points.is_invented
    held = points.is_held & ~points.is_held.all(axis=1, keepdims=True) | ~observed[:, None] | invented
    sigmas = np.where(held, 0.0, np.nan)
    return replace(points, coordinates=coordinates, sigmas=sigmas, datum=~held, covariance=None)


def _inner_book(book: FieldBook) -> FieldBook:
    """The observations without those that say where the network is."""
    codes = codes_where(lambda kind: kind.is_absolute or kind.is_from_north)
    return book.without(np.isin(book.observations.types, codes))


def require_whole(motions: Sequence[MotionRecord]) -> None:
    """Raises the error of a singular system where the observations leave more free than a datum gives.

    Each of several parts that nothing joins has motions of its own, called alike.
    """
    counts = Counter(motion.text for motion in motions if motion.text != COMBINED)
    beyond = [motion for motion in motions if motion.text == SHAPE or counts[motion.text] > 1]
    if beyond:
        names = list(dict.fromkeys(name for motion in beyond for name in motion.points))
        raise SingularSystemError(
            f"{NONE}the observations do not determine the shape of the network at {listed(names, LISTED)}",
            tuple(f"{name}.{axis}" for name in names for axis in "xyz"),
        )
