"""Blocks, images and points of which so many measures are rejected that they are not to be trusted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.images.output.testing import BlockReliabilityRecord
from obseq.records.record import Record

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


class Owners(NamedTuple):
    """What measures belong to: images or points.

    Attributes:
        kind: `image` or `point`.
        names: of all of them.
        of: (n,) the one of each measure, a position in `names`.
    """

    kind: str
    names: Sequence[str]
    of: Sequence[int]


def rejected_shares(
    tests: BlockReliabilityRecord, weights: Sequence[float], *owners: Owners
) -> tuple[RejectedShare, ...]:
    """Large shares: that of the block by the given sigmas; else of images and points, by the usual spread.

    Args:
        tests: of the image points of a block.
        weights: (n,) what robust weights left of them.
        owners: their images, their points.
    """
    w = np.abs(np.array([tests.all.w_x, tests.all.w_y], dtype=np.float64)).T
    is_robust, spread = tests.largest.robust, max(tests.largest.spread, 1.0)
    counts, sizes = np.isfinite(w), np.nan_to_num(w)
    weak = np.broadcast_to((np.array(weights) < WEAK)[:, None], w.shape)
    n, n_rejected = int(counts.sum()), int((weak & counts if is_robust else sizes > tests.critical).sum())
    if n and n_rejected >= LARGE * n:
        return (RejectedShare("block", "the block", n_rejected, n),)
    rejected = weak if is_robust else sizes > tests.critical * spread
    return tuple(share for part in owners for share in _large(part, counts, rejected & counts))


def _large(owners: Owners, counts: BoolArray, rejected: BoolArray) -> Iterator[RejectedShare]:
    """The large shares among those of one kind, the largest first."""
    tested, beyond = (_sums(owners, marks) for marks in (counts, rejected))
    share = beyond / np.maximum(tested, 1)
    rows = np.flatnonzero((tested >= LEAST[owners.kind]) & (share >= LARGE))
    for row in rows[np.argsort(-share[rows], kind="stable")].tolist():
        name = f"{owners.kind} {owners.names[row]}"
        yield RejectedShare(owners.kind, name, int(beyond[row]), int(tested[row]))


def _sums(owners: Owners, marks: BoolArray) -> FloatArray:
    found = np.bincount(np.array(owners.of, dtype=np.int64), marks.sum(axis=1), len(owners.names))
    return np.asarray(found, dtype=np.float64)
