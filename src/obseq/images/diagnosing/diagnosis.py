"""What is wrong with a block: single errors by the engine, then mistakes that the whole block shares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import cast

import numpy as np
from msgspec import structs

from obseq.cached import cached_property
from obseq.diagnosis.engine import Search, diagnose
from obseq.diagnosis.judgement import MANY as MANY_ERRORS
from obseq.diagnosis.policy import POLICY, Policy
from obseq.diagnosis.verdict import Status, Verdict
from obseq.errors import SingularSystemError
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.adjustment.surveys import follower
from obseq.images.causes.axes import CONTROL_AXES, IMAGE_AXES
from obseq.images.causes.comparison import has_robust_weights, is_mirrored
from obseq.images.causes.given_poses import GIVEN_POSES
from obseq.images.causes.images import IMAGE
from obseq.images.causes.numbering import Numbering
from obseq.images.causes.pose_rewritings import compared
from obseq.images.causes.shared import Subject
from obseq.images.causes.unit_of_control import UNIT_OF_CONTROL
from obseq.images.diagnosing.largest_tests import sizes_of_tests
from obseq.images.diagnosing.model import BlockModel
from obseq.images.diagnosing.record import record_of_fits, record_of_verdict, with_mirrors
from obseq.images.diagnosing.starts import start_from_images, start_from_measures
from obseq.images.diagnosing.trials import Fit, Tries, is_good, may_be_shared, squares
from obseq.images.diagnosing.whole_images import images_off, with_images
from obseq.images.initial.conventions import MOST_MEASURES, MOST_PLACED
from obseq.images.poses import Poses
from obseq.leastsquares.statistics.hypothesis_tests import robust_spread
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord

MANY = 3
"""Errors from which one mistake that all observations share is likelier."""
QUICK = replace(POLICY, steps=0, steps_of_large=0)
"""Of one start: where it is a robust place, or blocks are very large."""
MIRRORED = (
    "the block fits as a mirror image only (points behind the cameras, or a distortion that changes sides): "
    "axes of image points or control points are not those of here"
)


def silent(said: str) -> None:
    """Nobody is told."""


def diagnosed(
    solution: BundleSolution,
    given: Poses,
    told: Callable[[str], None] = silent,
    **options: object,
) -> DiagnosisRecord | None:
    """What is wrong with an adjusted block; None where nothing can tell.

    Args:
        solution: of the block.
        given: its poses before others were found.
        told: is told what is being tried; a trial takes as long as an adjustment.
        options: of `solve`, as they were.
    """
    block = cast("AdjustableBlock", solution.block)
    measures = sum(len(part.measures) for part in block.sets)
    is_undetermined = solution.converged and isinstance(solution.result.weak, SingularSystemError)
    if solution.sigma0 is None or options.get("datum") == "none" or is_undetermined:
        return None
    subject = Subject(block, given, solution)
    is_astray, redundancy = not solution.converged or is_mirrored(solution), solution.result.redundancy
    is_much = is_astray or may_be_shared(squares(solution), redundancy)
    shared = cache(lambda: Tries(subject, told, options).best() if measures <= MOST_PLACED else [])
    if has_robust_weights(solution):
        fits = shared() if is_much else []
        return record_of_fits(fits) if fits else _held_down(block, solution, measures)
    if measures > MOST_MEASURES:
        return single_errors(block, solution, measures, QUICK)
    singles = Singles(block, solution, measures)
    if is_much and singles.take_patience and shared() and shared()[0].is_accepted:
        return record_of_fits(shared())  # what is left is noise; more than a few errors cost more
    found = singles.record()
    if not found.accused and solution.converged and is_good(solution):
        return _of_good(subject, found, told, options)
    is_few = len(found.accused) < MANY
    is_few &= sum(one.code == IMAGE.code for one in found.accused) <= 1  # two may be exchanged
    is_explained = found.status == Status.EXPLAINED and is_few and not is_mirrored(solution)
    is_left = is_astray or may_be_shared(found.left, redundancy) if found.accused and is_few else is_much
    if not is_explained and is_left and measures <= MOST_PLACED:
        if shared() and _is_cheaper(shared()[0], found):
            return record_of_fits(shared())
        if is_mirrored(solution):
            return DiagnosisRecord(Status.UNEXPLAINED, squares(solution), redundancy, reason=MIRRORED)
    if is_explained and measures <= MOST_PLACED and _may_be_mirrored(block, found):
        return with_mirrors(found, Tries(subject, told, options).best([IMAGE_AXES, CONTROL_AXES]))
    fits = Tries(subject, told, options).best([UNIT_OF_CONTROL]) if measures <= MOST_PLACED else []
    if fits and _is_cheaper(fits[0], found):
        return record_of_fits(fits)
    is_little = bool(found.accused) and not is_explained and may_be_shared(found.left, redundancy)
    return _unlisted(found, solution) if is_little else found


def _unlisted(found: DiagnosisRecord, solution: BundleSolution) -> DiagnosisRecord:
    """What was found of a block of which it explains too little to be checked one by one."""
    reason = "; ".join(part for part in (found.reason, MANY_ERRORS) if part)
    return DiagnosisRecord(Status.UNEXPLAINED, squares(solution), solution.result.redundancy, reason=reason)


def _may_be_mirrored(block: AdjustableBlock, found: DiagnosisRecord) -> bool:
    """Whether control points alone are accused, and the others are on a plane: they tell no mirror image."""
    accused = {point.name for one in found.accused for point in one.points}
    if not accused or not all(one.points for one in found.accused):
        return False
    control = block.control
    known = np.array([name not in accused for name in control.names])
    known &= np.isfinite(control.sigmas).all(axis=1)
    rest = control.coordinates[known]
    if len(rest) < 3:
        return True
    thickness = float(np.linalg.svd(rest - rest.mean(axis=0), compute_uv=False)[2]) / len(rest) ** 0.5
    return bool(thickness <= POLICY.near * np.median(control.sigmas[known]))


def _is_cheaper(fit: Fit, found: DiagnosisRecord) -> bool:
    """Whether a mistake that all share explains at a lower price than what single errors leave and cost."""
    if not found.accused:
        return True
    return fit.left + fit.cause.rarity < found.left + sum(one.limit for one in found.accused)


def _held_down(block: AdjustableBlock, solution: BundleSolution, measures: int) -> DiagnosisRecord | None:
    """The errors that robust weights hold down, which may be many, by the sigma that most tests have.

    Whether all sigmas are too small is not asked: residuals of robust weights do not tell.
    """
    if not solution.result.has_covariances:
        return None
    tests = sizes_of_tests(solution, solution.reliability().whole)
    variance = max(robust_spread(tests[tests > 0.0]), 1.0) ** 2
    found = single_errors(block, solution, measures, replace(QUICK, variance=variance, most=POLICY.held_down))
    is_doubtful = found.status == Status.UNEXPLAINED and not found.accused and not found.reason
    return structs.replace(found, status=Status.ACCEPTED.value) if is_doubtful else found


def single_errors(
    block: AdjustableBlock, solution: BundleSolution, measures: int, policy: Policy = POLICY
) -> DiagnosisRecord:
    """What the engine finds: single observations, images, parameters."""
    return Singles(block, solution, measures, policy).record()


class Singles:
    """The search for single errors of a block, in two steps."""

    def __init__(
        self, block: AdjustableBlock, solution: BundleSolution, measures: int, policy: Policy = POLICY
    ) -> None:
        numbering = Numbering(solution.equations, solution.surveys)
        starts = [partial(find, block) for find in (start_from_measures, start_from_images)]
        others = starts if measures <= MOST_PLACED else []
        self._solution, self._policy = solution, policy
        self._model = BlockModel(numbering, solution.result, follower(solution.surveys), others)
        self._search = Search(self._model, policy)

    @cached_property
    def _at_first(self) -> Verdict | None:
        with self._model.borrowed():
            return self._search.at_first()

    @property
    def take_patience(self) -> bool:
        """Whether they are more than a few, or nothing explains the block at once."""
        return self._at_first is None

    def record(self) -> DiagnosisRecord:
        """What is found, with patience where it is needed."""
        verdict, model = self._at_first, self._model
        with model.borrowed():
            verdict = verdict or self._search.patiently()
            found = record_of_verdict(verdict, model.catalogue)
            if model.numbering.n <= POLICY.large or verdict.status in (Status.ACCEPTED, Status.EXPLAINED):
                return found
            place = model.robust()
            if not (images := images_off(model, place)).size:
                return found
            model.leave_out(images, place)
            rest = record_of_verdict(diagnose(model, self._policy), model.catalogue)
            return with_images(rest, model, images, squares(self._solution))


def _of_good(
    subject: Subject, found: DiagnosisRecord, told: Callable[[str], None], options: dict[str, object]
) -> DiagnosisRecord:
    """What residuals of a block that fits do not show: poses of other images, units, sizes of images."""
    assert subject.solution is not None
    observed = bool(subject.block.pose_observations or subject.block.antennas)
    poses = compared(subject.solution.poses, subject.given, observed)
    if poses.images:
        accused = AccusedRecord(GIVEN_POSES.code, poses.said, images=poses.images, text=poses.said)
        return DiagnosisRecord(Status.EXPLAINED, found.left, found.redundancy, (accused,))
    fits = Tries(subject, told, options).best()
    return record_of_fits(fits) if fits else found
