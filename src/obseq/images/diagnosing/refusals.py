"""Why a block has no solution, or images no place: what explains it is said with the error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from obseq.diagnosis.engine import diagnose
from obseq.diagnosis.verdict import Status
from obseq.errors import InputError, ObseqError, SingularSystemError
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.equations import Equations
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.adjustment.start import ContradictionError, start_of
from obseq.images.causes.conventions import convention_of
from obseq.images.causes.images import IMAGE
from obseq.images.causes.numbering import Numbering
from obseq.images.causes.shared import Subject
from obseq.images.control import ControlPoints
from obseq.images.diagnosing.diagnosis import diagnosed, silent
from obseq.images.diagnosing.model import BlockModel
from obseq.images.diagnosing.record import record_of_fits, record_of_verdict
from obseq.images.diagnosing.starts import placed_by_images
from obseq.images.diagnosing.trials import Tries, is_accepted
from obseq.images.initial.conventions import MOST_PLACED
from obseq.images.initial.growth import Growth, place_loosely
from obseq.images.names import are_among
from obseq.leastsquares import LeastSquares
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord, SlipRecord
from obseq.records.record import to_plain

MOST_LOST = 3
"""One of so many images at most may have no place at all, for the others to say why."""


@contextmanager
def explained(
    block: AdjustableBlock, told: Callable[[str], None] | None = None, **options: object
) -> Iterator[None]:
    """Errors of a block that its measures leave undetermined, or contradict, say what explains them.

    Args:
        block: with the poses that were given.
        told: is told what is being tried.
        options: of `solve`.
    """
    subject = Subject(block, block.poses, None)
    try:
        yield
    except (ContradictionError, SingularSystemError) as error:
        if sum(len(part.measures) for part in block.sets) <= MOST_PLACED:
            _say(error, _of_no_solution(subject, told or silent, options))
        raise


def _say(error: ObseqError, found: DiagnosisRecord | None) -> None:
    """Adds what explains an error to its text, and the record of that to the error."""
    if found is not None and found.accused:
        error.args = (f"{error}\nLikely cause: {'; '.join(one.text for one in found.accused)}",)
        error.diagnosis = to_plain(found)  # type: ignore[attr-defined]


def _of_no_solution(
    subject: Subject, told: Callable[[str], None], options: dict[str, object]
) -> DiagnosisRecord | None:
    tries = Tries(subject, told, options)
    if fits := tries.best():
        return record_of_fits(fits)
    held = subject.block.copied()
    held.poses = subject.given
    held.freeze_parameters()
    found = tries.solved(held)
    if found is None:
        return _single_errors(subject.block) or _by_images(subject.block)
    return diagnosed(found, subject.given, told, **options)


def why_unplaced(block: AdjustableBlock, growth: Growth) -> DiagnosisRecord | None:
    """What keeps images of a block from being placed; None where nothing tells.

    Args:
        block: as it was given.
        growth: as far as its images were placed; the others are placed loosely.
    """
    if len(growth.measures) > MOST_PLACED:
        return None
    subject = Subject(block, block.poses, None)
    tries = Tries(subject, silent, {})
    if fits := tries.best():
        return record_of_fits(fits)
    if found := _by_images(block):
        return found
    place_loosely(growth, block.control)
    lost = growth.waiting()
    if MOST_LOST * len(lost) > len(growth.measures.image_names):
        return None
    rest = _without(block, growth, lost)
    found = _single_errors(rest)
    solution = tries.solved(rest)
    if lost and solution is not None and is_accepted(solution):
        return _of_lost(block, solution, [name for name in lost if name in growth.reasons])
    return found


def _by_images(block: AdjustableBlock) -> DiagnosisRecord | None:
    """Single errors of a block whose images make a shape that most control points agree with."""
    try:
        return _single_errors(placed_by_images(block))
    except ObseqError:
        return None


def _single_errors(rest: AdjustableBlock) -> DiagnosisRecord | None:
    """Single errors of a block whose images were placed by force."""
    try:
        model = BlockModel(Numbering(Equations(rest, start_of(rest), LeastSquares(), True)), None)
        with model.borrowed():
            verdict = diagnose(model)
    except ObseqError:
        return None
    return record_of_verdict(verdict, model.catalogue) if verdict.status is Status.EXPLAINED else None


def _without(block: AdjustableBlock, growth: Growth, lost: list[str]) -> AdjustableBlock:
    """The block with the poses that were found, without the measures in lost images."""
    made = block.copied()
    made.sets = [
        replace(
            part,
            measures=part.measures.rows(~are_among(part.measures.image_names, lost)[part.measures.image]),
        )
        for part in block.sets
    ]
    made.poses = growth.as_poses()
    return made


def _of_lost(block: AdjustableBlock, solution: BundleSolution, lost: list[str]) -> DiagnosisRecord | None:
    """What is wrong with images that have no place in a block that fits without them."""
    if not lost:
        return None
    rays = np.bincount(solution.residuals.point, minlength=len(solution.points))
    rows = np.flatnonzero((rays >= 2) | solution.start.is_control)
    known = ControlPoints.of([solution.points[row] for row in rows], solution.coordinates[rows])
    cameras = {**block.cameras, **solution.cameras}
    accused = []
    for image in lost:
        (measures, *_) = (part.measures for part in block.sets if image in part.measures.image_names)
        own = {image: cameras[block.camera_of[image]]}
        slips = tuple(convention_of(measures.of_image(image), known, own, list(cameras.values())))
        told = slips[0].text if slips else "it contradicts the others, and nothing tried explains it"
        records, what = tuple(SlipRecord(slip.code, slip.text) for slip in slips), f"image {image}"
        text = f"{what}: {told}"
        accused.append(AccusedRecord(IMAGE.code, what, images=(image,), text=text, slips=records))
    left = (solution.sigma0 or 0.0) ** 2 * solution.result.redundancy
    return DiagnosisRecord(Status.EXPLAINED, left, solution.result.redundancy, tuple(accused))


def unplaced_error(said: str, block: AdjustableBlock, growth: Growth, causes: bool, notes: str) -> InputError:
    """The error that images cannot be placed, with what explains it where that is looked for."""
    error = InputError(said)
    if causes:
        _say(error, why_unplaced(block, growth))
    error.args = (f"{error}{notes}",)
    return error
