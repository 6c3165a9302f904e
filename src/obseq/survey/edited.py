"""Copies of a network in which some observations take no part, or have other sigmas."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

from obseq.arguments import NOTHING, NUMBER, TEXT, expecting, instance, weights_factor
from obseq.dataclass import dataclass
from obseq.records.diagnosis import DiagnosisRecord
from obseq.survey.by_name import chosen, with_sigmas
from obseq.survey.diagnosing.without_accused import without_accused
from obseq.survey.model import FieldBook, Points


@dataclass(frozen=True, eq=False)
class Edited:
    """Points and observations of which copies are made.

    Attributes:
        points: All points that a file gives or an active observation names.
        book: The observations, numbered like the points.
    """

    points: Points
    book: FieldBook

    def without(self, *what: str, kind: str | None = None) -> Self:
        """The network in which some observations take no part.

        Args:
            *what: Each one a sight "S6 -> P05", a point "S6" (all that name it), or a place
                "survey.obs:185".
            kind: Only those of this kind: "Hz", "Dist", ...

        Raises:
            InputError: No observation is called so.
        """
        return replace(self, book=self.book.without(chosen(self.book, what, kind)))

    @expecting(kind=TEXT | NOTHING, factor=NUMBER | NOTHING, sigma=NUMBER | NOTHING)
    def weights(
        self, *what: str, kind: str | None = None, factor: float | None = None, sigma: float | None = None
    ) -> Self:
        """The network in which some observations have other sigmas.

        Args:
            *what: As in `without`; none for all.
            kind: Only those of this kind: "Hz", "Dist", ...
            factor: What multiplies their sigmas.
            sigma: Their sigma, m or rad, in place of what they have.

        Raises:
            InputError: No observation is called so; no factor and no sigma, or both; one of no size.
        """
        factor = weights_factor(factor, sigma)
        return replace(self, book=with_sigmas(self.book, chosen(self.book, what, kind), factor, sigma))

    @expecting(diagnosis=instance(DiagnosisRecord) | NOTHING)
    def without_accused(self, diagnosis: DiagnosisRecord | None) -> Self:
        """The network without what is accused, for a second adjustment: it says what was left out.

        Observations of an error, or of a group that shares one, take no part; known coordinates are unknown.

        Args:
            diagnosis: Of an adjustment of this network (`Adjustment.diagnosis`).

        Raises:
            InputError: Nothing is accused, or it does not explain what is wrong.
        """
        points, book = without_accused(self.points, self.book, diagnosis)
        return replace(self, points=points, book=book)
