"""What is wrong with a system that cannot be solved, by the names of its unknowns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import UNRESOLVED, SingularSystemError
from obseq.leastsquares.diagnosis.null_space import TAKES_PART, free_movements
from obseq.leastsquares.problem.numbering import FreeUnknowns
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.solvers import Solver, SymmetricPattern
from obseq.leastsquares.solvers.base import NUMBERS

SHOWN = 12
"""Names given in a message; the error's `unknowns` has them all."""

REMEDY = "freeze them, give them a prior, or add observations that depend on them"


def untouched_error(table: UnknownTable, untouched: IntArray) -> SingularSystemError:
    """The error for blocks (ids) that no equation touches and that are not frozen."""
    scalars = np.concatenate([table.start[block] + np.arange(table.size[block]) for block in untouched])
    names = table.component_names(scalars[~table.frozen[scalars]])
    return SingularSystemError(f"no equation touches {_listed(names)}: {REMEDY}", names, len(names))


def singular_error(
    table: UnknownTable, free: FreeUnknowns, pattern: SymmetricPattern, solver: Solver
) -> SingularSystemError:
    """The error for a normal matrix with vanishing pivots, which names what they leave undetermined."""
    lost = solver.defect().indices
    if not lost.size:
        return SingularSystemError(UNRESOLVED)
    if lost.size * pattern.n > NUMBERS:
        return _lost_error(table.component_names(free.scalars[lost]))
    return undetermined_error(table, free, pattern, solver.null_vectors(), lost)


def undetermined_error(
    table: UnknownTable,
    free: FreeUnknowns,
    pattern: SymmetricPattern,
    kernel: FloatArray,
    pivots: IntArray | None = None,
) -> SingularSystemError:
    """The error for what the equations do not determine.

    Args:
        table: The unknowns.
        free: Those that are free.
        pattern: The pattern of their normal matrix.
        kernel: (n_free, k) what they may do.
        pivots: (k,) numbers of free unknowns that would hold it; those that move when None.
    """
    moving = _participants(kernel)
    held = moving if pivots is None else pivots
    involved, named = (table.component_names(free.scalars[numbers]) for numbers in (moving, held))
    defect = kernel.shape[1] if pivots is None else len(pivots)
    message = _undetermined(named)
    if len(involved) > len(named):
        message += f" (undetermined together with {len(involved)} in all: {_listed(involved)})"
    meaning = free_movements(table, free, pattern, kernel)
    if meaning:
        message += f". Nothing fixes {'; nor '.join(meaning)}"
    message = f"{message}: {REMEDY}"
    if not involved:
        return SingularSystemError(message, named, defect)
    movements = {table.names[point]: text for text, points in meaning.items() for point in points.tolist()}
    return SingularSystemError(message, involved, defect, kernel[moving], movements)


def _lost_error(names: tuple[str, ...]) -> SingularSystemError:
    """The error where whole parts have come loose: vectors of all that moves are not worth their room."""
    return SingularSystemError(f"{_undetermined(names)}: {REMEDY}", names, len(names))


def _undetermined(names: tuple[str, ...]) -> str:
    return f"the observations leave {len(names)} unknown(s) undetermined: {_listed(names)}"


def eliminated_error(table: UnknownTable, scalar: int) -> SingularSystemError:
    """The error for an eliminated unknown (position among all) that its own observations do not determine."""
    (name,) = table.component_names(scalar)
    reason = f"{name} is to be eliminated, and the observations of its block do not determine it"
    return SingularSystemError(f"{reason}: {REMEDY}", (name,))


def grouped(unknowns: Sequence[str]) -> str:
    """Unknowns by what they belong to, for messages: "P (x, y), Q (z)" of "P.x", "P.y" and "Q.z"."""
    found: dict[str, list[str]] = {}
    for name in unknowns:
        owner, _, component = name.rpartition(".")
        found.setdefault(owner, []).append(component)
    return _listed(tuple(f"{owner} ({', '.join(parts)})" for owner, parts in found.items()))


def _participants(kernel: FloatArray) -> IntArray:
    """Unknowns that move without changing any residual to first order."""
    vectors = np.abs(kernel)
    if not vectors.size:
        return np.zeros(0, dtype=np.int64)
    moves: IntArray = np.flatnonzero(vectors.max(axis=1) > TAKES_PART * vectors.max())
    return moves


def _listed(names: tuple[str, ...]) -> str:
    more = f", ... ({len(names)} in all)" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
