"""Observations of different equations that are correlated with one another: one batch of linear rows.

The rows are the tangents of the equations at the current values. They are made anew before each
linearisation, from batches that have no influence themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares import Batch, LeastSquares
from obseq.leastsquares.assembly.evaluation import jacobian_rows

GROUP = "correlated"
"""What the sum of squares of such observations is called."""

Slot = tuple[str, int]
"""Kind of a block, and which one of these it is in a row."""


@dataclass(frozen=True, eq=False)
class Part:
    """The observations of one equation.

    Attributes:
        places: (n,) where they stand among the rows.
        batch: Their batch, none of it active.
        slots: Where the blocks of the equation stand in a row.
        columns: Which columns of a row its derivatives are in.
    """

    places: IntArray
    batch: Batch
    slots: tuple[Slot, ...]
    columns: IntArray


class JointRows:
    """The rows of some observations, whose equations stand in batches of their own.

    Attributes:
        batch: The linear rows, which the covariances belong to.
    """

    def __init__(
        self,
        system: LeastSquares,
        batches: Sequence[tuple[IntArray, Batch]],
        covariances: list[FloatArray],
        labels: Callable[[int], str],
    ) -> None:
        """Adds the rows to a system.

        Args:
            system: It holds the batches.
            batches: Those with no active observation, and where their observations stand among the rows.
            covariances: Of consecutive rows, as the equations count their residuals.
            labels: What the rows are called in messages.
        """
        self._system, self._n = system, sum(len(places) for places, _ in batches)
        slots = [_slots(system, batch) for _, batch in batches]
        sizes = {
            slot: role.size
            for own, (_, batch) in zip(slots, batches, strict=True)
            for slot, role in zip(own, batch.shape.roles, strict=True)
        }
        ends = np.cumsum(list(sizes.values()))
        places = dict(zip(sizes, np.split(np.arange(ends[-1]), ends[:-1]), strict=True))
        self._parts = [
            Part(chosen, batch, own, np.concatenate([places[slot] for slot in own]))
            for own, (chosen, batch) in zip(slots, batches, strict=True)
        ]
        self._width = int(ends[-1])
        rows = self._rows()
        parts = np.split(rows[:, :-1], ends[:-1], axis=1)
        self.batch = system.add_linear(
            self._blocks(list(sizes)), parts, rows[:, -1], 1.0, labels, GROUP, is_tangent=True
        )
        self.batch.correlate_all(covariances)

    def follow(self) -> None:
        """Makes the rows anew at the current values."""
        self.batch.observations = self._rows()

    def _blocks(self, slots: list[Slot]) -> list[IntArray]:
        """(n,) block in each place of each row; where a row needs none, one that another row has there."""
        blocks = np.full((len(slots), self._n), -1, np.int64)
        for part in self._parts:
            for slot, ids in zip(part.slots, part.batch.blocks, strict=True):
                blocks[slots.index(slot), part.places] = ids
        return [np.where(column < 0, column.max(), column) for column in blocks]

    def _rows(self) -> FloatArray:
        """(n, m) coefficients, and right-hand sides: those of the tangents."""
        rows, table = np.zeros((self._n, self._width + 1)), self._system.unknowns
        for part in self._parts:
            residual, *derivatives = jacobian_rows(table, part.batch)
            rows[np.ix_(part.places, part.columns)] = np.transpose(derivatives)
            values = np.concatenate(
                [
                    table.values[table.start[ids] + np.arange(role.size)[:, None]]
                    for ids, role in zip(part.batch.blocks, part.batch.shape.roles, strict=True)
                ]
            )
            rows[part.places, -1] = np.einsum("kn,kn->n", derivatives, values) - residual
        return rows


def _slots(system: LeastSquares, batch: Batch) -> tuple[Slot, ...]:
    """The places that the rows of a batch need."""
    labels = [system.unknowns.manifold(int(ids[0])).label for ids in batch.blocks]
    return tuple((label, labels[:k].count(label)) for k, label in enumerate(labels))
