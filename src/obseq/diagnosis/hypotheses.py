"""WHERE: what may be wrong with a network or a block, as columns over its equations.

The hypotheses of one model are made once: which columns each has never changes. What an error of one unit
does to the equations (the columns themselves) is made at each linearisation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass


@dataclass(frozen=True, eq=False)
class Family:
    """Hypotheses of one code.

    Attributes:
        code: Stable code of the cause, such as "S120".
        starts: (h + 1,) where the columns of each begin, and the end of the last.
        columns: (p,) columns of all of them, one after the other.
        rarity: Twice the logarithm of how much rarer than one wrong reading such a mistake is.
        is_block: Whether each takes several observations out, and needs most of them to be off.
        needs_slip: Whether it is told only with a slip that explains it.
        is_bent: Whether the effect of a large error is far from linear, and is applied by the model.
        is_start: Whether a robust start without one of them is worth a trial.
        most: Size beyond which it is another mistake, or its effect is no longer linear.
    """

    code: str
    starts: IntArray
    columns: IntArray
    rarity: float = 0.0
    is_block: bool = False
    needs_slip: bool = False
    is_bent: bool = False
    is_start: bool = False
    most: float = math.inf

    @classmethod
    def alone(cls, code: str, columns: IntArray, rarity: float = 0.0, **about: bool) -> Family:
        """Hypotheses of one column each."""
        return cls(code, np.arange(len(columns) + 1), np.asarray(columns), rarity, **about)

    def __len__(self) -> int:
        return len(self.starts) - 1


class Hypotheses:
    """All hypotheses of a model, in one order; an index is what one of them is known by.

    Attributes:
        codes: Of the families.
        starts: (h + 1,) where the columns of each begin.
        columns: (p,) numbers of columns.
        family: (h,) number of the family of each.
        q: (h,) how many columns each has.
        rarity: (h,) in squares.
        is_block, needs_slip, is_bent, is_start, most: (h,) see `Family`.
    """

    def __init__(self, families: Sequence[Family]) -> None:
        self.codes = tuple(one.code for one in families)
        sizes = [len(one) for one in families]
        self.family = np.repeat(np.arange(len(sizes), dtype=np.int16), sizes)
        none = np.zeros(0, np.int32)
        self.q = np.concatenate([none, *(np.diff(one.starts) for one in families)], dtype=np.int32)
        self.starts = np.append(0, np.cumsum(self.q, dtype=np.int64))
        parts = (one.columns[one.starts[0] : one.starts[-1]] for one in families)
        self.columns = np.concatenate([none, *parts], dtype=np.int32)
        self._firsts = np.append(0, np.cumsum(sizes))

        def each(name: str, kind: type = np.bool_) -> Any:
            return np.array([getattr(one, name) for one in families], kind)[self.family]

        self.rarity: FloatArray = each("rarity", np.float64)
        self.most: FloatArray = each("most", np.float64)
        self.is_block: BoolArray = each("is_block")
        self.needs_slip: BoolArray = each("needs_slip")
        self.is_bent: BoolArray = each("is_bent")
        self.is_start: BoolArray = each("is_start")

    def __len__(self) -> int:
        return len(self.family)

    def of(self, index: int) -> IntArray:
        """Columns of one of them."""
        return self.columns[self.starts[index] : self.starts[index + 1]].astype(np.int64)

    def counts(self, mask: BoolArray) -> IntArray:
        """(h,) how many columns of each a mask (p,) over the columns of all has."""
        before = np.append(0, np.cumsum(mask))[self.starts]
        return np.asarray(np.diff(before))

    def code(self, index: int) -> str:
        """Code of one of them."""
        return self.codes[int(self.family[index])]

    def place(self, index: int) -> tuple[int, int]:
        """Number of the family of one, and its number in it."""
        family = int(self.family[index])
        return family, index - int(self._firsts[family])
