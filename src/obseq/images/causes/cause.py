"""What a cause is: where it may be, which observations it changes, and what may be behind it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field

import numpy as np

from obseq.arrays import IntArray
from obseq.dataclass import dataclass
from obseq.diagnosis.protocol import Change, Slip
from obseq.images.causes.evidence import Evidence
from obseq.images.causes.numbering import Numbering


@dataclass(frozen=True, eq=False)
class Members:
    """Where a cause may be.

    Attributes:
        starts: (h + 1,) where the columns of each begin.
        columns: of the equations that it changes; from the number of equations on, of held parameters.
        labels: (h, k) numbers of what each is: an image point, an image, a point and a coordinate, ...
    """

    starts: IntArray
    columns: IntArray
    labels: IntArray

    @classmethod
    def alike(cls, columns: IntArray, labels: IntArray) -> Members:
        """Of columns (h, q), the same number of each."""
        h, q = columns.shape
        return cls(q * np.arange(h + 1), columns.ravel(), labels.reshape(h, labels.size // h if h else 1))

    @classmethod
    def grouped(cls, columns: IntArray, owners: IntArray, least: int) -> Members:
        """Columns (c,) by their owners (c,), those that have some at least."""
        order = np.argsort(owners, kind="stable")
        names, counts = np.unique(owners, return_counts=True)
        kept = counts >= least
        return cls(
            np.append(0, np.cumsum(counts[kept])).astype(np.int64),
            columns[order][np.repeat(kept, counts)],
            names[kept].reshape(-1, 1),
        )


def _none(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    yield from ()


@dataclass(frozen=True, eq=False)
class Cause:
    """A kind of mistake.

    Attributes:
        code: stable code, such as "I100"; its meaning never changes.
        name: in one or two words.
        about: what it means, in a sentence.
        example: how it comes about.
        remedy: what to do.
        unit: of its size: "px", "" for the unit of the world or of a parameter.
        rarity: twice the logarithm of how much rarer than one wrong image point it is.
        where: all places of a block in which it may be.
        words: what it is called in one of them.
        slips: what may be behind it there.
        is_block: whether it takes several observations out.
        is_bent: whether its effect is far from linear.
        is_start: whether a robust start without it is worth a trial.
    """

    code: str
    name: str
    about: str
    example: str
    remedy: str
    unit: str
    rarity: float
    where: Callable[[Numbering], Members]
    words: Callable[[Numbering, tuple[int, ...]], str]
    slips: Callable[[Evidence, tuple[int, ...], Change], Iterator[Slip]] = field(default=_none)
    is_block: bool = False
    is_bent: bool = False
    is_start: bool = False
