"""Free networks: the datum as inner constraints on chosen unknowns, instead of known coordinates.

Observations alone leave the position, orientation or scale of a network undetermined: the normal matrix N has
a kernel, spanned by the columns of G. Of all the solutions, the one on the datum is closest to the reference
values of the chosen unknowns D: the sum of squares of their changes is minimal, that is G_D' (x - x0)_D = 0.

The solution is computed with as many unknowns held as the kernel has dimensions (which ones changes only
rounding), and carried to the datum by the S-transformation of Baarda: with

    S = I - G (G_D' G_D)^-1 G_D',        Q = S M^-1 S',

M^-1 any generalised inverse of N. So the sparse factor stays sparse, and precisions cost as many extra
solutions as the kernel has dimensions. (W. Baarda, S-transformations and criterion matrices, 1973.)

Motions that the observations show too weakly to count are held in the same way. They are in G, and N G is not
quite 0: `Border` has what that adds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, SingularMatrixError
from obseq.leastsquares.solvers.rank import LARGEST_EXAMINED, leading_rows, replacement_pivots

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.leastsquares.solvers import Defect, Solver, SolverStatistics, SymmetricPattern


ALIKE = 1e-6
"""Relative size below which the datum's unknowns do not see a vector of the kernel."""

NEW = 0.1
"""Share of a loose direction outside the kernel from which it is another one: verticals bend it less."""

ROUNDING = 1e-14
"""Share of a variance that the datum leaves as rounding: what it alone determines has none."""

VANISHING = 1e-12
"""Share of what the diagonal of N makes of a motion below which N makes nothing of it."""

WEAKEST_DATUM = 1e-12
"""Share of the kernel that the chosen unknowns must see: below it they do not fix the datum."""


@dataclass(frozen=True, eq=False)
class Border:
    """What is added to S M^-1 S' where N G is not 0: M = N + E W E', E the held unknowns.

    Within the datum, G_D' dx = 0, the inverse of M is S M^-1 S' - Y C Y' with Y = S M^-1 G_D and
    C = (G_D' M^-1 G_D)^-1. That of N has Z F Z' besides, Z the former times E W^(1/2) and
    F = (I - W^(1/2) E' Z)^-1.

    Attributes:
        vectors: (n, 2 k) Y and Z.
        core: (2 k, 2 k) -C and F.
        pull: (n, k) N G.
    """

    vectors: FloatArray
    core: FloatArray
    pull: FloatArray

    def times(self, right: FloatArray) -> FloatArray:
        """What is added of right-hand sides (n,) or (n, k)."""
        return np.asarray(self.vectors @ (self.core @ (self.vectors.T @ right)))


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
        loose: (n, k) what the datum's unknowns do along directions that the matrix determines in appearance
            only; the others follow as the matrix says.
    """

    def __init__(
        self,
        solver: Solver,
        chosen: BoolArray,
        offset: Callable[[], FloatArray],
        beyond: Beyond | None = None,
        loose: FloatArray | None = None,
    ) -> None:
        self._loose = np.zeros((len(chosen), 0)) if loose is None else loose
        self._beyond = beyond
        self._solver = solver
        self._chosen = chosen
        self._offset = offset
        self._held: IntArray | None = None
        self._is_factored = False
        self._kernel = np.zeros((len(chosen), 0))
        self._to_kernel = np.zeros((0, len(chosen)))
        self._border: Border | None = None
        self._pattern: SymmetricPattern | None = None

    @property
    def name(self) -> str:
        """Name of the solver behind."""
        return self._solver.name

    @property
    def behind(self) -> Solver:
        """The solver of regular systems: of damped ones, which need no datum."""
        return self._solver

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        return self._solver.statistics

    @property
    def dimension(self) -> int:
        """Number of datum parameters that the observations leave free."""
        return self._kernel.shape[1]

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
        if self._held is None:
            self._find_held(values)
        else:
            self._solver.factor(self._regularised(values))
        self._kernel = self._kernel_of(values)
        seen = self._kernel[self._chosen]
        self._to_kernel = np.zeros((self.dimension, len(self._chosen)))
        self._to_kernel[:, self._chosen] = np.linalg.solve(_fixed(seen), seen.T)
        self._border = self._border_of(values)
        self._is_factored = True

    def _border_of(self, values: FloatArray) -> Border | None:
        """What loose motions add; None where all of the kernel is free, to rounding."""
        kernel = self._kernel
        pull = self._pattern_analysed.product(values, kernel) if self.dimension else kernel
        weights = np.maximum(values[self._pattern_analysed.diagonal], 0.0)
        if not (np.abs(kernel * pull).sum(axis=0) > VANISHING * (weights @ np.square(kernel))).any():
            return None
        chosen = np.where(self._chosen[:, None], kernel, 0.0)
        through = self._solver.solve(chosen)
        first, inner = self._apart(through), np.linalg.inv(chosen.T @ through)
        held = np.zeros_like(kernel)
        held[self._held_unknowns, np.arange(self.dimension)] = np.sqrt(self._weights(values))
        last = self._projected(held) - first @ (inner @ (first.T @ held))
        core = np.zeros((2 * self.dimension, 2 * self.dimension))
        core[: self.dimension, : self.dimension] = -inner
        core[self.dimension :, self.dimension :] = np.linalg.inv(np.eye(self.dimension) - held.T @ last)
        return Border(np.hstack([first, last]), (core + core.T) / 2.0, pull)

    def _apart(self, solved: FloatArray) -> FloatArray:
        """S times solutions (n,) or (n, k)."""
        return np.asarray(solved - self._kernel @ (self._to_kernel @ solved))

    def _projected(self, right: FloatArray) -> FloatArray:
        """S M^-1 S' times right-hand sides (n,) or (n, k)."""
        return self._apart(self._solver.solve(right - self._to_kernel.T @ (self._kernel.T @ right)))

    def solve(self, rhs: ArrayLike) -> FloatArray:
        """Q times one right-hand side (n,) or several (n, k)."""
        right = np.asarray(rhs, dtype=np.float64)
        solved = self._projected(right)
        return solved if self._border is None else solved + self._border.times(right)

    def settle(self, step: FloatArray) -> FloatArray:
        """The step (n,) that ends on the datum; what observations see of the difference is made good."""
        if self._beyond is not None and self.dimension:
            return np.asarray(step - self._kernel @ self._beyond.shift(step, self._kernel))
        shift = self._to_kernel @ (step + self._offset())
        settled = np.asarray(step - self._kernel @ shift)
        return settled if self._border is None else settled + self.solve(self._border.pull @ shift)

    def selected_inverse(self) -> FloatArray:
        """(nnz,) entries of S M^-1 S' on the pattern: Q - G A' - A G' + G C G', A = M^-1 H', C = H A."""
        if self._pattern is None:
            raise InputError("call analyse(pattern) first")
        entries = self._solver.selected_inverse()
        before = entries[self._pattern.diagonal]
        across = self._solver.solve(np.ascontiguousarray(self._to_kernel.T))
        within = self._to_kernel @ across
        rows, columns = self._pattern.indices, self._pattern.columns()
        half = across - 0.5 * self._kernel @ within
        for kernel, shift in zip(self._kernel.T, half.T, strict=True):
            entries -= kernel[rows] * shift[columns] + shift[rows] * kernel[columns]
        if self._border is not None:
            vectors = self._border.vectors
            for one, share in zip(vectors.T, (vectors @ self._border.core).T, strict=True):
                entries += one[rows] * share[columns]
        is_none = ~(entries[self._pattern.diagonal] > ROUNDING * before)
        entries[is_none[rows] | is_none[columns]] = 0.0
        return entries

    def defect(self) -> Defect:
        """Empty after a successful factorisation: the datum takes the defect away."""
        return self._solver.defect()

    def null_vectors(self) -> FloatArray:
        """(n, k) orthonormal basis of the kernel that the datum takes away."""
        return self._kernel

    def _find_held(self, values: FloatArray) -> None:
        """Factors with as many unknowns held as the kernel has dimensions, loose directions included.

        Raises:
            InputError: A direction is not loose: holding what moves most along it does not show it.
        """
        self._hold(values, np.zeros(0, np.int64))
        for number, loose in enumerate(self._loose.T):
            while not self._is_free(values, loose):
                weakest = self._weakest(values, loose)
                if weakest in self._held_unknowns:
                    raise InputError(
                        f"direction {number} of the datum, said to be loose, is determined by the "
                        "observations: check approximate coordinates and units"
                    )
                self._hold(values, np.union1d(self._held_unknowns, weakest))

    def _hold(self, values: FloatArray, held: IntArray) -> None:
        """Factors with these unknowns held, and as many more as the kernel still has dimensions.

        Where the matrix has weak directions too, rounding hides a part of its kernel until the rest is held.
        Of all unknowns those are held that tell the vectors of the kernel best apart: what has little part in
        them would leave pivots that are made of rounding.
        """
        while True:
            self._held = held
            try:
                self._solver.factor(self._regularised(values))
            except SingularMatrixError as error:
                held = np.union1d(held, self._telling(values, error.indices))
                if len(held) == len(self._held):
                    self._held = None
                    raise
            else:
                return

    def _is_free(self, values: FloatArray, loose: FloatArray) -> bool:
        """Whether the kernel found so far contains a direction, as far as the datum's unknowns see it."""
        seen, rows = loose != 0.0, self._kernel_of(values)
        rest = loose[seen] - rows[seen] @ np.linalg.lstsq(rows[seen], loose[seen], rcond=ALIKE)[0]
        return bool(np.linalg.norm(rest) <= NEW * np.linalg.norm(loose))

    def _weakest(self, values: FloatArray, loose: FloatArray) -> int:
        """The unknown that moves most, in the measure of the matrix, along what is loose."""
        weights = values[self._pattern_analysed.diagonal]
        moved = self._solver.solve(weights * loose)
        return int(np.argmax(np.sqrt(np.maximum(weights, 0.0)) * np.abs(moved)))

    def _telling(self, values: FloatArray, lost: IntArray) -> IntArray:
        """The unknowns that tell the vectors of the kernel best apart; those lost, if they are too many."""
        if len(lost) > LARGEST_EXAMINED:
            return lost
        vectors = self._solver.null_vectors()
        scaled = np.sqrt(replacement_pivots(values[self._pattern_analysed.diagonal]))[:, None] * vectors
        return leading_rows(scaled, len(lost)) if vectors.shape[1] == len(lost) else lost

    def _regularised(self, values: FloatArray) -> FloatArray:
        """The matrix with the diagonal entries of the held unknowns doubled."""
        regular = np.array(values)
        regular[self._diagonal()] += self._weights(values)
        return regular

    def _weights(self, values: FloatArray) -> FloatArray:
        diagonal = values[self._diagonal()]
        return np.where(diagonal > 0.0, diagonal, 1.0)

    def _diagonal(self) -> IntArray:
        return self._pattern_analysed.diagonal[self._held_unknowns]

    @property
    def _pattern_analysed(self) -> SymmetricPattern:
        if self._pattern is None:
            raise InputError("call analyse(pattern), then factor(values)")
        return self._pattern

    @property
    def _held_unknowns(self) -> IntArray:
        return np.zeros(0, np.int64) if self._held is None else self._held

    def _kernel_of(self, values: FloatArray) -> FloatArray:
        """(n, k) orthonormal kernel of N, from M = N + E W E': N z = 0 means z = M^-1 E (W E' z)."""
        vectors = np.zeros((len(self._chosen), len(self._held_unknowns)))
        start = np.eye(vectors.shape[1])
        for _ in range(2 if vectors.size else 0):
            right = np.zeros_like(vectors)
            right[self._held] = self._weights(values)[:, None] * start
            vectors = np.linalg.qr(self._solver.solve(right))[0]
            start = vectors[self._held]
        return vectors


def _fixed(seen: FloatArray) -> FloatArray:
    """(k, k) what the chosen unknowns see of the kernel, of which they see (m, k).

    Raises:
        InputError: it is not enough to fix the datum.
    """
    fixed = seen.T @ seen
    if fixed.size and np.linalg.eigvalsh(fixed)[0] < WEAKEST_DATUM:
        raise InputError(
            f"the chosen datum does not fix the {len(fixed)} free parameters of the network: choose "
            "more points, not all on one line or in one plane"
        )
    return np.asarray(fixed)
