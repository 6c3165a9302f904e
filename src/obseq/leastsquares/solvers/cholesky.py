"""The default solver: supernodal multifrontal Cholesky with its selected inverse."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IndexArray, IntArray
from obseq.errors import InputError, SingularMatrixError, SolverStateError
from obseq.leastsquares.solvers.base import AT_ONCE, NUMBERS, BaseSolver
from obseq.leastsquares.solvers.blas import one_blas_thread, routine_addresses
from obseq.leastsquares.solvers.inverse import invert_nodes
from obseq.leastsquares.solvers.numeric import factor_nodes, factor_panel
from obseq.leastsquares.solvers.ordering import checked_ordering, resolve_ordering
from obseq.leastsquares.solvers.protocol import Defect, SolverStatistics, SymmetricPattern
from obseq.leastsquares.solvers.rank import SUSPICIOUS, defect_of, undetermined
from obseq.leastsquares.solvers.schedule import plan, run_tasks
from obseq.leastsquares.solvers.substitution import quadratic_forms, substitute_backward, substitute_forward
from obseq.leastsquares.solvers.symbolic import analyse_pattern

Substitution = Callable[..., None]

WORKING_ROOM = ("_workspace", "_scratch")
"""Arrays that are filled anew at each call."""


class SupernodalCholesky(BaseSolver):
    """Supernodal multifrontal Cholesky over SciPy's BLAS.

    With `last`, these unknowns are eliminated last, together: `eliminate` stops before them, and gives the
    system that remains for them (`schur_complement`, `reduce`); `expand` and `expand_inverse` go back down.

    Args:
        ordering: "auto", "metis", "minimum-degree" or "natural".
        threads: subtrees of the elimination are shared among so many threads; the numbers do not change.
        last: indices of unknowns to be eliminated last.
    """

    name = "supernodal"

    def __init__(
        self,
        *,
        ordering: str = "auto",
        threads: int = 1,
        last: ArrayLike = (),
    ) -> None:
        super().__init__()
        if threads < 1:
            raise InputError(f"{threads} threads: at least one is needed")
        self._wanted = checked_ordering(ordering)
        self._threads = threads
        self._last: IntArray = np.array(last, dtype=np.int64).reshape(-1)
        self._schur: FloatArray | None = None
        if np.any(np.diff(np.sort(self._last)) == 0):
            raise InputError("`last` names an unknown twice")

    def __getstate__(self) -> dict[str, object]:
        """What a copy needs: of the room to work in, which holds nothing between two calls, the size."""
        state = dict(self.__dict__)
        return state | {name: state[name].shape for name in WORKING_ROOM if name in state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(
            {name: np.empty(value) if name in WORKING_ROOM else value for name, value in state.items()}
        )

    def _analyse(self, pattern: SymmetricPattern) -> None:
        if len(self._last) and not 0 <= self._last.min() <= self._last.max() < pattern.n:
            raise InputError(f"`last` must be indices below {pattern.n}")
        self._ordering = resolve_ordering(self._wanted, pattern.n)
        structure = analyse_pattern(pattern, self._ordering, np.sort(self._last))
        self._structure = structure
        self._schedule = plan(structure, self._threads)
        self._panels = np.empty(structure.panel_at[-1])
        self._workspace = np.empty(0)
        self._scratch = np.empty((self._threads, int(np.max(structure.width, initial=0)) ** 2))
        self._pivots = np.empty(pattern.n)
        self._schur = None

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        self._factor_until(values, tolerance)
        if len(self._last):
            self._factor_last(tolerance)
        return self._defect_before(self.pattern.n, tolerance)

    def _factor_until(self, values: FloatArray, tolerance: float, diagonal: FloatArray | None = None) -> None:
        """Factors all supernodes but that of the last unknowns, which is assembled."""
        schedule = self._schedule
        self._have_room(self._rooms()[0])
        measure = values[self.pattern.diagonal] if diagonal is None else diagonal
        self._pivots[:] = measure[self._structure.unknowns]

        def run(nodes: IntArray, worker: int) -> None:
            factor_nodes(
                nodes,
                self._structure,
                schedule.update_at,
                schedule.is_shared,
                schedule.shared_room + worker * schedule.update_room,
                values,
                self._panels,
                self._workspace,
                self._scratch[worker],
                self._pivots,
                tolerance,
                self._stop,
                routine_addresses(),
            )

        with one_blas_thread():
            run_tasks(schedule, run, self._threads, upwards=True)

    def _defect_before(self, count: int, tolerance: float) -> Defect:
        """The pivots not above the tolerance among the first `count` unknowns eliminated."""
        pivots = np.ones(self.pattern.n)
        pivots[self._structure.unknowns[:count]] = self._pivots[:count]
        return defect_of(pivots, tolerance)

    @property
    def _stop(self) -> int:
        """Number of supernodes before that of the unknowns to be eliminated last."""
        return len(self._structure.parent) - (len(self._last) > 0)

    def _factor_last(self, tolerance: float) -> None:
        size, s = len(self._last), self._structure
        self._schur = self._last_block().copy()
        factor_panel(
            self._panels,
            int(s.panel_at[-2]),
            size,
            size,
            self._scratch[0],
            self._pivots,
            int(s.start[-2]),
            tolerance,
            routine_addresses(),
        )

    def _last_block(self) -> FloatArray:
        """(k, k) view of the panel of the last unknowns, in the order of the elimination."""
        size = len(self._last)
        return self._panels[self._structure.panel_at[-2] :].reshape(size, size).T

    def eliminate(self, values: FloatArray) -> None:
        """Eliminates all unknowns but the last ones; the system that remains may be singular.

        Args:
            values: (nnz,) entries of the matrix, in the order of the pattern.

        Raises:
            SingularMatrixError: pivots of the unknowns eliminated vanish.
        """
        values = self.checked(values)
        if not len(self._last):
            raise SolverStateError("eliminate: name the unknowns to be kept, SupernodalCholesky(last=...)")
        self.invalidate()
        self._schur = None
        count = self.pattern.n - len(self._last)
        for tolerance in (SUSPICIOUS, 0.0):
            self._factor_until(values, tolerance)
            suspects = self._defect_before(count, tolerance)
            defect = suspects
            if tolerance > 0.0:
                defect = undetermined(suspects, self.pattern, values, self._solve_inner)
            if defect.dimension:
                raise SingularMatrixError(defect.indices, defect.pivots)
            if not suspects.dimension:
                break
        self._schur = self._last_block().copy()

    def eliminate_replacing(self, values: FloatArray, tolerance: float, diagonal: FloatArray) -> Defect:
        """`eliminate` for one who examines the whole of which this is a part, and who may name no `last`.

        Args:
            values: (nnz,) entries of the matrix.
            tolerance: pivots that are not above this share are replaced.
            diagonal: (n,) what they are a share of: the diagonal entries of the whole.

        Returns:
            The pivots that were replaced, and the least of the others.
        """
        values = self.checked(values)
        self.invalidate()
        self._schur = None
        self._factor_until(values, tolerance, diagonal)
        self._schur = self._last_block().copy() if len(self._last) else np.empty((0, 0))
        return self._defect_before(self.pattern.n - len(self._last), tolerance)

    def schur_columns(self) -> FloatArray:
        """(k (k + 1) / 2,) lower triangle of `schur_complement`, column by column, of ascending `last`."""
        schur = self._eliminated()
        columns = [schur[k:, k] for k in range(len(schur))]
        return np.concatenate(columns) if columns else np.zeros(0)

    def take_factor(self) -> FloatArray:
        """The factor of what was eliminated; it leaves the solver, whose copies are small then."""
        panels, self._panels, self._schur = self._panels, np.empty(0), None
        return panels[: self._structure.panel_at[self._stop]]

    def put_factor(self, panels: FloatArray | None = None) -> None:
        """Gives it back; room for another when None."""
        self._panels = np.empty(self._structure.panel_at[-1]) if panels is None else panels
        self._schur = np.empty((0, 0))

    def schur_complement(self) -> FloatArray:
        """(k, k) matrix of the system that remains for the unknowns `last`, in their order."""
        lower = np.tril(self._eliminated())
        place = self._last_places
        return (lower + np.tril(lower, -1).T)[np.ix_(place, place)]

    @property
    def _last_places(self) -> IntArray:
        """(k,) rank of each of the unknowns `last`, which are eliminated in ascending order."""
        return np.argsort(np.argsort(self._last))

    def reduce(self, rhs: ArrayLike) -> FloatArray:
        """Right-hand side (k,) or (k, m) of the system that remains, from that of all unknowns."""
        return self.reduce_and_square(rhs)[0].reshape(-1, *np.shape(rhs)[1:])

    def reduce_and_square(self, rhs: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The same (k, m), and (m,) b N^-1 b' over the unknowns eliminated."""
        _, x = self._permuted(rhs)
        self._sweep(substitute_forward, x, self._stop)
        count = self.pattern.n - len(self._last)
        return x[:, count:].T[self._last_places], np.einsum("ij,ij->i", x[:, :count], x[:, :count])

    def expand(self, rhs: ArrayLike, last_solution: ArrayLike) -> FloatArray:
        """Solution (n,) or (n, m) for all unknowns, from the right-hand side and the solution for `last`."""
        right, x = self._permuted(rhs)
        self._sweep(substitute_forward, x, self._stop)
        known = np.asarray(last_solution, dtype=np.float64).reshape(len(self._last), len(x))
        x[:, self.pattern.n - len(self._last) :] = known[np.argsort(self._last)].T
        self._sweep(substitute_backward, x, self._stop)
        return self._unpermuted(x).reshape(right.shape)

    def expand_inverse(self, last_inverse: FloatArray) -> FloatArray:
        """(nnz,) selected inverse, from the inverse (k, k) of the whole system for the unknowns `last`."""
        self._eliminated()
        order = np.argsort(self._last)
        return self._invert(self._stop, np.asarray(last_inverse, dtype=np.float64)[np.ix_(order, order)])

    def _eliminated(self) -> FloatArray:
        """(k, k) lower triangle of what remains, in the order of the elimination."""
        if self._schur is None:
            raise SolverStateError(f"{self.name}: call eliminate(values) first")
        return self._schur

    def _permuted(self, rhs: ArrayLike) -> tuple[FloatArray, FloatArray]:
        self._eliminated()
        right = np.asarray(rhs, dtype=np.float64)
        return right, np.ascontiguousarray(right.reshape(self.pattern.n, -1)[self._structure.unknowns].T)

    def _unpermuted(self, x: FloatArray) -> FloatArray:
        solution = np.empty(x.T.shape)
        solution[self._structure.unknowns] = x.T
        return solution

    def _solve_inner(self, rhs: FloatArray) -> FloatArray:
        """Solves for the unknowns eliminated, the last ones being zero."""
        x = np.ascontiguousarray(rhs[self._structure.unknowns].T)
        self._sweep(substitute_forward, x, self._stop)
        x[:, self.pattern.n - len(self._last) :] = 0.0
        self._sweep(substitute_backward, x, self._stop)
        return self._unpermuted(x)

    def _solve(self, rhs: FloatArray) -> FloatArray:
        x = np.ascontiguousarray(rhs[self._structure.unknowns].T)
        for substitute in (substitute_forward, substitute_backward):
            self._sweep(substitute, x, len(self._structure.parent))
        return self._unpermuted(x)

    def quadratic_forms(self, values: FloatArray, columns: IndexArray, starts: IntArray) -> FloatArray:
        """(k,) b N^-1 b' of sparse rows b, each met where its entries lead to.

        Args:
            values: (nnz,) entries, row by row.
            columns: (nnz,) the column of each.
            starts: (k + 1,) where each row begins among them.
        """
        if self.defect().dimension:
            raise SolverStateError(f"{self.name}: the last matrix is singular, and has no inverse")
        s, n, result = self._structure, self.pattern.n, np.zeros(len(starts) - 1)
        place = np.empty(n, np.int64)
        place[s.unknowns] = np.arange(n)
        places = place[columns]
        nodes = np.searchsorted(s.start, places, "right") - 1
        order = np.argsort(np.append(nodes, 0)[starts[:-1]], kind="stable")  # those that lead the same way
        many = max(1, min(AT_ONCE, NUMBERS // max(n, 1), len(order)))
        x, is_met = np.zeros((many, n)), np.zeros(len(s.parent), np.bool_)
        scratch = np.empty(many * int(np.max(s.below, initial=0)))
        entries = starts, places, nodes, values
        with one_blas_thread():
            for first in range(0, len(order), many):
                rows = order[first : first + many]
                room = x[: len(rows)], is_met, scratch
                quadratic_forms(s, self._panels, rows, *entries, *room, routine_addresses(), result)
        return result

    def _sweep(self, substitute: Substitution, x: FloatArray, stop: int) -> None:
        scratch = np.empty(int(np.max(self._structure.below, initial=0)))
        with one_blas_thread():
            substitute(self._structure, stop, self._panels, x, scratch, routine_addresses())

    def _selected_inverse(self) -> FloatArray:
        return self._invert(len(self._structure.parent), np.empty((0, 0)))

    def _invert(self, stop: int, last_inverse: FloatArray) -> FloatArray:
        """Selected inverse; the supernodes from `stop` on have this inverse (lower triangle)."""
        schedule, structure = self._schedule, self._structure
        self._have_room(self._rooms()[1])
        scratch = np.empty((self._threads, int(np.max(structure.width * structure.front, initial=0))))
        selected = np.empty(self.pattern.nnz)

        def run(nodes: IntArray, worker: int) -> None:
            room = schedule.shared_room + worker * schedule.front_room
            if stop < len(structure.parent) and nodes[-1] == stop:
                at = room + schedule.front_at[stop]
                self._workspace[at : at + last_inverse.size] = last_inverse.ravel()
            invert_nodes(
                nodes,
                structure,
                schedule.front_at,
                schedule.update_at,
                schedule.is_shared,
                room,
                self._panels,
                self._workspace,
                scratch[worker],
                stop,
                selected,
                routine_addresses(),
            )

        with one_blas_thread():
            run_tasks(schedule, run, self._threads, upwards=False)
        self._workspace = np.empty(0)
        return selected

    def _rooms(self) -> tuple[int, int]:
        """Numbers that a factorisation, and the inverse, have in their workspace."""
        shared = self._schedule.shared_room
        own = self._schedule.update_room, self._schedule.front_room
        return shared + self._threads * own[0], shared + self._threads * own[1]

    def _have_room(self, room: int) -> None:
        """Room to work in, which is kept from one factorisation to the next, and not beyond the inverse."""
        if len(self._workspace) < room:
            self._workspace = np.empty(room)

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        width = self._structure.width.astype(np.float64)
        below = self._structure.below
        return SolverStatistics(
            solver=self.name,
            ordering=self._ordering,
            n=self.pattern.n,
            nnz_pattern=self.pattern.nnz,
            nnz_factor=int(np.sum(width * (width + 1) / 2 + width * below)),
            flops=float(np.sum(width**3 / 3 + width**2 * below + width * below**2)),
            memory=self._panels.nbytes + 8 * max(self._rooms()) + self._scratch.nbytes,
        )
