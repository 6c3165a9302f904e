"""Blocks, images and points of which so many measures are rejected that they are not to be trusted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.images.output.testing import BlockReliabilityRecord
from obseq.records.columns import Texts
from obseq.records.record import Record
from obseq.records.rows import AnyRows

LARGE = 0.5
"""Share of the coordinates from which it is large."""
LEAST = {"image": 8, "point": 6}
"""Coordinates of which a share says something."""
WEAK = 0.1
"""A robust weight below which a measure is rejected: its test is that of what is left of it."""


class RejectedShare(Record, frozen=True):
    """How many of the coordinates of something are rejected.

    Attributes:
        kind: `block`, `image` or `point`.
        name: what it is, in words.
        rejected: its coordinates that are rejected.
        tested: its coordinates that are tested.
    """

    kind: str
    name: str
    rejected: int
    tested: int

    @property
    def text(self) -> str:
        """Name and numbers in words."""
        return f"{self.name} ({self.rejected} of {self.tested})"


def rejected_shares(tests: BlockReliabilityRecord, measures: AnyRows) -> tuple[RejectedShare, ...]:
    """Large shares: that of the block by the given sigmas; else of images and points, by the usual spread."""
    w = np.abs(np.column_stack([measures.numbers("w_x"), measures.numbers("w_y")]))
    is_robust, spread = tests.largest.robust, max(tests.largest.spread, 1.0)
    counts, sizes = np.isfinite(w), np.nan_to_num(w)
    weak = np.broadcast_to((measures.numbers("weight") < WEAK)[:, None], w.shape)
    n, n_rejected = int(counts.sum()), int((weak & counts if is_robust else sizes > tests.critical).sum())
    if n and n_rejected >= LARGE * n:
        return (RejectedShare("block", "the block", n_rejected, n),)
    rejected = weak if is_robust else sizes > tests.critical * spread
    return tuple(
        share for kind in LEAST for share in _large(kind, measures.texts(kind), counts, rejected & counts)
    )


def _large(kind: str, owners: Texts, counts: BoolArray, rejected: BoolArray) -> Iterator[RejectedShare]:
    """The large shares among those of one kind, the largest first; an owner for each measure."""
    tested, beyond = (_sums(owners, marks) for marks in (counts, rejected))
    share = beyond / np.maximum(tested, 1)
    rows = np.flatnonzero((tested >= LEAST[kind]) & (share >= LARGE))
    for row in rows[np.argsort(-share[rows], kind="stable")].tolist():
        name = f"{kind} {owners.names[row]}"
        yield RejectedShare(kind, name, int(beyond[row]), int(tested[row]))


def _sums(owners: Texts, marks: BoolArray) -> FloatArray:
    found = np.bincount(owners.codes, marks.sum(axis=1), len(owners.names))
    return np.asarray(found, dtype=np.float64)
