"""A block without what a diagnosis accuses, for a second adjustment on request."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import cast

import numpy as np

from obseq.diagnosis.verdict import Status
from obseq.errors import InputError
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.causes.numbering import Numbering
from obseq.images.control import ControlPoints
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord, KnownRecord


def without_accused(solution: BundleSolution, diagnosis: DiagnosisRecord | None) -> AdjustableBlock:
    """The block of a solution without what is accused: image points out, known coordinates unknown.

    Args:
        solution: of the block as it was given.
        diagnosis: what is wrong with it.

    Raises:
        InputError: nothing is accused, it does not explain what is wrong, or it cannot be left out.
    """
    accused = _explaining(diagnosis)
    numbering = Numbering(solution.equations, solution.surveys)
    out = np.zeros(len(numbering.image), np.bool_)
    rows = [place.row for one in accused for place in one.observations]
    out[np.flatnonzero(numbering.kept)[rows]] = True
    images = {name for one in accused for name in one.images}
    names = solution.equations.start.poses.images
    out |= np.isin(numbering.image, [k for k, name in enumerate(names) if name in images])
    made = cast("AdjustableBlock", solution.block).copied()
    for part, given in enumerate(made.sets):
        kept = np.ones(len(given.measures), np.bool_)
        kept[numbering.row[out & (numbering.part == part)]] = False
        made.sets[part] = given.of_rows(kept)
    made.control = _freed(made.control, (known for one in accused for known in one.points))
    return made


def _explaining(diagnosis: DiagnosisRecord | None) -> tuple[AccusedRecord, ...]:
    """What is accused, where that explains what is wrong and can be left out."""
    if diagnosis is None or not diagnosis.accused:
        raise InputError("nothing is accused: there is no adjustment without it")
    if diagnosis.status != Status.EXPLAINED.value:
        raise InputError(
            "what is accused does not explain all that is wrong, and an adjustment without it would be wrong "
            "too: correct it first"
        )
    for one in diagnosis.accused:
        if not (one.observations or one.points or (one.images and one.test)):
            raise InputError(f"{one.what}: this is not left out but corrected (obseq causes {one.code})")
    return diagnosis.accused


def _freed(control: ControlPoints, known: Iterable[KnownRecord]) -> ControlPoints:
    """Control points of which some coordinates are unknown; they start where they are given."""
    covariances = control.covariances.copy()
    for coordinate in known:
        point, axis = control.names.index(coordinate.name), "xyz".index(coordinate.coordinate)
        covariances[point, axis, :] = covariances[point, :, axis] = 0.0
        covariances[point, axis, axis] = np.inf
    return replace(control, covariances=covariances)
