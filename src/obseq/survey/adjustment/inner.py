"""Precisions with the datum of inner constraints in place of the known points: Comp3D's second step.

The adjustment is done with the known points; then the covariances alone are computed anew, as if no point
were known and all points together carried the datum. They say how well the network knows its own shape,
whatever its known points are worth.

No row of the normal equations joins all points: points are held loosely, and what the loose hold alone
determines (translations, rotations, the scale) is taken out of the covariances by an S-transformation, which
needs one solve for each.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.statistics.final_state import final_state
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points

DATUM_KINDS = ("Azim",)
"""Kinds that say where a network is and no more, besides observed coordinates."""

LOOSE = 10.0
"""Sigma (m) of the loose hold: 1e-6 of the variances of points known to a centimetre."""

FREE = 0.01
"""Share of the precision that the loose hold alone would give from which a motion counts as undetermined."""

DEPENDENT = 1e-12
"""Squared length of what is left of a motion that the others before it contain."""


def inner_covariances(
    equations_of: Callable[[Determined], Equations], start: Determined, adjusted: Equations
) -> FloatArray:
    """(n, 3, 3) covariances of points with the given sigmas, in the frame (m^2).

    Known coordinates and azimuths are dropped; of points that are held in part (levelled points in a
    network of heights) what is held stays so.

    Args:
        equations_of: The equations of a network.
        start: The adjusted network, with its initial values.
        adjusted: Its equations, at their solution.

    Raises:
        SingularSystemError: Something besides the datum is undetermined.
    """
    coordinates = adjusted.system.values(adjusted.points)
    points = _freed(start.points, coordinates)
    initial = replace(start.initial, coordinates=coordinates)
    equations = equations_of(replace(start, points=points, book=_inner_book(start.book), initial=initial))
    system = equations.system
    system.unknowns.restore(adjusted.system.unknowns.state())
    system.add_prior(equations.points, coordinates, LOOSE)
    solution = system.solve(max_iterations=0, covariance=True)
    state = final_state(system, solution)
    numbers = state.equations.free.number[state.equations.table.scalars(equations.points)]
    motions = _motions(coordinates, numbers >= 0)
    sides = np.zeros((state.equations.n_unknowns, motions.shape[2]))
    sides[numbers[numbers >= 0]] = motions[numbers >= 0]
    moved = np.where((numbers >= 0)[:, :, None], state.solve(sides)[np.maximum(numbers, 0)], 0.0)
    return _transformed(solution.covariance(equations.points, a_priori=True), motions, moved)


def _freed(points: Points, coordinates: FloatArray) -> Points:
    """The points with nothing known; what is held of points that are held in part stays so."""
    held = points.is_held & ~points.is_held.all(axis=1, keepdims=True)
    sigmas = np.where(held, 0.0, np.nan)
    return replace(points, coordinates=coordinates, sigmas=sigmas, datum=None, covariance=None)


def _inner_book(book: FieldBook) -> FieldBook:
    """The observations without those that say where the network is."""
    codes = [kind.code for kind in BY_CODE.values() if kind.is_absolute or kind.name in DATUM_KINDS]
    return book.without(np.isin(book.observations.types, codes))


def _motions(coordinates: FloatArray, is_free: BoolArray) -> FloatArray:
    """(n, 3, k) what three translations, three rotations and the scale do to free coordinates, normalised."""
    x, y, z = (coordinates - coordinates.mean(axis=0)).T
    none, one = np.zeros_like(x), np.ones_like(x)
    rows = [(one, none, none), (none, one, none), (none, none, one)]
    rows += [(y, -x, none), (none, z, -y), (-z, none, x), (x, y, z)]
    motions = np.where(is_free[:, :, None], np.array(rows).transpose(2, 1, 0), 0.0)
    lengths = np.sqrt(np.square(motions).sum(axis=(0, 1)))
    return np.asarray(motions[:, :, lengths > 0.0] / lengths[lengths > 0.0])


def _transformed(covariances: FloatArray, motions: FloatArray, moved: FloatArray) -> FloatArray:
    """The covariances without those motions (n, 3, k) that the loose hold alone determines.

    Args:
        covariances: (n, 3, 3) with the loose hold.
        motions: (n, 3, k) normalised.
        moved: (n, 3, k) the whole covariance matrix times the motions.
    """
    lengths = np.einsum("nck,ncl->kl", motions, motions)
    variances = np.einsum("nck,ncl->kl", motions, moved)
    chosen = _undetermined(lengths, variances)
    motions, moved = motions @ chosen, moved @ chosen
    crossed = moved @ motions.transpose(0, 2, 1)
    both = motions @ (chosen.T @ variances @ chosen) @ motions.transpose(0, 2, 1)
    return np.asarray(covariances - crossed - crossed.transpose(0, 2, 1) + both)


def _undetermined(lengths: FloatArray, variances: FloatArray) -> FloatArray:
    """(k, f) combinations of motions, orthonormal, that only the loose hold determines; in their order.

    Args:
        lengths: (k, k) products of the motions.
        variances: (k, k) covariances of their amounts.
    """
    found = np.zeros((len(lengths), 0))
    for one in np.eye(len(lengths)):
        rest = one - found @ (found.T @ lengths @ one)
        square = float(rest @ lengths @ rest)
        if square > DEPENDENT and rest @ variances @ rest > square * (FREE * LOOSE) ** 2:
            found = np.column_stack([found, rest / np.sqrt(square)])
    return found
