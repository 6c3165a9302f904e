"""The errors that obseq raises: one base class and a handful of causes."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from obseq.arrays import FloatArray, IntArray

LONGEST_NAME = 200
"""Characters of the longest name that is looked for; longer ones are refused unread."""


class ObseqError(Exception):
    """Base of every error that obseq raises on purpose; its message is meant for the user."""


class InputError(ObseqError):
    """A file, a point, an observation or a parameter is wrong; the message says which and what to do."""


class RowError(InputError):
    """One of many things that are given together is wrong.

    Attributes:
        row: which one, from 0; who has read them from a file can tell its line.
    """

    def __init__(self, message: str, row: int) -> None:
        super().__init__(message)
        self.row = row


class FormulaError(ObseqError):
    """A formula is unknown, or its definition or its arguments are not what they must be."""


class SingularSystemError(ObseqError):
    """The observations do not determine some unknowns.

    Attributes:
        unknowns: (n) their names.
        defect: How many of them would have to be known; None where nobody counted.
        kernel: (n, defect) how they may change without any residual; None where nobody computed it.
        movements: For points that move together as a rigid whole: what is not fixed of it, in words.
    """

    def __init__(
        self,
        message: str,
        unknowns: tuple[str, ...] = (),
        defect: int | None = None,
        kernel: FloatArray | None = None,
        movements: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(message)
        self.unknowns = unknowns
        self.defect = defect
        self.kernel = kernel
        self.movements = movements or {}


class CrsError(InputError):
    """A coordinate system is unknown or incomplete, or cannot do what is asked of it."""


class DegenerateGeometryError(InputError):
    """Points or a matrix do not determine the rotation that is asked for."""


class DivergenceError(ObseqError):
    """An equation, or a step, is no longer finite; the message names the first such observation."""


class StepError(ObseqError):
    """An iterative or linear-programming step did not reach its solution."""


class ContradictoryConstraintsError(InputError):
    """Some constraints cannot hold together; the message names one and those it contradicts."""


UNRESOLVED = (
    "the matrix is singular to rounding: its numbers differ too widely to tell what the observations "
    "determine from what the datum holds. Look for heights, distances or sigmas that are far from all the "
    "others, or hold known points"
)
"""What is said of a singular matrix where no single unknown is to blame."""


class SingularMatrixError(ObseqError):
    """Some pivots vanish: the matrix does not determine these unknowns.

    Attributes:
        indices: (k,) the unknowns whose pivots vanish, ascending; empty where rounding hides which.
        pivots: (k,) these pivots, each divided by the diagonal entry of its unknown.
    """

    def __init__(self, indices: IntArray, pivots: FloatArray) -> None:
        shown = ", ".join(str(index) for index in indices[:10]) + (", ..." if len(indices) > 10 else "")
        super().__init__(
            f"the matrix is singular: {len(indices)} vanishing pivot(s), at unknown(s) {shown}; "
            "fix as many unknowns, or add the observations that determine them"
            if len(indices)
            else UNRESOLVED
        )
        self.indices = indices
        self.pivots = pivots

    def __reduce__(self) -> tuple[type[SingularMatrixError], tuple[IntArray, FloatArray]]:
        return type(self), (self.indices, self.pivots)


class MissingPackageError(ObseqError, ImportError):
    """Something needs a package that is not installed; the message gives the command that installs it."""


class SolverUnavailableError(ObseqError):
    """The solver asked for by name needs a package that is not installed."""

    def __init__(self, solver: str, package: str) -> None:
        super().__init__(
            f"the solver {solver!r} needs a package that is not installed: pip install '{package}'"
        )
        self.solver = solver
        self.package = package

    def __reduce__(self) -> tuple[type[SolverUnavailableError], tuple[str, str]]:
        return type(self), (self.solver, self.package)


class SolverStateError(ObseqError):
    """A step was asked for before the one it needs: analyse, then factor, then solve."""


@contextmanager
def noting(notes: Iterable[str]) -> Iterator[None]:
    """Lets errors inside tell, after their message, what has been noted before them (`__notes__`), once each.

    Args:
        notes: looked at when an error comes, so that a list may grow inside.
    """
    try:
        yield
    except ObseqError as error:
        for note in notes:
            if note not in getattr(error, "__notes__", ()):
                error.add_note(note)
        raise


@contextmanager
def naming(where: object) -> Iterator[None]:
    """Makes wrong input found inside say where it stands: a file, a line or an element."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def nearest(name: str, known: Iterable[str]) -> str:
    """A name that means nothing, and the known ones most like it: the middle of a sentence about it."""
    if len(name) > LONGEST_NAME:
        return f"{name[:40]!r}... ({len(name)} characters; names have at most {LONGEST_NAME})"
    import difflib

    near = ", ".join(difflib.get_close_matches(name, list(known), n=4, cutoff=0.5)) or "none"
    return f"{name!r}; nearest names: {near}"
