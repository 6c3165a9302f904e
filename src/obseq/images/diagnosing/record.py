"""What was found to be wrong with a block, as its record holds it and people read it."""

from __future__ import annotations

import numpy as np
from msgspec import structs

from obseq.arrays import FloatArray
from obseq.diagnosis.verdict import Accusation, Status, Verdict
from obseq.images.causes.images import CAMERA_IMAGES, IMAGE
from obseq.images.causes.other_observation import OTHER, survey_equation
from obseq.images.causes.points import CONTROL_COORDINATE, CONTROL_POINT
from obseq.images.causes.survey_equations import SurveyEquation
from obseq.images.diagnosing.catalogue import Catalogue, Named
from obseq.images.diagnosing.trials import Fit
from obseq.printable import listed
from obseq.records.diagnosis import (
    AccusedRecord,
    DiagnosisRecord,
    KnownRecord,
    PlaceRecord,
    SlipRecord,
    SuspectRecord,
)

MOST_NAMED = 3
"""Places that are listed by name; of more, how many they are."""


def record_of_verdict(verdict: Verdict, catalogue: Catalogue) -> DiagnosisRecord:
    """The record of what the engine found."""
    accused, remarks = (
        tuple(_accused(one, catalogue) for one in some) for some in (verdict.accused, verdict.remarks)
    )
    left, redundancy = verdict.left, verdict.redundancy
    return DiagnosisRecord(verdict.status.value, left, redundancy, accused, verdict.reason, remarks)


def record_of_fits(fits: list[Fit]) -> DiagnosisRecord:
    """The record of mistakes that the whole block shares; the first of several that nothing tells apart."""
    first, *others = fits
    sigma0 = first.solution.sigma0 or 0.0
    said = f"{first.told.said}: so changed, sigma0 is {sigma0:.3g}"
    if others:
        said += f"; or {', or '.join(other.told.said for other in others)}: nothing tells them apart"
    accused = AccusedRecord(
        first.told.code or first.cause.code,
        first.told.said,
        images=first.told.images,
        text=said,
        others=tuple(
            SuspectRecord(fit.told.code or fit.cause.code, fit.told.said, images=fit.told.images)
            for fit in others
        ),
    )
    status = Status.EXPLAINED if first.is_accepted else Status.UNEXPLAINED
    return DiagnosisRecord(status.value, first.left, first.solution.result.redundancy, (accused,))


def with_mirrors(found: DiagnosisRecord, fits: list[Fit]) -> DiagnosisRecord:
    """What is accused of a block, beside mirror images of it that fit as well.

    One value with a slip has no size of its own, and costs no more than they do; others cost more.
    """
    if not fits:
        return found
    if len(found.accused) > 1 or not found.accused[0].slips:
        return record_of_fits(fits)
    (one,) = found.accused
    others = tuple(
        SuspectRecord(fit.told.code or fit.cause.code, fit.told.said, images=fit.told.images) for fit in fits
    )
    said = f"; or {', or '.join(other.what for other in (*one.others, *others))}: nothing tells them apart"
    text = one.text.partition("; or ")[0] + said
    return structs.replace(found, accused=(structs.replace(one, text=text, others=(*one.others, *others)),))


def _accused(one: Accusation, catalogue: Catalogue) -> AccusedRecord:
    named = catalogue.named(one.change.index)
    others = tuple(_suspect(catalogue.named(other.change.index), catalogue) for other in one.others)
    own = _suspect(named, catalogue)
    is_long = named.cause.is_block
    survey = of_survey(named, catalogue)
    size = () if is_long else tuple(one.change.size.tolist())
    sigma = () if is_long else tuple(one.change.sigma.tolist())
    slips = tuple(SlipRecord(slip.code, slip.text) for slip in one.slips)
    return AccusedRecord(
        own.code,
        own.what,
        own.observations,
        own.points,
        own.images,
        _text(own.what, one, named, [other.what for other in others], survey),
        size,
        sigma,
        survey.unit if survey else named.cause.unit,
        one.test,
        one.limit,
        others,
        slips,
    )


def _suspect(named: Named, catalogue: Catalogue) -> SuspectRecord:
    """What a hypothesis accuses."""
    numbering, start = catalogue.numbering, catalogue.numbering.equations.start
    what = named.cause.words(numbering, named.label)
    images: tuple[str, ...] = ()
    points: tuple[KnownRecord, ...] = ()
    observations: tuple[PlaceRecord, ...] = ()
    if named.cause is CONTROL_COORDINATE:
        points = (KnownRecord(start.points[named.label[0]], "xyz"[named.label[1]]),)
    elif named.cause is CONTROL_POINT:
        axes = numbering.coordinates[numbering.coordinates[:, 0] == named.label[0], 1]
        points = tuple(KnownRecord(start.points[named.label[0]], "xyz"[axis]) for axis in axes)
    elif named.cause is IMAGE:
        images = (start.poses.images[named.label[0]],)
    elif named.cause is CAMERA_IMAGES:
        own = np.flatnonzero(numbering.camera == named.label[0])
        images = tuple(start.poses.images[row] for row in own)
    else:
        observations = _places(named, catalogue)
    if survey := of_survey(named, catalogue):
        return SuspectRecord(survey.code, what)  # rows of a block's result are image points
    return SuspectRecord(named.cause.code, what, observations, points, images)


def of_survey(named: Named, catalogue: Catalogue) -> SurveyEquation | None:
    """The observation of a survey that a hypothesis accuses; None where it is another one."""
    return survey_equation(catalogue.numbering, named.label) if named.cause is OTHER else None


def _places(named: Named, catalogue: Catalogue) -> tuple[PlaceRecord, ...]:
    """Where the image points of a hypothesis were read."""
    numbering, start = catalogue.numbering, catalogue.numbering.equations.start
    measures = np.unique(named.columns[named.columns < numbering.first_control] // 2)
    kept = np.cumsum(numbering.kept) - 1
    found = []
    for measure in measures.tolist():
        part = start.sets[numbering.part[measure]].given
        origin = part.origin or numbering.equations.block.origin
        row = int(numbering.row[measure])
        line = int(origin.lines[row]) if origin is not None and origin.lines else 0
        path = "" if origin is None else origin.path
        found.append(PlaceRecord(path, line, int(kept[measure])))
    return tuple(found)


def _text(what: str, one: Accusation, named: Named, others: list[str], survey: SurveyEquation | None) -> str:
    """One error in a sentence or two."""
    size = "" if named.cause.is_block else f" is off by {_sizes(one.change.size, named.cause.unit)}"
    if survey is not None:
        size = f" is off by {survey.told(float(one.change.size[0]))}"
    told = "".join(f"; {slip.text}" for slip in one.slips[:1])
    text = f"{what}{size or ' is wrong'}{told}"
    if not others:
        return text
    return f"{text}; or {listed(others, MOST_NAMED)}: nothing tells them apart"


def _sizes(size: FloatArray, unit: str) -> str:
    values = ", ".join(f"{value:+.4g}" for value in size.tolist())
    return (f"({values})" if len(size) > 1 else values) + (f" {unit}" if unit else "")
