"""What a batch gives back of its observations: an array that is read; another one replaces it as a whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.errors import InputError

if TYPE_CHECKING:
    from obseq.arrays import FloatArray


class Measured(np.ndarray):
    """A copy of observations; writing to it would change nothing, so it says what does."""

    @classmethod
    def of(cls, array: FloatArray) -> Measured:
        """The array, which nobody can write to any more."""
        array.setflags(write=False)
        return array.view(cls)

    def __setitem__(self, where: Any, new: Any) -> None:
        if not self.flags.writeable:
            raise InputError(
                "`observations` is a copy, and cannot be written to. Change one of your own, and replace "
                "them: values = batch.observations.copy(); values[0] = ...; batch.observations = values"
            )
        super().__setitem__(where, new)

    def __iadd__(self, other: Any) -> Any:
        return self + other

    def __isub__(self, other: Any) -> Any:
        return self - other

    def __imul__(self, other: Any) -> Any:
        return self * other

    def __itruediv__(self, other: Any) -> Any:
        return self / other

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """What is computed from it is a plain array."""
        return array[()] if return_scalar else np.asarray(array)
