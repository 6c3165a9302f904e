"""What a free network is fixed by: chosen coordinates whose changes are least."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import listed, truths

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares.problem.unknowns import UnknownTable


class Datum(NamedTuple):
    """What a free network is fixed by.

    Attributes:
        scalars: positions of the unknowns whose changes are least; none without a datum.
        reference: their values when it was set.
        loose: (n, k) movements of these unknowns whose weak determination does not count: they are free.
    """

    scalars: IntArray
    reference: FloatArray
    loose: FloatArray


NO_DATUM = Datum(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 0)))


def datum_of(
    table: UnknownTable, ids: ArrayLike, components: object, loose: ArrayLike | None = None
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
    return Datum(chosen, table.values[chosen], _movements(table, blocks, loose)[chosen])


def _movements(table: UnknownTable, blocks: IntArray, loose: ArrayLike | None) -> FloatArray:
    """(n_scalars, k) movements (n, size, k) of blocks, for all unknowns."""
    if loose is None:
        return np.zeros((table.n_scalars, 0))
    moves = np.asarray(loose, dtype=np.float64)
    scalars = table.scalars(blocks, "datum")
    if moves.ndim != 3 or moves.shape[:2] != scalars.shape:
        raise InputError(f"datum: movements of shape {moves.shape} for unknowns of shape {scalars.shape}")
    found = np.zeros((table.n_scalars, moves.shape[2]))
    found[scalars] = moves
    return found


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
