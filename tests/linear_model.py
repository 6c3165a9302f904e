"""A model whose equations are linear, for the engine: every outcome can be worked out by other means."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from obseq.diagnosis.columns import Columns
from obseq.diagnosis.hypotheses import Family, Hypotheses
from obseq.diagnosis.linear import Linear
from obseq.diagnosis.protocol import Change, Slip
from obseq.leastsquares.sparse import Sparse

Array = NDArray[np.float64]
N, U = 40, 6
DRIFT, BLOCK = "T2", "T3"


def rows_of(seed: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(N, U)), rng.normal(size=N)


def hypotheses() -> Hypotheses:
    """Single rows, an offset of the first eight rows, and the same eight rows as a block."""
    return Hypotheses(
        [
            Family.alone("T1", np.arange(N), is_start=True),
            Family.alone(DRIFT, np.array([N]), rarity=4.0),
            Family(BLOCK, np.array([0, 8]), np.arange(8), rarity=8.0, is_block=True),
        ]
    )


def columns() -> Array:
    offset = np.zeros((N, 1))
    offset[:8] = -2.0
    return np.hstack([-np.eye(N), offset])


class Linearly:
    """A model whose equations are linear: residuals v0 + A x, x where it is."""

    def __init__(self, matrix: Array, noise: Array, families: Sequence[Family] = ()) -> None:
        self.matrix, self.observed = matrix, noise
        self.hypotheses = Hypotheses(families) if families else hypotheses()
        self.columns = columns()
        self.known: dict[int, Slip] = {}
        self.adjustments = 0

    def solution(self) -> Array | None:
        return self._at(())

    def robust(self, without: Sequence[Change] = ()) -> Array:
        place, observed = self._at(without), self._without(without)
        for _ in range(30):
            off = observed + self.matrix @ place
            weights = 1.0 / np.maximum(np.abs(off), 1e-3)
            normal = self.matrix.T @ (weights[:, None] * self.matrix)
            place = np.asarray(np.linalg.solve(normal, -self.matrix.T @ (weights * observed)))
        return place

    def linearised(self, place: Array, applied: Sequence[Change]) -> tuple[Linear, Columns]:
        inverse = np.linalg.inv(self.matrix.T @ self.matrix)
        leverages = np.einsum("ij,jk,ik->i", self.matrix, inverse, self.matrix)
        linear = Linear(
            self._without(applied) + self.matrix @ place,
            Sparse.of_dense(self.matrix),
            Sparse.of_diagonal(np.ones(N)),
            lambda: Sparse.of_dense(inverse),
            Sparse.of_diagonal(leverages),
            lambda right: inverse @ right,
            N - self.matrix.shape[1],
        )
        return linear, Columns(Sparse.of_dense(self.columns.T), np.arange(self.columns.shape[1]) < N)

    def adjusted(self, place: Array, changes: Sequence[Change]) -> tuple[Array, bool, int]:
        self.adjustments += 1
        return self._at(changes), True, 1

    def slips(self, change: Change, place: Array) -> tuple[Slip, ...]:
        return tuple(slip for index, slip in self.known.items() if index == change.index)

    def _without(self, changes: Sequence[Change]) -> Array:
        off = self.observed.copy()
        for change in changes:
            off -= self.columns[:, self.hypotheses.of(change.index)] @ change.size
        return off

    def _at(self, changes: Sequence[Change]) -> Array:
        return np.asarray(-np.linalg.lstsq(self.matrix, self._without(changes), rcond=None)[0])
