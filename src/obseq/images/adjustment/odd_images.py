"""Images that contradict all others, each or those of one camera, and what explains their measures.

The block is adjusted without them. Where that makes it fit, they are resected on the points of the others in
each way their measures may have been given in; one that brings nearly all of them to their points is adjusted
with the whole block, and named where it explains as much as leaving the images out does.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import ObseqError
from obseq.images.adjustment.exchanges import exchange_in
from obseq.images.control import ControlPoints
from obseq.images.initial.conventions import ALIKE, OF_ONE_IMAGE
from obseq.images.initial.resection import ResectionOptions, resect
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray, FloatArray
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.trials import Attempts, Trials
    from obseq.images.camera import Camera

TRIED = 8
"""Images that are left out in turn, the worst first."""
SEVERAL = 4
"""Images that are left out together, a third of a block at most."""
TIMES = 3.0
"""Times the usual residual, above which an image is tried though the block is not bad."""
NEAR, SIGMAS = 3.0, 6.0
"""Pixels and sigmas: a measure fits that misses its point by less than the larger of both."""
NEARLY_ALL = 0.9
LOOSE = ResectionOptions(triplets=200, max_error=np.inf, covariance=False)


@dataclass(frozen=True)
class Odd:
    """Images of a block that share something the others do not.

    Attributes:
        images: their names.
        said: what they are called.
    """

    images: tuple[str, ...]
    said: str

    @classmethod
    def of(cls, images: tuple[str, ...]) -> Odd:
        """Images that share nothing else."""
        return cls(images, f"image{'s' if len(images) > 1 else ''} {' and '.join(images)}")

    @property
    def is_one(self) -> bool:
        """Whether it is one image."""
        return len(self.images) == 1


def odd_image(trials: Trials, is_bad: bool) -> str:
    """Which image, or images of a camera, contradict the others, and why; empty where none does.

    Args:
        trials: of the block.
        is_bad: whether the block does not fit as a whole: any image may be the one then.
    """
    for odd in _candidates(trials, is_bad):
        without = trials.solved(_without(trials, odd), f"the block without {odd.said}")
        if without is not None and trials.contradicts(without):
            said = _Contradiction(trials, odd, without).words()
            if said or odd.is_one:
                return said
    return _several(trials) if is_bad else ""


def _several(trials: Trials) -> str:
    """Images that contradict the others together, the worst of each solution added to those before."""
    names: tuple[str, ...] = ()
    solution = trials.before
    for _ in range(min(SEVERAL, len(solution.poses) // 3)):
        names += (next(_worst_first(solution))[0],)
        odd = Odd.of(names)
        without = _left_out(trials, odd, solution)
        if without is None:
            return ""
        if without.converged and trials.contradicts(without):
            return _Contradiction(trials, odd, without).words()
        solution = without
    return ""


def _left_out(trials: Trials, odd: Odd, from_there: BundleSolution) -> BundleSolution | None:
    """The block without images; from other poses where more odd ones spoil those from the measures."""
    said, changed = f"the block without {odd.said}", _without(trials, odd)
    if changed is None or len(trials.given):
        return trials.last(changed, said)
    found = trials.solved(changed, said)
    if found is not None:
        return found
    changed.poses = from_there.poses
    return trials.last(changed, said)


def _candidates(trials: Trials, is_bad: bool) -> Iterator[Odd]:
    """Cameras of some images, then images, the worst first."""
    block, images = trials.block, trials.before.poses.images
    used = list(dict.fromkeys(block.camera_of[image] for image in images))
    for name in used if is_bad and 1 < len(used) <= TRIED else ():
        own = tuple(image for image in images if block.camera_of[image] == name)
        if len(own) > 1:
            yield Odd(own, f"the images of camera {name}")
    for image, times in itertools.islice(_worst_first(trials.before), TRIED) if len(images) > 2 else ():
        if is_bad or times > TIMES:
            yield Odd.of((image,))


def _worst_first(solution: BundleSolution) -> Iterator[tuple[str, float]]:
    """Images, and how many times the usual residual their middle one is."""
    found = solution.residuals
    norms = np.linalg.norm(found.residuals / found.sigmas, axis=1)
    usual = max(1.0, float(np.median(norms)))
    middles = {number: float(np.median(norms[found.image == number])) for number in np.unique(found.image)}
    for number in sorted(middles, key=lambda number: -middles[number]):
        yield solution.poses.images[number], middles[number] / usual


def _without(trials: Trials, odd: Odd) -> AdjustableBlock | None:
    """The block without the measures in images, and without what is observed of their poses."""
    made = trials.measured(lambda measures: measures.rows(~_are_of(measures, odd)))
    if made is not None:
        made.pose_observations = [part.without(odd.images) for part in made.pose_observations]
    return made


def _are_of(measures: ImagePoints, odd: Odd) -> BoolArray:
    return are_among(measures.image_names, odd.images)[measures.image]


def odd_without(odd: Odd, attempts: Attempts, without: BundleSolution) -> str:
    """What is wrong with images that have no place in a block that fits without them, in words."""
    return _Explanation(attempts, odd, without).words()


@dataclass(frozen=True, eq=False)
class _Explanation:
    """What is wrong with images that contradict the others, in the solution without them."""

    trials: Attempts
    odd: Odd
    without: BundleSolution

    def words(self) -> str:
        """The explanation, or that there is none."""
        return self._convention() or self._camera() or self._unexplained()

    @property
    def _measures(self) -> ImagePoints:
        parts = [part.measures.rows(_are_of(part.measures, self.odd)) for part in self.trials.block.sets]
        return functools.reduce(ImagePoints.joined, parts)

    @property
    def _cameras(self) -> dict[str, Camera]:
        """Cameras of the images, as adjusted without them where they are known."""
        return {image: self._adjusted(self.trials.block.camera_of[image]) for image in self.odd.images}

    def _adjusted(self, camera: str) -> Camera:
        return self.without.cameras.get(camera, self.trials.block.cameras[camera])

    def _fits(
        self, measures: ImagePoints, cameras: dict[str, Camera]
    ) -> tuple[ImagePoints, BoolArray, FloatArray]:
        """Measures of known points, whether each fits from the best pose of its image, and where it would."""
        known = ControlPoints.of(self.without.points, self.without.coordinates)
        try:
            found = resect(measures, known, cameras, LOOSE)
        except ObseqError:
            return measures, np.zeros(len(measures), dtype=bool), measures.xy
        sigma0 = max(self.without.sigma0 or 1.0, 1.0)
        far = np.maximum(NEAR, SIGMAS * sigma0 * found.measures.sigmas)
        fits = np.asarray((np.abs(found.residuals) <= far).all(axis=1))
        return found.measures, fits, found.measures.xy + found.residuals

    def _fit_so(self, measures: ImagePoints | None, cameras: dict[str, Camera]) -> bool:
        """Whether nearly all measures fit, given otherwise."""
        if measures is None:
            return False
        _, fits, _ = self._fits(measures, cameras)
        return bool(np.count_nonzero(fits) >= NEARLY_ALL * len(fits))

    def _convention(self) -> str:
        """Other ways to give the image points that explain them."""
        found: list[tuple[str, BundleSolution]] = []
        for convention in OF_ONE_IMAGE:
            change = partial(convention.of, cameras=self.trials.cameras, images=self.odd.images)
            if self._fit_so(change(self._measures), self._cameras):
                found += self._tried(self.trials.measured(change), convention.trial, convention.said)
        return self._said(found)

    def _camera(self) -> str:
        """Another camera of the block that explains them."""
        own = {self.trials.block.camera_of[image] for image in self.odd.images}
        found: list[tuple[str, BundleSolution]] = []
        for name in self.without.cameras.keys() - own:
            camera = self._adjusted(name)
            if self._fit_so(self._measures, dict.fromkeys(self.odd.images, camera)):
                found += self._tried(self._taken_by(name), name, f"camera {name} instead of {', '.join(own)}")
        return self._said(found)

    def _taken_by(self, camera: str) -> AdjustableBlock:
        made = self.trials.copy()
        made.camera_of |= dict.fromkeys(self.odd.images, camera)
        cameras = tuple(made.camera_of[image] for image in made.poses.images)
        made.poses = replace(made.poses, cameras=cameras)
        return made

    def _tried(
        self, block: AdjustableBlock | None, trial: str, said: str
    ) -> list[tuple[str, BundleSolution]]:
        """What explains the measures, and the block that is changed so; nothing where it does not."""
        found = self.trials.solved(block, f"{self.odd.said}, {trial}")
        if found is None or not self.trials.explains(found, self.without):
            return []
        return [(said, found)]

    def _said(self, found: list[tuple[str, BundleSolution]]) -> str:
        """Explanations in words: the best one, and those that are as good."""
        least = min((solved.sigma0 or 0.0 for _, solved in found), default=0.0)
        good = [(said, solved) for said, solved in found if (solved.sigma0 or 0.0) <= ALIKE * least]
        if not good:
            return ""
        listed, falls = ", or ".join(said for said, _ in good), self.trials.falls(good[0][1])
        return f"{self.odd.said}: {listed}: that explains {self._count}; so changed, {falls}"

    @property
    def _count(self) -> str:
        return f"{'its' if self.odd.is_one else 'their'} {len(self._measures)} measures"

    def _unexplained(self) -> str:
        verb = "contradicts" if self.odd.is_one else "contradict"
        return (
            f"{self.odd.said} {verb} all the others: without {self._count}, "
            f"{self.trials.falls(self.without)}; look for names of points of another image, another camera, "
            "or other axes of its pixels"
        )


@dataclass(frozen=True, eq=False)
class _Contradiction(_Explanation):
    """What is wrong with images that have poses and contradict the others."""

    trials: Trials

    def words(self) -> str:
        """The explanation, or that there is none; empty where most measures of an image fit as they are."""
        rows, fits, there = self._fits(self._measures, self._cameras)
        said = self._exchange(rows.rows(~fits), there[~fits]) or self._convention() or self._camera()
        return said or (self._unexplained() if self._misfit(rows, fits) else "")

    def _misfit(self, measures: ImagePoints, fits: BoolArray) -> bool:
        """Whether half of the measures of each image fit from no pose."""
        there, fit = (
            np.bincount(measures.image[rows], minlength=len(measures.image_names)) for rows in (..., fits)
        )
        return bool((2 * fit <= there).all())

    def _exchange(self, misfits: ImagePoints, there: FloatArray) -> str:
        """That two points of an image are exchanged, where all others that the others place fit."""
        if len(misfits.image_names) != 1 or len(misfits) > 2:
            return ""
        image, names = misfits.image_names[0], misfits.point_names
        if len(misfits) == 1:
            names += self._measured_at(image, there[0])
        return exchange_in(self.trials, image, *names) if len(names) == 2 else ""

    def _measured_at(self, image: str, place: FloatArray) -> tuple[str, ...]:
        """The point measured nearest to a pixel of an image, if the others do not place it; else none."""
        own = self._measures.of_image(image)
        name = own.point_names[own.point[np.argmin(np.linalg.norm(own.xy - place, axis=1))]]
        return () if name in self.without.points else (name,)
