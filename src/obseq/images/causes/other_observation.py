"""One observation of another kind: a length, an observed pose, a reading of a survey or of a clinometer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.diagnosis.protocol import Change, Slip
from obseq.images.adjustment.quality import EquationNames
from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.evidence import Evidence
from obseq.images.causes.numbering import Numbering
from obseq.images.causes.survey_equations import SurveyEquation


def survey_equation(numbering: Numbering, label: tuple[int, ...]) -> SurveyEquation | None:
    """The observation of a survey that a hypothesis accuses; None where it is another one."""
    return numbering.of_surveys.of(numbering.others[label[0]].source, label[1])


def _where(numbering: Numbering) -> Members:
    starts, columns, labels = [0], [], []
    for k, other in enumerate(numbering.others):
        active = getattr(other.source, "active", np.ones(other.rows, np.bool_))
        for row in np.flatnonzero(active).tolist():
            columns.append(other.first + other.width * row + np.arange(other.width))
            starts.append(starts[-1] + other.width)
            labels.append((k, row))
    joined = np.concatenate([np.zeros(0, np.int64), *columns])
    return Members(np.array(starts), joined, np.array(labels, np.int64).reshape(-1, 2))


def _words(numbering: Numbering, label: tuple[int, ...]) -> str:
    if found := survey_equation(numbering, label):
        return found.what
    names = EquationNames(numbering.equations, numbering.surveys)
    return names.of(numbering.others[label[0]].source, label[1], 0, 0.0).name


def _slips(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    if found := survey_equation(evidence.numbering, label):
        yield from found.slips(change)


OTHER = Cause(
    "I180",
    "other observation",
    "A length, an observed pose or a reading of an instrument contradicts the rest; one of a "
    "survey has its own code.",
    "A value was mistyped, or belongs to other points.",
    "Correct the value, or leave it out.",
    "",
    0.0,
    _where,
    _words,
    _slips,
    is_start=True,
)
