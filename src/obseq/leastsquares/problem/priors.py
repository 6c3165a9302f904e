"""Soft constraints: unknowns observed directly, at given values with given sigmas."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import finite, frozen, real, text
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.problem.weights import root_weights


class Prior:
    """Equations x = value +- sigma for blocks that are alike; an infinite sigma leaves a component out.

    Attributes:
        ids: the blocks.
        scalars: (n_scalars,) positions of the unknowns concerned.
        values: (n_scalars,) given values.
        weights: (n_scalars,) inverse sigmas.
    """

    __slots__ = ("_group", "_kept", "_sigmas", "_table", "_values", "ids", "scalars", "weights")

    def __init__(
        self, table: UnknownTable, ids: ArrayLike, values: ArrayLike, sigmas: ArrayLike, group: str
    ) -> None:
        self.ids, manifold, size = table.uniform(ids, "prior")
        if not manifold.is_flat:
            raise InputError(f"prior: a {manifold.label} takes no prior; freeze it, or observe its effect")
        self._table = table
        self._group = text(group, "prior, group")
        shape = (len(self.ids), size)
        given = finite(_stretched(values, shape, "prior: values"), shape, "prior: values")
        spread = _checked_sigmas(table, self.ids, sigmas, shape)
        self._kept: BoolArray = np.isfinite(spread)
        kept = self._kept
        self.scalars: IntArray = table.consecutive(self.ids, size)[kept]
        self.values = given[kept]
        self.sigmas = spread[kept][:, None]

    @property
    def name(self) -> str:
        """What it is called in messages."""
        return self._group

    @property
    def group(self) -> str:
        """Name under which sums of squares are kept."""
        return self._group

    @property
    def values(self) -> FloatArray:
        """(n_scalars,) given values; new ones may be (n, k) as well, as they were added."""
        return self._values

    @values.setter
    def values(self, new: ArrayLike) -> None:
        given = self._flat(new, "values")
        self._values: FloatArray = frozen(finite(given, (self.n_scalars,), "prior: values"))

    @property
    def sigmas(self) -> FloatArray:
        """(n_scalars, 1) given standard deviations; new ones may be (n, k) as well, as they were added."""
        return self._sigmas

    @sigmas.setter
    def sigmas(self, new: ArrayLike) -> None:
        flat = self._flat(new, "sigmas")
        column = flat[:, None] if flat.shape == (self.n_scalars,) else flat
        given = np.array(_stretched(column, (self.n_scalars, 1), "prior: sigmas"))
        is_right = np.isfinite(given) & (given > 0.0)
        if not is_right.all():
            row = int(is_right.argmin())
            raise InputError(f"{self.label(row)}: sigma must be positive, not {given[row, 0]}")
        self._sigmas: FloatArray = frozen(given)
        self.weights: FloatArray = root_weights(given, self.active)[:, 0]

    def _flat(self, new: ArrayLike, what: str) -> FloatArray:
        """Those of the components that have an equation, of numbers (n, k) for all; others as they are."""
        given = real(new, f"prior: {what}")
        if given.shape == self._kept.shape:
            return np.asarray(given[self._kept])
        if given.ndim and given.shape not in ((self.n_scalars,), (self.n_scalars, 1)):
            raise InputError(
                f"prior: {what} have shape {given.shape}; expected {self._kept.shape}, a row for each block, "
                f"or ({self.n_scalars},), without the components that have an infinite sigma"
            )
        return given

    @property
    def n_scalars(self) -> int:
        """Number of scalar equations."""
        return len(self.scalars)

    @property
    def active(self) -> BoolArray:
        """(n_scalars,) True: all of them have influence."""
        return np.ones(self.n_scalars, dtype=bool)

    @property
    def is_correlated(self) -> bool:
        """False."""
        return False

    def times_weights(self, factors: FloatArray) -> FloatArray:
        """(n_scalars,) factors (n_scalars, 1) times the weights."""
        return self.weights * factors[:, 0]

    def label(self, row: int) -> str:
        """What to call one equation in a message."""
        return f"{self._group} of {self._table.component_names(self.scalars[row])[0]}"

    def residuals(self, values: FloatArray) -> FloatArray:
        """(n_scalars,) unknowns minus given values, for the vector of all unknowns."""
        return np.asarray(values[self.scalars] - self.values)

    def sum_of_squares(self, values: FloatArray) -> float:
        """Sum of squared residuals over sigmas."""
        return float(np.square(self.residuals(values) * self.weights).sum())


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
        spread = _checked_sigmas(table, blocks, sigmas, (len(blocks), size))
        return cls(table.scalars(blocks).ravel(), 1.0 / np.square(spread).ravel())


def _checked_sigmas(
    table: UnknownTable, ids: IntArray, sigmas: ArrayLike, shape: tuple[int, int]
) -> FloatArray:
    given = real(sigmas, "prior: sigmas")
    array = _stretched(given[:, None] if given.shape == shape[:1] else given, shape, "prior: sigmas")
    is_right = array > 0.0
    if not is_right.all():
        row = int(is_right.all(axis=1).argmin())
        raise InputError(f"prior of {table.names[ids[row]]}: sigma must be positive, not {array[row]}")
    return array


def _stretched(given: ArrayLike, shape: tuple[int, int], what: str) -> FloatArray:
    array = real(given, what)
    if array.shape == shape:
        return array
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise InputError(f"{what} have shape {array.shape}; expected {shape}") from None
