"""What a free network is fixed by: chosen coordinates whose changes are least."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import listed, truths
from obseq.leastsquares.problem.unknowns import UnknownTable

Motions: TypeAlias = "Callable[[FloatArray], FloatArray]"
"""Values (n, size) of blocks -> (n, size, k) what they do along directions."""


@dataclass(frozen=True, eq=False)
class Datum:
    """What a free network is fixed by.

    Attributes:
        scalars: positions of the unknowns whose changes are least; none without a datum.
        reference: their values when it was set.
        blocks: (n, size) positions of the unknowns of the blocks that have motions.
        motions: What these blocks do along directions that the equations determine weakly; None for none.
        n_held: How many of these, the first ones, are held as if they were free.
    """

    scalars: IntArray
    reference: FloatArray
    blocks: IntArray
    motions: Motions | None = None
    n_held: int = 0

    def weak(self, values: FloatArray) -> FloatArray:
        """(n, k) what the unknowns of the datum do along these directions, where all have these values.

        Raises:
            InputError: the motions are not of these blocks.
        """
        if self.motions is None:
            return np.zeros((len(self.scalars), 0))
        moves = np.asarray(self.motions(values[self.blocks]), dtype=np.float64)
        if moves.ndim != 3 or moves.shape[:2] != self.blocks.shape:
            raise InputError(
                f"datum: motions of shape {moves.shape} for unknowns of shape {self.blocks.shape}"
            )
        found = np.zeros((len(values), moves.shape[2]))
        found[self.blocks] = moves
        return np.asarray(found[self.scalars])


_NONE: IntArray = np.zeros(0, dtype=np.int64)
NO_DATUM = Datum(_NONE, np.zeros(0), _NONE)


def datum_of(
    table: UnknownTable,
    ids: ArrayLike,
    components: object,
    motions: Motions | None = None,
    n_held: int | None = None,
) -> Datum:
    """The datum of blocks, at their present values; arguments as of `Problem.set_datum`.

    Raises:
        InputError: a rotation or a direction is among them.
    """
    blocks = table.checked(ids, "datum")
    if not all(table.manifold(block).is_flat for block in np.unique(blocks)):
        raise InputError("datum: a rotation or a direction has no coordinates to keep; choose points")
    if not blocks.size:
        return NO_DATUM
    chosen = np.unique(_scalars(table, blocks, components))
    moving = table.scalars(blocks, "datum") if motions else _NONE
    found = Datum(chosen, table.values[chosen], moving, motions)
    weak = found.weak(table.values)
    return replace(found, n_held=weak.shape[1] if n_held is None else n_held)


def _scalars(table: UnknownTable, blocks: IntArray, components: object) -> IntArray:
    """Positions of the chosen components of blocks, which need not be alike."""
    if getattr(components, "dtype", None) == np.bool_:
        scalars = table.scalars(blocks, "datum")
        return scalars[truths(np.asarray(components), scalars.shape, "datum, components")]
    each: list[Any] = [components] * len(blocks)
    if components is not None and any(_is_list(of_block) for of_block in listed(components, "datum")):
        each = listed(components, "datum")
        if len(each) != len(blocks):
            raise InputError(f"datum: components of {len(each)} blocks for {len(blocks)} blocks")
    index = table.component_index
    return np.concatenate(
        [index([block], of_block, "datum").ravel() for block, of_block in zip(blocks, each, strict=True)]
    )


def _is_list(components: object) -> bool:
    return components is None or isinstance(components, list | tuple | np.ndarray)
