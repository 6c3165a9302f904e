"""The default solver: supernodal multifrontal Cholesky with its selected inverse."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.solvers.base import PIVOT_TOLERANCE, BaseSolver, defect_of
from obseq.leastsquares.solvers.blas import one_blas_thread, routine_addresses
from obseq.leastsquares.solvers.inverse import invert_nodes
from obseq.leastsquares.solvers.numeric import factor_nodes, solve_backward, solve_forward
from obseq.leastsquares.solvers.ordering import resolve_ordering
from obseq.leastsquares.solvers.protocol import SolverStatistics
from obseq.leastsquares.solvers.symbolic import analyse_pattern
from obseq.leastsquares.solvers.workspace import place_fronts, place_updates

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from obseq.leastsquares.solvers.protocol import Defect, FloatArray, IntArray, SymmetricPattern


class SupernodalCholesky(BaseSolver):
    """Supernodal multifrontal Cholesky over SciPy's BLAS.

    Args:
        ordering: "auto", "metis", "minimum-degree" or "natural".
        pivot_tolerance: bound of the ratio pivot / diagonal entry under which a pivot has vanished.
    """

    name = "supernodal"

    def __init__(self, *, ordering: str = "auto", pivot_tolerance: float = PIVOT_TOLERANCE) -> None:
        super().__init__(pivot_tolerance=pivot_tolerance)
        self._ordering = resolve_ordering(ordering)

    def _analyse(self, pattern: SymmetricPattern) -> None:
        structure = analyse_pattern(pattern, self._ordering, np.empty(0, dtype=np.int64))
        self._structure = structure
        m = len(structure.parent)
        self._update_at = np.zeros(m, dtype=np.int64)
        self._nodes = np.arange(m)
        room = place_updates(
            self._nodes, structure.parent, structure.below, np.zeros(m, dtype=np.bool_), self._update_at, 0
        )
        self._front_at = np.zeros(m, dtype=np.int64)
        self._front_room = place_fronts(self._nodes, structure.parent, structure.front, self._front_at, 0)
        self._inverse_space = None
        self._panels = np.empty(structure.panel_at[-1])
        self._workspace = np.empty(room)
        self._scratch = np.empty(int(np.max(structure.width, initial=0)) ** 2)
        self._pivots = np.empty(pattern.n)

    def _factor(self, values: FloatArray) -> Defect:
        s = self._structure
        with one_blas_thread():
            factor_nodes(
                self._nodes,
                s.start,
                s.children_at,
                s.children,
                s.below_at,
                s.relative,
                s.panel_at,
                s.entry_at,
                s.entry,
                s.target,
                self._update_at,
                values,
                self._panels,
                self._workspace,
                self._scratch,
                self._pivots,
                self._pivot_tolerance,
                routine_addresses(),
            )
        pivots = np.empty_like(self._pivots)
        pivots[s.order] = self._pivots
        return defect_of(pivots, self._pivot_tolerance)

    def _solve(self, rhs: FloatArray) -> FloatArray:
        s = self._structure
        x = np.ascontiguousarray(rhs[s.order].T)
        scratch = np.empty(int(np.max(s.below, initial=0)))
        for sweep in (solve_forward, solve_backward):
            sweep(s.start, s.below_at, s.rows, s.panel_at, self._panels, x, scratch)
        solution = np.empty_like(rhs)
        solution[s.order] = x.T
        return solution

    def _selected_inverse(self) -> FloatArray:
        s = self._structure
        selected = np.empty(self._pattern.nnz)
        if self._inverse_space is None:
            self._inverse_space = (
                np.empty(self._front_room),
                np.empty(int(np.max(s.width * s.front, initial=0))),
            )
        with one_blas_thread():
            invert_nodes(
                self._nodes,
                s.start,
                s.parent,
                s.below_at,
                s.relative,
                s.panel_at,
                s.entry_at,
                s.entry,
                s.target,
                self._front_at,
                self._panels,
                *self._inverse_space,
                selected,
                routine_addresses(),
            )
        return selected

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        width = self._structure.width.astype(np.float64)
        below = self._structure.below
        return SolverStatistics(
            solver=self.name,
            ordering=self._ordering,
            n=self._pattern.n,
            nnz_pattern=self._pattern.nnz,
            nnz_factor=int(np.sum(width * (width + 1) / 2 + width * below)),
            flops=float(np.sum(width**3 / 3 + width**2 * below + width * below**2)),
            memory=self._panels.nbytes + self._workspace.nbytes,
        )
