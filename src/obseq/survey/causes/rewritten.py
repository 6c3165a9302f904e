"""A network as it would be without a mistake that many of its values share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.model import FieldBook, Points


@dataclass(frozen=True, eq=False)
class Rewritten:
    """A network as it would be without such a mistake.

    Attributes:
        code, slip, what, text: As in the result.
        rows: Observations that it concerns.
        known: Known points that it concerns.
        points, book: The network without it.
        told: Places of all points (n, 3) without it -> more words; None where they say that it is not that.
    """

    code: str
    slip: str
    what: str
    text: str
    rows: IntArray
    known: IntArray
    points: Points
    book: FieldBook
    told: Callable[[FloatArray], str | None] = lambda _: ""

    @property
    def count(self) -> int:
        """How many values it concerns: observations, and points."""
        return len(self.rows) + 3 * len(self.known)
