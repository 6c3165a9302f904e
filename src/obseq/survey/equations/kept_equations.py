"""Equations that are made once for networks that differ in nothing but numbers: those of trials.

What a trial changes (values, sigmas, coordinates, which observations count) changes neither the unknowns nor
who is in which equation. For a small network these take longer to build and to analyse than an iteration.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from obseq.arrays import Array, BoolArray
from obseq.survey.equations.equations import Equations
from obseq.survey.initial.left_out import Determined
from obseq.survey.model import Observations, Points

_OF_EQUATIONS = ("types", "from_points", "to_points", "stations", "groups", "backsights")
"""Columns of the observations from which it follows who is in which equation."""
_MOST, _LARGE = 6, 5000
"""Equations that are kept of networks up to so many observations."""


class KeptEquations:
    """The equations of networks, one after the other: those before, with the numbers of others like them.

    Equations that it has given are not to be used any more once it gives the next ones.

    Args:
        make: a network with its initial values -> its equations.
    """

    def __init__(self, make: Callable[[Determined], Equations]) -> None:
        self._make = make
        self._kept: list[tuple[Determined, Equations]] = []

    def __call__(self, start: Determined) -> Equations:
        """The equations of a network, at its initial values."""
        for place, (first, equations) in enumerate(self._kept):
            if _have_same_equations(first, start):
                equations.restart(start.points, start.book, start.initial)
                self._kept.insert(0, self._kept.pop(place))
                return equations
        made = self._make(start)
        if not len(made.shared):
            self._keep(start, made)
        return made

    def _keep(self, start: Determined, made: Equations) -> None:
        """Keeps equations, the last ones first; of a large network, whose equations are, no others beside."""
        most = _MOST if len(start.book.observations) <= _LARGE else 1
        if most > 1 or not self._kept:
            self._kept = [(start, made), *self._kept[: most - 1]]


def _have_same_equations(first: Determined, other: Determined) -> bool:
    """Whether two networks differ in numbers only, and in observations that do not count in the other."""
    return (
        _are_alike(first.points, other.points)
        and np.array_equal(first.initial.orientations, other.initial.orientations)
        and _are_equal(first.book.stations.origins, other.book.stations.origins)
        and _are_equal(first.book.stations.orientations, other.book.stations.orientations)
        and not (first.book.clusters or other.book.clusters)
        and first.book.groups == other.book.groups
        and _count_alike(first.book.observations, other.book.observations)
    )


def _are_alike(first: Points, other: Points) -> bool:
    """Whether the same components of the same points are free, known or held, and nothing else is known."""
    parts = (first.datum, other.datum, first.covariance, other.covariance)
    return (
        all(part is None for part in parts)
        and first.names == other.names
        and (first.sigmas is other.sigmas or _are_known_alike(first, other))
        and _are_equal(first.deflections, other.deflections)
    )


def _are_known_alike(first: Points, other: Points) -> bool:
    """Whether the same components are free, the same held, and the same unknown."""
    parts = ("is_free", "is_held", "is_unknown")
    return all(np.array_equal(getattr(first, part), getattr(other, part)) for part in parts)


def _count_alike(first: Observations, other: Observations) -> bool:
    """Whether observations are between the same points, heights in the same places, and none counts more."""
    return (
        all(_are_equal(getattr(first, name), getattr(other, name)) for name in _OF_EQUATIONS)
        and (_share_heights(first, other) or np.array_equal(_has_heights(first), _has_heights(other)))
        and (other.active is first.active or not (other.active & ~first.active).any())
    )


def _share_heights(first: Observations, other: Observations) -> bool:
    return first.from_heights is other.from_heights and first.to_heights is other.to_heights


def _has_heights(rows: Observations) -> BoolArray:
    """(n,) whether instruments or targets of observations have a height."""
    return np.asarray((rows.from_heights != 0.0) | (rows.to_heights != 0.0))


def _are_equal(first: Array, other: Array) -> bool:
    """Whether two columns hold the same; most often they are the same one."""
    return first is other or np.array_equal(first, other, equal_nan=first.dtype.kind == "f")
