"""What a batch gives back of its observations: an array that is read; another one replaces it as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.errors import InputError

if TYPE_CHECKING:
    from obseq.arrays import FloatArray


REPLACED = (
    "`observations` is a copy, and cannot be written to. Change one of your own, and replace them: "
    "values = batch.observations.copy(); values[0] = ...; batch.observations = values"
)


class Measured(np.ndarray):
    """A copy of observations; writing to it would change nothing, so it says what does."""

    @classmethod
    def of(cls, array: FloatArray) -> Measured:
        """The array, which nobody can write to any more."""
        array.setflags(write=False)
        return array.view(cls)

    def __setitem__(self, where: Any, new: Any) -> None:
        if not self.flags.writeable:
            raise InputError(REPLACED)
        super().__setitem__(where, new)

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *inputs: object, out: tuple[object, ...] = (), **options: object
    ) -> object:
        """What is computed from it is a plain array; `+=` makes a new one, which may replace it."""
        locked = [item for item in out if isinstance(item, Measured) and not item.flags.writeable]
        if any(item is not inputs[0] for item in locked):
            raise InputError(REPLACED)
        if out and not locked:
            options["out"] = tuple(map(_plain, out))
        return getattr(ufunc, method)(*map(_plain, inputs), **options)


def _plain(item: object) -> object:
    return np.asarray(item) if isinstance(item, Measured) else item
