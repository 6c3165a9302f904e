"""What an open adjustment found: values by name, residuals and tests of each equation, parts as views."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest
from obseq.images.adjusted import AdjustedBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.diagnosing.diagnosis import single_errors
from obseq.joint.causes import diagnosis_of
from obseq.joint.named import KNOWN_AS
from obseq.leastsquares import reliability
from obseq.survey.points import make_points, merge_points

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from obseq.arrays import FloatArray
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.equations import Equations
    from obseq.images.adjustment.start import Start
    from obseq.images.adjustment.surveys import JoinedSurvey
    from obseq.images.block import Block
    from obseq.joint.named import NamedEquation
    from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult, Reliability
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.problem.unknowns import State
    from obseq.records.diagnosis import DiagnosisRecord
    from obseq.survey import Adjustment, Network
    from obseq.survey.points import Points


class ImagePart(NamedTuple):
    """A block of images in the system: what it is, where it started, its equations."""

    block: Block
    start: Start
    equations: Equations


@dataclass(frozen=True, eq=False)
class Solved:
    """An adjusted whole; precisions are a posteriori where there is redundancy, else a priori.

    Attributes:
        system: the least-squares system.
        result: its solution: sigma0, redundancy, sums of squares by group, all unknowns and observations.
        equations: each equation of one's own with its batch.
        images_part: the block of images in the system; None without one.
        surveys: the survey networks: their coordinates and residuals.
        start: of the unknowns.
        own: points that were added, with what is known of them.
        priors: of those whose coordinates were given with sigmas.
    """

    system: LeastSquares
    result: LeastSquaresResult
    equations: tuple[tuple[NamedEquation, Batch], ...]
    images_part: ImagePart | None
    surveys: tuple[JoinedSurvey, ...]
    start: State
    own: Points
    priors: tuple[tuple[str, Prior], ...]

    @property
    def sigma0(self) -> float | None:
        """Square root of the weighted sum of squares over the redundancy; None without redundancy."""
        return self.result.sigma0

    @cached_property
    def images(self) -> BundleSolution:
        """The block of images at the solution, with its poses, cameras, precisions and records.

        Raises:
            InputError: There are no images.
        """
        if self.images_part is None:
            raise InputError("there is no block of images in this adjustment (add_images)")
        return BundleSolution(*self.images_part, self.result, self.result.iterations, self.surveys)

    def network(self, number: int = 0) -> Network:
        """A survey network with its points where they were found.

        Raises:
            InputError: There is none of that number.
        """
        survey = self._survey(number)
        points = replace(survey.network.points, coordinates=survey.coordinates(self.result))
        return replace(survey.network, points=points)

    def survey(self, number: int = 0) -> Adjustment:
        """A survey network as its `adjust` gives it: points, tests, ellipses, `table`, `plot`, `save`.

        What is wrong is said of the whole, in `record`.

        Raises:
            InputError: There is none of that number.
        """
        return self._survey(number).adjusted(self.result, self.reliability)

    def block(self) -> AdjustedBlock:
        """The block of images as its `adjust` gives it: images, cameras, points, `table`, `plot`, `save`.

        Raises:
            InputError: There are no images.
        """
        images = self.images
        return AdjustedBlock(
            images.block,
            images.start,
            images.equations,
            images.result,
            images.iterations,
            images.surveys,
            diagnosis=self.diagnosis,
        )

    def _survey(self, number: int) -> JoinedSurvey:
        if not 0 <= number < len(self.surveys):
            raise InputError(f"survey {number}: {len(self.surveys)} are in this adjustment, from 0 on")
        return self.surveys[number]

    @cached_property
    def diagnosis(self) -> DiagnosisRecord | None:
        """What contradicts the rest: observations of any formula, known values; None where nothing can tell.

        With images, the errors that images and control points have are looked for too.
        """
        if self.sigma0 is None:
            return None
        if self.images_part is not None:
            block = cast("AdjustableBlock", self.images_part.block)
            count = sum(len(part.measures) for part in block.sets)
            return single_errors(block, self.images, count)
        return diagnosis_of(self.system, self.result, self.start, self.surveys)

    def points(self, names: Sequence[str]) -> FloatArray:
        """(n, 3) coordinates of points, or of projection centres of images."""
        return self.values(names, "Point3")

    def values(self, names: Sequence[str], kind: str) -> FloatArray:
        """Values of what is alike and has a kind: Point3, Rotation, Direction, Vector, Scalar."""
        return np.concatenate([self.result.values([self._id(name, kind)]) for name in names])

    def covariance(self, names: Sequence[str], kind: str = "Point3") -> FloatArray:
        """(n, k, k) covariances of what is alike."""
        ids = [self._id(name, kind) for name in names]
        return self.result.covariance(ids, self.result.variance_factor is None)

    def residuals(self, equation: int) -> FloatArray:
        """(n, n_residuals) computed minus observed of an equation, by its number."""
        return self.result.residuals(self.equations[equation][1])

    @cached_property
    def reliability(self) -> Reliability:
        """Redundancy numbers and tests of all observations."""
        groups = {batch: rows for part in self.surveys for batch, rows in part.groups().items()}
        return reliability(self.system, self.result, groups=groups)

    def suspected(self) -> list[tuple[str, float]]:
        """Observations whose normalised residual is beyond the test, and that residual; the largest first."""
        critical = self.reliability.w_critical
        found = [
            (part.label(int(row)), float(part.w[row, column]))
            for part in self.reliability.all
            for row, column in np.argwhere(np.abs(np.nan_to_num(part.w)) > critical)
        ]
        return sorted(found, key=lambda one: -abs(one[1]))

    def others(self, known: Collection[str]) -> Points:
        """Points that are not among some: those of images, their centres, and those that were added."""
        parts = [self.own]
        if self.images_part is not None:
            parts += _points_of(self.images_part.start)
        found: list[Points] = []
        taken = set(known)
        for part in parts:
            rows = [row for row, name in enumerate(part.names) if name not in taken]
            taken |= set(part.names)
            names = [part.names[row] for row in rows]
            found.append(make_points(names, part.coordinates[rows], part.sigmas[rows]))
        return merge_points(found)

    def _id(self, name: str, kind: str) -> int:
        known: list[str] = []
        for label, pattern in KNOWN_AS.get(kind, ((kind, "{}"),)):
            table = self.system.unknowns.called(label)
            if (called := pattern.format(name)) in table:
                return table[called]
            known += table
        raise InputError(f"no {kind} is called {nearest(name, known)}")


def _points_of(start: Start) -> list[Points]:
    """The points and the projection centres of a block, with what is known of them."""
    is_given = start.is_control[:, None] & ~start.is_free
    sigmas = np.sqrt(np.diagonal(start.covariances, axis1=1, axis2=2))
    known = np.where(is_given & start.is_held, 0.0, np.where(is_given, sigmas, np.nan))
    given = np.where(start.is_control[:, None], start.coordinates, np.nan)
    centres = np.full((len(start.poses.images), 3), np.nan)
    return [make_points(start.points, given, known), make_points(start.poses.images, centres)]
