"""Soft constraints: unknowns observed directly, at given values with given sigmas."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.problem.unknowns import Kind, finite

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares.problem.unknowns import UnknownTable


class Prior:
    """Equations x = value +- sigma for blocks that are alike; an infinite sigma leaves a component out."""

    def __init__(
        self, table: UnknownTable, ids: ArrayLike, values: ArrayLike, sigmas: ArrayLike, group: str
    ) -> None:
        self.ids, kind, size = table.uniform(ids, "prior")
        if kind in (Kind.ROTATION, Kind.DIRECTION):
            raise InputError(f"prior: a {kind.label} takes no prior; freeze it, or observe its effect")
        self.group = group
        shape = (len(self.ids), size)
        given = finite(np.broadcast_to(np.asarray(values, dtype=np.float64), shape), shape, "prior, values")
        spread = _checked_sigmas(table, self.ids, np.asarray(sigmas, dtype=np.float64), shape)
        kept = np.isfinite(spread)
        self.scalars: IntArray = table.scalars(self.ids)[kept]
        self.values: FloatArray = given[kept]
        self.weights: FloatArray = 1.0 / spread[kept]

    @property
    def n_scalars(self) -> int:
        """Number of scalar equations."""
        return len(self.scalars)

    def residuals(self, values: FloatArray) -> FloatArray:
        """(n_scalars,) unknowns minus given values, for the vector of all unknowns."""
        return np.asarray(values[self.scalars] - self.values)

    def sum_of_squares(self, values: FloatArray) -> float:
        """Sum of squared residuals over sigmas."""
        return float(np.sum(np.square(self.residuals(values) * self.weights)))


@dataclass(frozen=True)
class Viscosity:
    """A pull of unknowns to their current values, anew at each iteration: it slows, and biases nothing.

    Attributes:
        scalars: (n,) positions of the unknowns.
        weights: (n,) inverse squares of the sigmas of a step.
    """

    scalars: IntArray
    weights: FloatArray

    @classmethod
    def of(cls, table: UnknownTable, ids: ArrayLike, sigmas: ArrayLike) -> Viscosity:
        """The viscosity of blocks that are alike; sigmas are a number, (n,) or (n, k), infinite for none."""
        blocks, _, size = table.uniform(ids, "viscosity")
        spread = _checked_sigmas(table, blocks, np.asarray(sigmas, dtype=np.float64), (len(blocks), size))
        return cls(table.scalars(blocks).ravel(), 1.0 / np.square(spread).ravel())


def _checked_sigmas(
    table: UnknownTable, ids: IntArray, sigmas: FloatArray, shape: tuple[int, int]
) -> FloatArray:
    if sigmas.ndim == 1 and sigmas.shape == shape[:1]:
        sigmas = sigmas[:, None]
    try:
        array = np.broadcast_to(sigmas, shape)
    except ValueError:
        raise InputError(f"prior: sigmas have shape {sigmas.shape}; expected {shape}") from None
    wrong = np.flatnonzero(~(array > 0.0).all(axis=1))
    if wrong.size:
        name = table.names[ids[wrong[0]]]
        raise InputError(f"prior of {name}: sigma must be positive, not {array[wrong[0]]}")
    return array
