"""The solver of a matrix: by name, or in blocks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.leastsquares.solvers.selection import SMALL, checked_solver, choose_solver

if TYPE_CHECKING:
    from obseq.leastsquares.blocks.blocks import Blocks
    from obseq.leastsquares.solvers.protocol import Solver, SymmetricPattern


def checked_choice(solver: str | Blocks) -> str | Blocks:
    """A name of a solver, if it is one; blocks as they are.

    Raises:
        InputError: there is no such solver.
    """
    return checked_solver(solver) if isinstance(solver, str) else solver


def chosen_solver(pattern: SymmetricPattern, name: str | Blocks = "auto", *, threads: int = 1) -> Solver:
    """A solver for matrices of this pattern, not yet analysed; arguments and errors as of `choose_solver`.

    Blocks are not for small matrices, unless so many parts are asked for.
    """
    if isinstance(name, str):
        return choose_solver(pattern, name, threads=threads)
    if pattern.n <= SMALL and not name.parts:
        name.tell(f"blocks: {pattern.n} unknowns are solved whole, as up to {SMALL} are")
        return choose_solver(pattern, threads=threads)
    from obseq.leastsquares.blocks.solver import BlockSolver

    return BlockSolver(name.run)
