"""Which solver for which matrix."""

from __future__ import annotations

from obseq.errors import InputError
from obseq.leastsquares.solvers.protocol import Solver, SymmetricPattern

SOLVER_NAMES = ("dense", "supernodal", "superlu", "pardiso", "cholmod")

SMALL = 250
"""Up to this many unknowns the matrix is dense. Measured with code compiled ahead of time on networks of
distances, levelling nets, traverses and strips of images (`tools/benchmarks/bench_dense.py`): once both
solvers are loaded the sparse one wins from 130 to 230 unknowns on, and is twice as fast at 300 to 400; its
first use in a process costs some 10 ms more (modules, and names of compiled code), so that a process that
solves a single system breaks even at 300 to 500. PyMETIS, which costs 40 to 70 ms, is not loaded for few
unknowns (`ordering.FEW`)."""

NEARLY_FULL = 0.5
"""Share of non-zero entries from which a dense factorisation is the faster one (measured: 0.65 to 0.75 times
the sparse time at 75 %, 2.5 times at 19 %)."""

LARGEST_DENSE = 10_000
"""Unknowns beyond which a dense matrix is not wanted however full it is (0.8 GB)."""


def choose_solver(pattern: SymmetricPattern, name: str = "auto", *, threads: int = 1) -> Solver:
    """A solver for matrices of this pattern, not yet analysed.

    Args:
        pattern: the pattern to be analysed.
        name: one of `SOLVER_NAMES`, or "auto": "dense" for small or nearly full matrices, else "supernodal".
        threads: for the dense and the supernodal solver; the others keep to the settings of their libraries.

    Raises:
        InputError: there is no such solver.
        SolverUnavailableError: the solver asked for needs a package that is not installed.
    """
    if checked_solver(name) == "auto":
        name = "dense" if _is_better_dense(pattern) else "supernodal"
    if name == "dense":
        from obseq.leastsquares.solvers.dense import DenseCholesky

        return DenseCholesky(threads)
    if name == "supernodal":
        from obseq.leastsquares.solvers.cholesky import SupernodalCholesky

        return SupernodalCholesky(threads=threads)
    if name == "pardiso":
        from obseq.leastsquares.solvers.outside.pardiso import Pardiso

        return Pardiso()
    if name == "superlu":
        from obseq.leastsquares.solvers.outside.superlu import SuperLU

        return SuperLU()
    from obseq.leastsquares.solvers.outside.cholmod import Cholmod

    return Cholmod()


def checked_solver(name: str) -> str:
    """The name of a solver, if it is one.

    Raises:
        InputError: there is no such solver.
    """
    if not isinstance(name, str) or name not in ("auto", *SOLVER_NAMES):
        raise InputError(f"there is no solver {name!r}; choose one of: auto, {', '.join(SOLVER_NAMES)}")
    return name


def _is_better_dense(pattern: SymmetricPattern) -> bool:
    full = pattern.n * (pattern.n + 1) / 2
    return pattern.n <= SMALL or (pattern.n <= LARGEST_DENSE and pattern.nnz >= NEARLY_FULL * full)
