"""A network without what a diagnosis accuses, for a second adjustment on request."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray
from obseq.diagnosis.verdict import Status
from obseq.errors import InputError
from obseq.printable import listed
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord
from obseq.records.quality import UnusedRecord
from obseq.survey.equations.known_coordinates import COMPONENTS
from obseq.survey.model import FieldBook, Points
from obseq.survey.points import CoordinateCovariance

REASON = "an adjustment without what is accused was asked for"
_MOST = 3
"""Alternatives that are named."""


def without_accused(
    points: Points, book: FieldBook, diagnosis: DiagnosisRecord | None
) -> tuple[Points, FieldBook]:
    """A network without what is accused: observations out, known coordinates unknown.

    Args:
        points: The points that were adjusted.
        book: Their observations.
        diagnosis: What is wrong with them.

    Returns:
        Points and observations; these hold what was left out, as `unused`.

    Raises:
        InputError: Nothing is accused, it does not explain what is wrong, or nothing would be known.
    """
    accused = _explaining(diagnosis)
    rows = np.zeros(len(book.observations), np.bool_)
    rows[[place.row for one in accused for place in one.observations]] = True
    known = np.zeros((len(points), 3), np.bool_)
    for coordinate in (coordinate for one in accused for coordinate in one.points):
        known[points.index[coordinate.name], COMPONENTS.index(coordinate.coordinate)] = True
    if known.any() and (known | points.is_free).all():
        raise InputError(
            "what is accused is a mistake of all known points, and nothing is known without them: correct it "
            "first"
        )
    told = UnusedRecord(REASON, tuple(map(_told, accused)))
    return _freed(points, known), replace(book.without(rows), unused=(*book.unused, told))


def _explaining(diagnosis: DiagnosisRecord | None) -> tuple[AccusedRecord, ...]:
    """What is accused, where that explains what is wrong."""
    if diagnosis is None or not diagnosis.accused:
        raise InputError("nothing is accused: there is no adjustment without it")
    if diagnosis.status != Status.EXPLAINED.value:
        raise InputError(
            "what is accused does not explain all that is wrong, and an adjustment without it would be wrong "
            "too: correct it first"
        )
    return diagnosis.accused


def _freed(points: Points, known: BoolArray) -> Points:
    """Points of which some known coordinates (n, 3) are unknown; they start where they are given.

    Where all three are wrong, the point has no place to start from.
    """
    coordinates, sigmas = points.coordinates.copy(), points.sigmas.copy()
    coordinates[known.all(axis=1)] = np.nan
    sigmas[known] = np.nan
    covariance = _of_the_others(points, known)
    return replace(points, coordinates=coordinates, sigmas=sigmas, covariance=covariance)


def _of_the_others(points: Points, known: BoolArray) -> CoordinateCovariance | None:
    """The covariance of known coordinates without those of a mask (n, 3)."""
    given = points.covariance
    if given is None:
        return None
    kept = [k for k, (name, part) in enumerate(given.coordinates) if not known[points.index[name], part]]
    if not kept:
        return None
    return CoordinateCovariance(tuple(given.coordinates[k] for k in kept), given.matrix[np.ix_(kept, kept)])


def _told(one: AccusedRecord) -> str:
    """What is left out, and what might have been instead."""
    if not one.others:
        return one.what
    return f"{one.what} (or {listed([other.what for other in one.others], _MOST)}: nothing tells these apart)"
