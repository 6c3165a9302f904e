"""Which observation of a survey, or which known coordinate, an equation of a larger system is.

And what all values of a survey beside images may be written in.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Slip
from obseq.images.causes.shared import SharedCause, Told, Trial
from obseq.records.shown_units import METRIC
from obseq.report.tables.units import Units
from obseq.survey.causes.catalogue import KNOWN, ROW
from obseq.survey.causes.notes import Notes
from obseq.survey.causes.rewriting import of_all_values
from obseq.survey.causes.values import explain
from obseq.survey.diagnosing.words import told
from obseq.survey.equations.known_coordinates import COMPONENTS
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.diagnosis.protocol import Change
    from obseq.images.adjustment.surveys import JoinedSurvey
    from obseq.images.causes.shared import Subject
    from obseq.leastsquares import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.survey import Network


class SurveyEquation(NamedTuple):
    """An equation of a survey: one of its observations, or a known coordinate.

    Attributes:
        number: of the network.
        network: that it is of.
        row: of the field book; -1 for a known coordinate.
        point, component: of a known coordinate; -1 for an observation.
    """

    number: int
    network: Network
    row: int
    point: int = -1
    component: int = -1

    @property
    def code(self) -> str:
        """Of the cause, as the diagnosis of a survey has it."""
        return ROW if self.row >= 0 else KNOWN

    @property
    def unit(self) -> str:
        """Of its errors: "m" or "rad"."""
        return BY_CODE[int(self.network.book.observations.types[self.row])].unit if self.row >= 0 else "m"

    @property
    def what(self) -> str:
        """What it is called, with file and line."""
        if self.row >= 0:
            return self.network.book.label(self.row)
        points, axis = self.network.points, COMPONENTS[self.component]
        return f"known {axis} of {points.names[self.point]} ({points.place(self.point)})"

    @property
    def units(self) -> Units:
        """In which it is told, and was written."""
        return Units(self.network.shown or METRIC, self.network.written)

    def told(self, size: float) -> str:
        """How large an error is, in words."""
        return told(self.units, self.unit, [size])

    def slips(self, change: Change) -> Iterator[Slip]:
        """The slip that may be behind its error."""
        if self.row < 0:
            return
        rows = self.network.book.observations
        kind, value = BY_CODE[int(rows.types[self.row])], float(rows.values[self.row])
        size, tolerance = float(change.size[0]), POLICY.near * float(change.sigma[0])
        if abs(size) <= 2.0 * tolerance:
            return
        if found := explain(kind, value, value - size, tolerance, self.units):
            yield Slip(found.code, found.text, found.chance, is_strong=found.chance < POLICY.likely)


class SurveyEquations:
    """Which observation of a survey each equation of a larger system is."""

    def __init__(self, surveys: Sequence[JoinedSurvey]) -> None:
        self._of: dict[int, list[SurveyEquation]] = {}
        for number, part in enumerate(surveys):
            for rows, batch in part.equations.batches.values():
                own = [SurveyEquation(number, part.network, row) for row in rows.tolist()]
                self._of[id(batch)] = own
            known = part.equations.known
            coordinates = known.coordinates().tolist()
            for batch, places in known.places().items():
                own = [SurveyEquation(number, part.network, -1, *coordinates[k]) for k in places.tolist()]
                self._of[id(batch)] = own

    def of(self, source: Batch | Prior, row: int) -> SurveyEquation | None:
        """That of a row of a batch; None where it is of no survey."""
        return self._of[id(source)][row] if id(source) in self._of else None


def _trials(subject: Subject) -> Iterator[Trial]:
    """The block with all values of a kind in a survey written anew."""
    for k, network in enumerate(subject.block.surveys):
        for one in of_all_values(Notes(network.points, network.book)):
            made = subject.block.copied()
            made.poses = subject.given
            made.surveys[k] = replace(network, points=one.points, book=one.book)
            said = f"{one.what} of the survey: {one.text}"
            yield Trial.saying(said, Told(said, code=one.code), made)


SURVEY_VALUES = SharedCause(
    "I160",
    "values of a survey",
    "All values of a kind in a survey beside the images are in another unit, or counted the other way; the "
    "code is that of the survey then (S200 to S204).",
    "Angles in degrees in a file of gon.",
    "Convert the values, or give their unit.",
    4.0,
    _trials,
)
