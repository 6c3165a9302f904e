"""Intel MKL PARDISO, when pypardiso is installed and it is asked for by name."""

from __future__ import annotations

import ctypes
import weakref

import numpy as np

from obseq.arrays import Array, FloatArray, IntArray
from obseq.errors import ObseqError, SolverUnavailableError
from obseq.leastsquares.solvers.base import BaseSolver, inverse_by_columns
from obseq.leastsquares.solvers.protocol import Defect, SolverStatistics, SymmetricPattern
from obseq.leastsquares.solvers.rank import factor_stepwise

ANALYSIS, FACTORISATION, SOLUTION, RELEASE = 11, 22, 33, -1
POSITIVE_DEFINITE = 2
NOT_POSITIVE_DEFINITE = -4

USER_SETTINGS, METIS, RETURN_ORDER = (0, 1), (1, 2), (4, 2)
COUNT_ENTRIES, COUNT_OPERATIONS = (17, -1), (18, -1)
FROM_ZERO, KEEP_DIAGONAL = (34, 1), (55, 1)
SETTINGS = (USER_SETTINGS, METIS, RETURN_ORDER, COUNT_ENTRIES, COUNT_OPERATIONS, FROM_ZERO, KEEP_DIAGONAL)
ENTRIES, OPERATIONS, STOPPED_AT, MEMORY = 17, 18, 29, 16
"""Positions in PARDISO's `iparm`, counted from 0; pairs are settings (position, value)."""


class Pardiso(BaseSolver):
    """MKL's PARDISO for positive definite matrices, with the phases called one by one.

    The lower triangle by columns is its upper triangle by rows, so nothing is copied. It has no selected
    inverse: ours solves for every column of the identity.
    """

    name = "pardiso"

    def __init__(self) -> None:
        super().__init__()
        try:
            from pypardiso import PyPardisoSolver
        except ImportError as error:
            raise SolverUnavailableError(self.name, "pypardiso") from error
        self._library = PyPardisoSolver().libmkl
        self._handle = np.zeros(64, dtype=np.int64)
        self._settings = np.zeros(64, dtype=np.int32)
        for position, value in SETTINGS:
            self._settings[position] = value
        weakref.finalize(self, _release, self._library, self._handle, self._settings)

    def _analyse(self, pattern: SymmetricPattern) -> None:
        _release(self._library, self._handle, self._settings)
        self._indptr = pattern.indptr.astype(np.int32)
        self._indices = pattern.indices.astype(np.int32)
        self._entries = np.ones(pattern.nnz)
        self._order = np.zeros(pattern.n, dtype=np.int32)
        if pattern.n:
            self._run(ANALYSIS)

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        return factor_stepwise(self.pattern, values, tolerance, self._attempt, lambda: self._order)

    def _attempt(self, values: FloatArray, scale: FloatArray) -> FloatArray:
        """Factors; pivots divided by `scale`, 0 where PARDISO stopped and 1 for all others then."""
        self._entries = values
        if self._run(FACTORISATION) == NOT_POSITIVE_DEFINITE:
            pivots = np.ones(len(scale))
            pivots[self._settings[STOPPED_AT] - 1] = 0.0
            return pivots
        eliminated, unused = np.empty(len(scale)), np.empty(len(scale))
        status = ctypes.c_int32(0)
        one = ctypes.byref(ctypes.c_int32(1))
        self._library.pardiso_getdiag(
            _pointer(self._handle), _pointer(eliminated), _pointer(unused), one, ctypes.byref(status)
        )
        pivots = np.empty_like(scale)
        pivots[self._order] = eliminated
        return np.asarray(pivots / scale)

    def _run(self, phase: int, rhs: FloatArray | None = None) -> int:
        """Runs one phase; returns PARDISO's status, having raised if it is none that we know to treat."""
        rhs = np.zeros((len(self._indptr) - 1, 1)) if rhs is None else rhs
        self._result = np.empty_like(rhs, order="F")
        status = _call(
            self._library, self._handle, self._settings, phase,
            self._entries, self._indptr, self._indices, self._order, np.asfortranarray(rhs), self._result,
        )  # fmt: skip
        if status not in (0, NOT_POSITIVE_DEFINITE):
            raise ObseqError(f"MKL PARDISO failed in phase {phase} with its error {status}")
        return status

    def _solve(self, rhs: FloatArray) -> FloatArray:
        self._run(SOLUTION, rhs)
        return self._result

    def _selected_inverse(self) -> FloatArray:
        return inverse_by_columns(self.pattern, self._solve)

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        self.defect()
        return SolverStatistics(
            solver=self.name,
            ordering="metis",
            n=self.pattern.n,
            nnz_pattern=self.pattern.nnz,
            nnz_factor=int(self._settings[ENTRIES]),
            flops=1e6 * float(self._settings[OPERATIONS]),
            memory=1024 * int(self._settings[MEMORY]),
        )


def _pointer(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _call(
    library: ctypes.CDLL,
    handle: IntArray,
    settings: Array,
    phase: int,
    values: FloatArray,
    indptr: Array,
    indices: Array,
    order: Array,
    rhs: FloatArray,
    result: FloatArray,
) -> int:
    """Calls PARDISO; returns its status."""
    integers = [ctypes.byref(ctypes.c_int32(i)) for i in (1, 1, POSITIVE_DEFINITE, phase, len(indptr) - 1)]
    columns = ctypes.byref(ctypes.c_int32(rhs.shape[1]))
    silent, status = ctypes.byref(ctypes.c_int32(0)), ctypes.c_int32(0)
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 16)(("pardiso", library))
    arguments = (
        _pointer(handle), *integers, _pointer(values), _pointer(indptr), _pointer(indices), _pointer(order),
        columns, _pointer(settings), silent, _pointer(rhs), _pointer(result), ctypes.byref(status),
    )  # fmt: skip
    function(*arguments)
    return status.value


def _release(library: ctypes.CDLL, handle: IntArray, settings: Array) -> None:
    """Gives back PARDISO's memory, if it took any."""
    if not handle.any():
        return
    nothing, no_rows, empty = np.zeros((1, 1)), np.zeros(1, dtype=np.int32), np.zeros((1, 1))
    _call(library, handle, settings, RELEASE, nothing, no_rows, no_rows, no_rows, empty, empty)
    handle[:] = 0
