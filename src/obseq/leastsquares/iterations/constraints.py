"""Hard constraints: equations between unknowns that hold exactly, by substitution X = T Y + t.

Constraints are linearised like observations, C dx = -F, and solved for as many unknowns as there are
independent ones, the largest coefficient first. What remains, Y, enters the solver; every equation, soft
or not, is substituted alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import ContradictoryConstraintsError, DivergenceError, InputError
from obseq.leastsquares.assembly.evaluation import jacobian_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_array

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.numbering import FreeUnknowns
    from obseq.leastsquares.problem.unknowns import UnknownTable


VANISHING = 1e-11
"""Share of its first coefficients below which what remains of a constraint says nothing new."""


@dataclass(frozen=True)
class Row:
    """One linearised constraint: sum of coefficients times free unknowns = value."""

    label: str
    coefficients: dict[int, float]
    value: float


@dataclass(frozen=True)
class Substitution:
    """dX = T dY + d for the free unknowns.

    Attributes:
        matrix: (n_free, n_kept) T; a row of one 1 for an unknown that is kept.
        offset: (n_free,) d.
        kept: (n_kept,) which of the free unknowns remain.
        redundant: labels of constraints that follow from the others.
    """

    matrix: csr_array
    offset: FloatArray
    kept: IntArray
    redundant: tuple[str, ...]

    @property
    def rank(self) -> int:
        """Number of independent constraints."""
        return len(self.offset) - len(self.kept)

    def is_like(self, other: Substitution | None) -> bool:
        """True when T is the same."""
        if other is None or self.matrix.shape != other.matrix.shape:
            return False
        one, two = self.matrix, other.matrix
        return bool(
            np.array_equal(one.indptr, two.indptr)
            and np.array_equal(one.indices, two.indices)
            and np.array_equal(one.data, two.data)
        )


def substitution(table: UnknownTable, free: FreeUnknowns, batches: Sequence[Batch]) -> Substitution:
    """Linearises constraints at the current values and solves them for some of the unknowns.

    Raises:
        ContradictoryConstraintsError: they cannot hold together.
        DivergenceError: a constraint is undefined at the current values.
        InputError: a constraint concerns an eliminated block.
    """
    solved = _Elimination()
    for batch in batches:
        for row in _rows(table, free, batch):
            solved.add(row)
    return solved.substitution(len(free.scalars))


def held_rows(
    table: UnknownTable, free: FreeUnknowns, batches: Sequence[Batch]
) -> tuple[FloatArray, FloatArray]:
    """(n_free, k) linearised constraints as columns H, and (k,) what H' dx is to be.

    Raises:
        DivergenceError: as of `substitution`, and InputError.
    """
    rows = [row for batch in batches for row in _rows(table, free, batch)]
    columns = np.zeros((len(free.scalars), len(rows)))
    for column, row in zip(columns.T, rows, strict=True):
        column[list(row.coefficients)] = list(row.coefficients.values())
    return columns, np.array([row.value for row in rows])


def _rows(table: UnknownTable, free: FreeUnknowns, batch: Batch) -> list[Row]:
    """The linearised constraints of a batch; frozen unknowns drop out."""
    wrong = np.flatnonzero(table.eliminated[batch.blocks].any(axis=0))
    if wrong.size:
        block = batch.blocks[table.eliminated[batch.blocks[:, wrong[0]]], wrong[0]][0]
        raise InputError(
            f"constraint {batch.label(wrong[0])}: it concerns {table.names[block]!r}, which is to be "
            f"eliminated, and takes no constraints then: eliminate([{block}], False) takes it back"
        )
    count, unknowns = batch.shape.n_residuals, batch.shape.n_unknowns
    evaluated = jacobian_rows(table, batch)
    undefined = np.flatnonzero(~np.isfinite(evaluated).all(axis=0))
    if undefined.size:
        raise DivergenceError(
            f"constraint {batch.label(undefined[0])}: its value or its derivatives are not finite. It is "
            "undefined there: begin with other initial values"
        )
    numbers = _numbers(free, batch)
    return [
        Row(
            batch.label(k),
            _merged(numbers[:, k], evaluated[count + r * unknowns : count + (r + 1) * unknowns, k]),
            -float(evaluated[r, k]),
        )
        for k in range(batch.n)
        for r in range(count)
    ]


def _numbers(free: FreeUnknowns, batch: Batch) -> IntArray:
    """(n_unknowns, n) number in the matrix of each unknown of each equation."""
    parts = [
        free.number[batch.starts[role, : batch.n].astype(np.int64) + np.arange(shape.size)[:, None]]
        for role, shape in enumerate(batch.shape.roles)
    ]
    return np.concatenate(parts)


def _merged(numbers: IntArray, derivatives: FloatArray) -> dict[int, float]:
    coefficients: dict[int, float] = {}
    for number, derivative in zip(numbers.tolist(), derivatives.tolist(), strict=True):
        if number >= 0 and derivative != 0.0:
            coefficients[number] = coefficients.get(number, 0.0) + derivative
    return coefficients


class _Elimination:
    """Constraints solved one after the other: each expresses one unknown by those that are kept."""

    def __init__(self) -> None:
        self.rows: dict[int, dict[int, float]] = {}
        self.offsets: dict[int, float] = {}
        self.users: dict[int, set[int]] = {}
        self.sources: dict[int, str] = {}
        self.redundant: list[str] = []

    def add(self, row: Row) -> None:
        """Takes one more constraint."""
        coefficients, value = self._substitute(row)
        largest = max((abs(c) for c in coefficients.values()), default=0.0)
        scale = max((abs(c) for c in row.coefficients.values()), default=0.0)
        if largest <= VANISHING * scale or not coefficients:
            self._refuse_contradiction(row, value, scale)
            self.redundant.append(row.label)
            return
        pivot = self._pivot(coefficients, largest)
        leading = coefficients.pop(pivot)
        solved = {k: -c / leading for k, c in coefficients.items() if abs(c) > VANISHING * largest}
        self._replace(pivot, solved, value / leading)
        self.sources[pivot] = row.label

    def _substitute(self, row: Row) -> tuple[dict[int, float], float]:
        coefficients: dict[int, float] = {}
        value = row.value
        for number, c in row.coefficients.items():
            if number not in self.rows:
                coefficients[number] = coefficients.get(number, 0.0) + c
                continue
            value -= c * self.offsets[number]
            for other, factor in self.rows[number].items():
                coefficients[other] = coefficients.get(other, 0.0) + c * factor
        return coefficients, value

    def _refuse_contradiction(self, row: Row, value: float, scale: float) -> None:
        size = max([1.0, scale, abs(row.value), *(abs(self.offsets.get(k, 0.0)) for k in row.coefficients)])
        if abs(value) <= 1e-9 * size:
            return
        involved = sorted({self.sources[k] for k in row.coefficients if k in self.sources})
        against = f"contradicts {', '.join(involved)}" if involved else "concerns frozen unknowns only"
        raise ContradictoryConstraintsError(
            f"constraint {row.label} {against}: it is off by {value:.3g}. Remove one of them, or correct it"
        )

    def _pivot(self, coefficients: dict[int, float], largest: float) -> int:
        """The unknown to express: a large coefficient, of an unknown that few others use."""
        good = [k for k, c in coefficients.items() if abs(c) >= 0.5 * largest]
        return min(good, key=lambda k: (len(self.users.get(k, ())), -abs(coefficients[k]), -k))

    def _replace(self, pivot: int, solved: dict[int, float], offset: float) -> None:
        """Expresses `pivot`, also where it was used to express others."""
        for user in self.users.pop(pivot, set()):
            row = self.rows[user]
            factor = row.pop(pivot)
            self.offsets[user] += factor * offset
            for number, c in solved.items():
                row[number] = row.get(number, 0.0) + factor * c
                self.users.setdefault(number, set()).add(user)
        self.rows[pivot], self.offsets[pivot] = solved, offset
        for number in solved:
            self.users.setdefault(number, set()).add(pivot)

    def substitution(self, n: int) -> Substitution:
        """The substitution of n free unknowns."""
        from scipy.sparse import csr_array

        kept = np.setdiff1d(np.arange(n), np.fromiter(self.rows, dtype=np.int64, count=len(self.rows)))
        place = np.full(n, -1, dtype=np.int64)
        place[kept] = np.arange(len(kept))
        rows, columns, data = kept.tolist(), place[kept].tolist(), [1.0] * len(kept)
        for pivot, row in self.rows.items():
            rows.extend([pivot] * len(row))
            columns.extend(place[list(row)].tolist())
            data.extend(row.values())
        offset = np.zeros(n)
        offset[list(self.offsets)] = list(self.offsets.values())
        matrix = csr_array((data, (rows, columns)), shape=(n, len(kept)))
        matrix.sort_indices()
        return Substitution(matrix, offset, kept, tuple(self.redundant))
