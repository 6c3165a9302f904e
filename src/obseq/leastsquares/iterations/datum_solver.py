"""Free networks: the datum as inner constraints on chosen unknowns, instead of known coordinates.

Observations alone leave the position, orientation or scale of a network undetermined: the normal matrix N has
a kernel, spanned by the columns of G. Of all the solutions, the one on the datum is closest to the reference
values of the chosen unknowns D: the sum of squares of their changes is minimal, that is G_D' (x - x0)_D = 0.
Motions that the observations show too weakly to count are held in the same way, whatever N makes of them:
C = G_D has a column for each of these, and for each vector of the kernel.

The solution of N x = r with C' x = 0 comes from a sparse factor of M = N + V V'. V has one entry in each
column: as many unknowns as C has columns are held by weights (which ones changes only rounding). Within the
datum, the inverses of M and N are

    P = M^-1 - M^-1 C (C' M^-1 C)^-1 C' M^-1,    Q = P + Z (I - V' Z)^-1 Z',  Z = P V.

So the factor stays sparse, and precisions cost two extra solutions for each column of C. Where N G = 0, Q is
the S-transformation of any generalised inverse (W. Baarda, S-transformations and criterion matrices, 1973).

Motions that are determined, but weakly, are held in M too, not in C. So M is well conditioned, and only the
small matrix I - V' Z has what N says of them: half of its digits. The rows of the equations have the others.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, SingularMatrixError
from obseq.leastsquares.solvers import Defect, InverseParts, Solver, SolverStatistics, SymmetricPattern
from obseq.leastsquares.solvers.rank import LARGEST_EXAMINED, leading_rows, replacement_pivots

Seen: TypeAlias = "Callable[[FloatArray], FloatArray]"
"""Directions (n, k) -> (m, k) what the equations see of them, over sigmas."""

Holds: TypeAlias = "Callable[[], tuple[FloatArray, FloatArray]]"
"""() -> what hard constraints hold now, and what they want of a step."""

WEAK = 1e-6
"""Share of what holds a direction that N adds: below, N has too few digits of it, and the rows are asked."""

WEAKEST_DATUM = 1e-12
"""Share of the kernel that the chosen unknowns must see: below it they do not fix the datum."""


@dataclass(frozen=True, eq=False)
class Border:
    """What makes of a regular M the inverse Q of N = M - V V' within the datum C' x = 0.

    Attributes:
        vectors: (n, 2 k) such that Q = M^-1 + vectors core vectors'.
        core: (2 k, 2 k).
        motions: (n, k) the least that N resists when C' x changes by one in each column.
    """

    vectors: FloatArray
    core: FloatArray
    motions: FloatArray

    @classmethod
    def of(cls, solver: Solver, held: FloatArray, datum: FloatArray, seen: Seen | None) -> Border:
        """Of a factor of M, V (n, q) and C (n, k); of what equations see of directions."""
        from scipy.linalg import block_diag, cholesky, solve_triangular

        count = datum.shape[1]
        of_datum, of_held = np.split(solver.solve(np.hstack([datum, held])), [count], axis=1)
        try:
            root = cholesky(datum.T @ of_datum, lower=True)
        except np.linalg.LinAlgError:  # rounding: M^-1 C has columns that it cannot tell apart
            raise _unresolved() from None
        first = solve_triangular(root, of_datum.T, lower=True).T
        last = of_held - first @ (first.T @ held)
        inner = _released(held.T @ last, last, seen)
        alone = solve_triangular(root, first.T, lower=True, trans=1).T
        motions = alone + last @ (inner @ (held.T @ alone))
        return cls(np.hstack([first, last]), block_diag(-np.eye(count), inner), motions)

    def times(self, right: FloatArray) -> FloatArray:
        """What is added of right-hand sides (n,) or (n, k)."""
        return np.asarray(self.vectors @ (self.core @ (self.vectors.T @ right)))


def _released(kept: FloatArray, directions: FloatArray, seen: Seen | None) -> FloatArray:
    """(I - H)^-1 of H = V' Z (q, q), Z = P V the directions (n, q).

    What the difference leaves of weak directions is rounding. But Z' N Z = H (I - H), and what the rows of
    the equations see of Z, the root of it, has its digits.
    """
    shares, turned = np.linalg.eigh((kept + kept.T) / 2.0)
    rest = np.diag(1.0 - shares)
    weak = shares > 1.0 - WEAK
    if seen is not None and weak.any():
        rows = seen(directions @ (turned[:, weak] / np.sqrt(shares[weak])))
        rest[np.ix_(weak, weak)] = rows.T @ rows
    if not np.linalg.eigvalsh(rest).min(initial=1.0) > 0.0:
        raise _unresolved()
    return np.asarray(turned @ np.linalg.inv(rest) @ turned.T)


def _unresolved() -> SingularMatrixError:
    """Of a matrix whose digits do not suffice to release what is held: no single unknown is to blame."""
    return SingularMatrixError(np.zeros(0, np.int64), np.zeros(0))


def _nothing(n: int) -> tuple[FloatArray, FloatArray]:
    """No constraints of n unknowns."""
    return np.zeros((n, 0)), np.zeros(0)


def _seen_damped(seen: Seen, roots: FloatArray, directions: FloatArray) -> FloatArray:
    """What equations and a damping, whose roots are (n, 1), see of directions (n, k)."""
    return np.vstack([seen(directions), roots * directions])


@dataclass(frozen=True)
class Beyond:
    """A datum of unknowns some of which are eliminated from the matrix: their part of a step is found again.

    Attributes:
        chosen: positions, among all unknowns, of those that define the datum.
        extended: Step of all unknowns from that of the matrix's: affine in it.
        offset: Gives how far these unknowns are now from their reference.
    """

    chosen: IntArray
    extended: Callable[[FloatArray], FloatArray]
    offset: Callable[[], FloatArray]

    def shift(self, step: FloatArray, kernel: FloatArray) -> FloatArray:
        """(k,) coefficients of the kernel (n, k) of the matrix to be taken from its step (n,)."""
        still = self.extended(np.zeros(len(step)))[self.chosen]
        seen = np.column_stack([self.extended(vector)[self.chosen] - still for vector in kernel.T])
        away = self.extended(step)[self.chosen] + self.offset()
        return np.asarray(np.linalg.solve(_fixed(seen), seen.T @ away))


class DatumSolver:
    """A solver of singular systems on a datum, behind the protocol of all solvers.

    Args:
        solver: The solver of the regular systems.
        chosen: (n,) True for the unknowns that define the datum.
        offset: Gives x - x0, how far the unknowns (n,) are now from their reference.
        beyond: the datum itself, where some of its unknowns are not in the matrix; `chosen` then makes no
            more than the solutions of the matrix definite.
        weak: Gives (n, q) what the datum's unknowns do now along directions that are weakly determined.
        n_held: How many of these, the first ones, are held whatever the matrix makes of them.
        seen: What equations see of directions, where they are what makes the matrix.
        holds: Gives hard constraints: (n, h) columns H, and (h,) what H' dx is to be.
    """

    def __init__(
        self,
        solver: Solver,
        chosen: BoolArray,
        offset: Callable[[], FloatArray],
        beyond: Beyond | None = None,
        weak: Callable[[], FloatArray] | None = None,
        n_held: int = 0,
        seen: Seen | None = None,
        holds: Holds | None = None,
    ) -> None:
        self._holds = holds or partial(_nothing, len(chosen))
        self._weak = weak or partial(np.zeros, (len(chosen), 0))
        self._n_held = n_held
        self._seen = seen
        self._beyond = beyond
        self._solver = solver
        self._chosen = chosen
        self._offset = offset
        self._held: IntArray | None = None
        self._is_factored = False
        self._datum = np.zeros((len(chosen), 0))
        self._wanted = np.zeros(0)
        self._border: Border | None = None
        self._pattern: SymmetricPattern | None = None

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_seen": None}  # equations belong to who factors, not to who solves

    @property
    def name(self) -> str:
        """Name of the solver behind."""
        return self._solver.name

    def of_damped(self, damping: FloatArray) -> Solver:
        """The solver of matrices with a damping (n,), which need no datum for what is free.

        Motions that are held are held still, wherever they have led.
        """
        if not self._n_held and not len(self._wanted):
            return self._solver
        still, seen = partial(np.zeros, len(self._chosen)), self._seen
        added = None if seen is None else partial(_seen_damped, seen, np.sqrt(damping)[:, None])
        given = self._weak, self._n_held, added, self._holds
        damped = DatumSolver(self._solver, self._chosen, still, None, *given)
        damped._pattern = self._pattern
        return damped

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        return self._solver.statistics

    @property
    def dimension(self) -> int:
        """Number of datum parameters that the observations leave free."""
        return self._datum.shape[1] - len(self._wanted)

    @property
    def is_factored(self) -> bool:
        """Whether a matrix was factored: the defect is known."""
        return self._is_factored

    def analyse(self, pattern: SymmetricPattern) -> None:
        """Prepares for matrices of this pattern."""
        self._pattern = pattern
        self._solver.analyse(pattern)

    def prepare(self) -> FloatArray:
        """Nothing holds exactly."""
        return self._solver.prepare()

    def factor(self, values: FloatArray) -> None:
        """Factors a matrix of known rank defect; the first one tells the defect.

        Raises:
            InputError: The chosen unknowns do not fix the datum.
            SingularMatrixError: The defect has grown since the first factorisation.
        """
        self._is_factored = False
        weak, (held, self._wanted) = self._weak(), self._holds()
        loose = weak[:, : self._n_held]
        _fixed(loose)
        if self._held is None:
            self._hold(values, weak, held)
        else:
            self._solver.factor(self._regularised(values))
        count = held.shape[1] + weak.shape[1]
        kernel = np.where(self._chosen[:, None], self._kernel_of(values, count), 0.0)
        _fixed(kernel)
        self._datum, pulls = np.hstack([loose, kernel, held]), self._pulls(values)
        self._border = Border.of(self._solver, pulls, self._datum, self._seen) if pulls.size else None
        self._is_factored = True

    def solve(self, rhs: ArrayLike) -> FloatArray:
        """Q times one right-hand side (n,) or several (n, k)."""
        right = np.asarray(rhs, dtype=np.float64)
        solved = self._solver.solve(right)
        return solved if self._border is None else solved + self._border.times(right)

    def settle(self, step: FloatArray) -> FloatArray:
        """The step (n,) that ends on the datum; what observations see of the difference is made good."""
        if self._border is None:
            return step
        if self._beyond is not None:
            kernel = self.null_vectors()
            return np.asarray(step - kernel @ self._beyond.shift(step, kernel))
        away = self._datum.T @ step
        away[: self.dimension] += (self._datum.T @ self._offset())[: self.dimension]
        away[self.dimension :] -= self._wanted
        return np.asarray(step - self._border.motions @ away)

    def inverse_parts(self) -> InverseParts:
        """Q on the pattern: that of M, and what makes it that of N on the datum."""
        regular, border = self._solver.inverse_parts(), self._border
        return regular if border is None else InverseParts(regular.values, border.vectors, border.core)

    def selected_inverse(self) -> FloatArray:
        """(nnz,) entries of Q on the pattern."""
        return self.inverse_parts().whole(self._pattern_analysed)

    def defect(self) -> Defect:
        """Empty after a successful factorisation: the datum takes the defect away."""
        return self._solver.defect()

    @property
    def motions(self) -> FloatArray:
        """(n, k) what the matrix resists least, of what changes the datum by 1 along one direction alone."""
        return (self._datum if self._border is None else self._border.motions)[:, : self.dimension]

    def null_vectors(self) -> FloatArray:
        """(n, k) orthonormal basis of what the datum takes away."""
        return np.linalg.qr(self.motions)[0]

    def _hold(self, values: FloatArray, weak: FloatArray, constraints: FloatArray) -> None:
        """Factors with an unknown held for each constraint and weak direction, and for what kernel is left.

        Where the matrix has weak directions too, rounding hides a part of its kernel until the rest is held.
        Of all unknowns those are held that tell weak directions, or vectors of the kernel, best apart: what
        has little part in them would leave pivots that are made of rounding. A constraint holds what it
        moves most, however little the matrix sees of that.
        """
        ruled = leading_rows(constraints, constraints.shape[1])
        rest = weak - constraints @ np.linalg.solve(constraints[ruled], weak[ruled])
        first = np.concatenate([ruled, self._apart(values, rest)])
        held: IntArray = np.zeros(0, dtype=np.int64)
        while True:
            self._held = np.concatenate([first, held])
            try:
                self._solver.factor(self._regularised(values))
            except SingularMatrixError as error:
                more = np.setdiff1d(self._telling(values, error.indices), self._held)
                if not more.size:
                    self._held = None
                    raise
                held = np.union1d(held, more)
            else:
                return

    def _apart(self, values: FloatArray, vectors: FloatArray) -> IntArray:
        """As many unknowns as there are vectors (n, k): those that tell them best apart."""
        scale = np.sqrt(replacement_pivots(values[self._pattern_analysed.diagonal]))
        return leading_rows(scale[:, None] * vectors, vectors.shape[1])

    def _telling(self, values: FloatArray, lost: IntArray) -> IntArray:
        """The unknowns that tell the vectors of the kernel best apart; those lost, if they are too many."""
        if len(lost) > LARGEST_EXAMINED:
            return lost
        vectors = self._solver.null_vectors()
        return self._apart(values, vectors) if vectors.shape[1] == len(lost) else lost

    def _regularised(self, values: FloatArray) -> FloatArray:
        """The matrix with weights added to the diagonal entries of the held unknowns."""
        regular = np.array(values)
        regular[self._pattern_analysed.diagonal[self._held_unknowns]] += self._weights(values)
        return regular

    def _weights(self, values: FloatArray) -> FloatArray:
        """What holds the held unknowns: as much again as equations do.

        What a constraint holds may be seen by next to nothing, and rounding is a share of M^-1. So it is held
        as firmly as what the datum's equations see best.
        """
        diagonal = values[self._pattern_analysed.diagonal]
        weights = diagonal[self._held_unknowns]
        weights[: len(self._wanted)] = diagonal[self._chosen].max(initial=0.0)
        return np.where(weights > 0.0, weights, 1.0)

    @property
    def _pattern_analysed(self) -> SymmetricPattern:
        if self._pattern is None:
            raise InputError("call analyse(pattern), then factor(values)")
        return self._pattern

    @property
    def _held_unknowns(self) -> IntArray:
        return np.zeros(0, np.int64) if self._held is None else self._held

    def _pulls(self, values: FloatArray) -> FloatArray:
        """(n, k) what the regular matrix has besides, a factor V of V V'."""
        pulls = np.zeros((len(self._chosen), len(self._held_unknowns)))
        pulls[self._held_unknowns, np.arange(pulls.shape[1])] = np.sqrt(self._weights(values))
        return pulls

    def _kernel_of(self, values: FloatArray, weak: int) -> FloatArray:
        """(n, k) orthonormal kernel of N and what holds weak directions, the first unknowns that are held.

        M is this N + V V', so that N z = 0 means z = M^-1 V V' z.
        """
        pulls = self._pulls(values)[:, weak:]
        start, vectors = np.eye(pulls.shape[1]), pulls
        for _ in range(2 if pulls.size else 0):
            vectors = np.linalg.qr(self._solver.solve(pulls @ start))[0]
            start = pulls.T @ vectors
        return vectors


def _fixed(seen: FloatArray) -> FloatArray:
    """(k, k) what the chosen unknowns see of the kernel, of which they see (m, k).

    Raises:
        InputError: it is not enough to fix the datum.
    """
    fixed = seen.T @ seen
    lengths = np.linalg.eigvalsh(fixed) if fixed.size else np.ones(1)
    if lengths[0] < WEAKEST_DATUM * max(lengths[-1], 1.0):
        raise InputError(
            f"the chosen datum does not fix the {len(fixed)} free parameters of the network: choose "
            "more points, not all on one line or in one plane"
        )
    return np.asarray(fixed)
