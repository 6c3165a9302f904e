"""What a model (a network, a block of images) offers to the engine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.diagnosis.columns import Columns
    from obseq.diagnosis.hypotheses import Hypotheses
    from obseq.diagnosis.linear import Linear

Place = TypeVar("Place")
"""Where the unknowns of a model are; only the model knows what it is."""


@dataclass(frozen=True, eq=False)
class Change:
    """An error that is taken for granted.

    Attributes:
        index: The hypothesis.
        size: (q,) how large it is: observed, or given, minus right.
        sigma: (q,) the standard deviation of that.
    """

    index: int
    size: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class Slip:
    """WHAT: the slip of a person or a program that turns what is right into what is given.

    Attributes:
        code: Stable code, such as "W101".
        text: In words, for one line.
        misfit: Standard deviations by which it does not fit.
        is_strong: Whether it fits by chance so rarely that it tells where the error is.
    """

    code: str
    text: str
    misfit: float
    is_strong: bool


class Model(Protocol[Place]):
    """A network or a block, as the engine sees it. Methods raise ObseqError where nothing is found."""

    @property
    def hypotheses(self) -> Hypotheses:
        """What may be wrong, in an order that never changes."""

    def solution(self) -> Place | None:
        """Where the adjustment with everything in it ended; None where it did not converge."""

    def robust(self, without: Sequence[Change] = ()) -> Place:
        """Where a robust estimate leads from the initial values, known values being doubted like all others.

        Args:
            without: Errors that are taken off before.
        """

    def linearised(self, place: Place, applied: Sequence[Change]) -> tuple[Linear, Columns]:
        """All equations as they are given, at a place, and the columns of all hypotheses.

        Args:
            place: Where the unknowns are.
            applied: Errors that are taken off in the geometry, since their effect is not linear.
        """

    def adjusted(self, place: Place, changes: Sequence[Change]) -> tuple[Place, bool, int]:
        """Where least squares without some errors lead from a place; whether they converged; iterations.

        Rows are taken out, constants put right, known values freed.
        """

    def slips(self, change: Change, place: Place) -> tuple[Slip, ...]:
        """The slips that may be behind an error, the likeliest first."""
