"""What else could be wrong: observations and known coordinates whose error would look the same.

Baarda's w of all equations of a network with one error are w_j = rho_ij w_i, rho_ij the correlation of their
residuals: an equation j explains an error of size T in i but for T^2 (1 - rho_ij^2), which chi-square judges.
In a loop, or between two benchmarks, all correlations are 1 and nothing tells its observations apart. The
correlations are taken from the network as it was estimated, free of noise, with a small error in i alone.
Source: W. Baarda, A testing procedure for use in geodetic networks, Delft 1968.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import ObseqError
from obseq.survey.adjustment.known_coordinates import GROUP
from obseq.survey.adjustment.quality import numbers, of_observations
from obseq.survey.kinds.registry import IS_ANGLE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.leastsquares import LeastSquaresResult
    from obseq.leastsquares.statistics.reliability import Reliability
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.model import FieldBook, Points
    from obseq.survey.screening.robust import Estimate, Model

_PLANTED = 100.0
"""Size of the error, in sigmas, with which correlations are found: its effects are linear."""
_SAME = 25.0
"""Weighted squares by which one explanation must be worse than another to be told from it: five sigmas."""
_LARGEST = 1e3
"""Size, in sigmas, beyond which an error tells explanations no better apart: effects are linear roughly."""
_DIGITS = 1
"""Decimals of such squares that count: explanations that are as good come in the order of the files."""
_STIFF = 0.01
"""Sigma of coordinates that are held, as a share of the smallest sigma of a length."""
_ITERATIONS = 8


@dataclass(frozen=True)
class Alternative:
    """An observation or a known coordinate whose error would explain the same misfits.

    Attributes:
        row: of the observation; -1 for a known coordinate.
        point: row of the point whose coordinate it is; -1 for an observation.
        component: 0, 1 or 2: which coordinate.
        off: by how much it would be too large (m, rad).
        sigma: standard deviation of that (m, rad).
    """

    row: int
    point: int
    component: int
    off: float
    sigma: float


@dataclass(frozen=True, eq=False)
class Tested:
    """A network, adjusted by least squares and tested.

    Attributes:
        found: the network it was made from.
        points: what remains of its points.
        equations: its equations.
        solution: what they give.
        quality: the tests.
    """

    found: Estimate
    points: Points
    equations: Equations
    solution: LeastSquaresResult
    quality: Reliability

    @property
    def explanations(self) -> list[tuple[float, Alternative]]:
        """What may be wrong, with the test of its equation (w)."""
        return [*_observations(self), *_coordinates(self)]

    def of_observations(self, name: str) -> FloatArray:
        """(n,) one of the numbers of the observations."""
        return of_observations(self.equations, self.quality, name, len(self.found.book.observations))

    def of_coordinates(self, name: str) -> FloatArray:
        """(k,) one of the numbers of the known coordinates."""
        parts = [part for part in self.quality.observations if part.source.group == GROUP]
        return np.concatenate([np.zeros(0), *(numbers(part, name) for part in parts)])


def alternatives(model: Model, found: Estimate, row: int, suspects: list[int]) -> list[Alternative]:
    """What explains the misfit of an observation as well as its own error, itself included, the best first.

    Args:
        model: how initial values and equations are made.
        found: the network.
        row: the observation.
        suspects: observations that contradict the others, which say nothing about it.
    """
    try:
        points, book = _exact_points(found), _exact_book(found, row, suspects)
        tested = adjusted(model, found, points, book)
    except ObseqError:
        return []
    w, redundancy = tested.of_observations("w"), tested.of_observations("redundancy")
    if not abs(w[row]) > 0.0:
        return []
    size = float(found.ratios[row]) * float(redundancy[row]) ** 0.5 / found.scale
    scale = float(found.ratios[row]) / _PLANTED
    same = as_good(tested.explanations, float(w[row]), size)
    return [replace(item, off=scale * item.off) for item in same]


def as_good(every: list[tuple[float, Alternative]], w: float, size: float) -> list[Alternative]:
    """What explains an error of a size, in sigmas, as well as the equation of test w, the best first."""
    size = min(abs(size), _LARGEST)
    losses = [(size**2 * (1.0 - min(1.0, (one / w) ** 2)), item) for one, item in every]
    same = sorted((pair for pair in losses if pair[0] <= _SAME), key=lambda pair: round(pair[0], _DIGITS))
    return [item for _, item in same]


def adjusted(model: Model, found: Estimate, points: Points, book: FieldBook) -> Tested:
    """The network with other points or observations, adjusted and tested.

    Raises:
        ObseqError: nothing of it can be computed.
    """
    from obseq.leastsquares.statistics.reliability import reliability

    start = model.start(points, book)
    equations = model.equations(start)
    solution = equations.system.solve(
        max_iterations=_ITERATIONS, before_iteration=equations.follow, covariance=True
    )
    return Tested(found, start.points, equations, solution, reliability(equations.system, solution))


def _exact_points(found: Estimate) -> Points:
    """The points where they were found."""
    located = np.asarray(np.isfinite(found.coordinates).all(axis=1))
    return stiff(found, np.where(located[:, None], found.coordinates, found.points.coordinates))


def stiff(found: Estimate, coordinates: FloatArray) -> Points:
    """The points at some coordinates, those that are held as known ones that hardly give way."""
    points = found.points
    lengths = np.asarray(found.book.observations.active & ~IS_ANGLE[found.book.observations.types])
    smallest = float(np.min(found.book.observations.sigmas[lengths], initial=1e-3))
    sigmas = np.where(points.is_held, _STIFF * smallest, points.sigmas)
    return replace(points, coordinates=coordinates, sigmas=sigmas)


def _exact_book(found: Estimate, row: int, suspects: list[int]) -> FieldBook:
    """The observations without noise, and without suspects but one, which has a small error."""
    values = np.where(np.isfinite(found.misfits), found.computed, found.book.observations.values)
    values[row] -= found.misfits[row] * _PLANTED / found.ratios[row]
    left_out = np.isnan(found.misfits)
    left_out[[other for other in suspects if other != row]] = True
    observations = replace(found.book.observations, values=values)
    return replace(found.book, observations=observations).without(left_out)


def _observations(tested: Tested) -> Iterator[tuple[float, Alternative]]:
    """W of the observations that others control, and what their errors would be."""
    names = ("w", "left_out_residuals", "redundancy")
    w, misfits, redundancy = (tested.of_observations(name) for name in names)
    sigmas = tested.equations.fitted(tested.solution)[1]
    for row in np.flatnonzero(np.isfinite(w) & (redundancy > 0.0)).tolist():
        spread = float(sigmas[row] / redundancy[row] ** 0.5)
        yield float(w[row]), Alternative(row, -1, -1, -float(misfits[row]), spread)


def _coordinates(tested: Tested) -> Iterator[tuple[float, Alternative]]:
    """The same of the known coordinates."""
    w, misfits, redundancy, sigmas = (
        tested.of_coordinates(name) for name in ("w", "left_out_residuals", "redundancy", "sigmas")
    )
    known = tested.equations.known.residuals(tested.solution)
    for k in np.flatnonzero(np.isfinite(w)).tolist():
        point = tested.found.points.index[tested.points.names[int(known.points[k])]]
        spread = float(sigmas[k] / redundancy[k] ** 0.5)
        yield float(w[k]), Alternative(-1, point, int(known.components[k]), -float(misfits[k]), spread)
