"""A block from nothing but measures: a first pair, then image after image, then the control points' frame.

Images with enough control points are resected at once. The others are resected on the points that placed
images intersect, as long as there are some; where no image can be placed, a pair is oriented relatively and
grown in a frame of its own, which three control points, or nothing, bring to the world.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import field, replace

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion, closest_rotation, exponential
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.initial.intersection import intersect
from obseq.images.initial.relative import RelativeOrientation, relative_orientation
from obseq.images.initial.resection import LEAST_POINTS, ResectionOptions, resect
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among, index_of
from obseq.images.poses import Poses
from obseq.stopwatch import Tally

LOGGER = logging.getLogger(__name__)
LEAST_COMMON = 8
"""Points that a first pair must share."""
LEAST_KNOWN = 6
"""Intersected points that an image must have to be resected on them."""
PAIRS_TRIED = 12
LARGEST_RESIDUAL = 8.0
"""Pixels: points that any image misses by more are not used to place others."""
LOOSER = 8.0
"""Times as large as usual misses may be for the last images: unknown distortion makes tens of pixels."""
SHOWN = 3
"""Images whose reasons are told."""
LEAST_OF_A_FRAME = 3
"""Known points that bring a block to the world."""
FRAME_OPTIONS = ResectionOptions(triplets=200, max_error=8.0, covariance=False)


@dataclass(eq=False)
class Growth:
    """Images placed so far, in one frame.

    Attributes:
        measures: all image points.
        cameras: of every image.
        poses: by image.
        reasons: why an image could not be placed, at the last attempt.
    """

    measures: ImagePoints
    cameras: Mapping[str, Camera]
    poses: dict[str, RigidMotion] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    def waiting(self) -> list[str]:
        """Images without a pose."""
        return [image for image in self.measures.image_names if image not in self.poses]

    def as_poses(self) -> Poses:
        """The poses found."""
        names = list(self.poses)
        return Poses.of(
            names,
            [self.poses[name].centre for name in names],
            [self.poses[name].rotation for name in names],
            cameras=[self.cameras[name].name for name in names],
        )

    def points(self, largest: float = LARGEST_RESIDUAL) -> ControlPoints:
        """Points that the placed images intersect, as known points; none that any misses by more pixels."""
        placed = self.as_poses()
        seen = are_among(self.measures.image_names, placed.images)
        if len(placed) < 2 or not seen[self.measures.image].any():
            return ControlPoints.of([], np.zeros((0, 3)))
        rays = self.measures.rows(seen[self.measures.image])
        found = intersect(rays, placed, [self.cameras[image] for image in placed.images])
        missed = np.zeros(len(found.names))
        norms = np.nan_to_num(np.linalg.norm(found.residuals, axis=1), nan=np.inf)
        np.maximum.at(missed, rays.point, norms)
        good = np.flatnonzero(found.is_placed & (missed <= largest))
        return ControlPoints.of([found.names[row] for row in good], found.coordinates[good])

    def place(self, known: ControlPoints, least: int, options: ResectionOptions = FRAME_OPTIONS) -> int:
        """Resects the images that have enough known points; returns how many were placed."""
        part = self.measures.of_points(known.names)
        counts = dict(zip(part.image_names, np.bincount(part.image), strict=True)) if len(part) else {}
        waiting = [image for image in self.waiting() if counts.get(image, 0) >= least]
        tally = Tally("initial values: image", len(self.cameras))
        for image in sorted(waiting, key=lambda image: -counts[image]):
            try:
                found = resect(part.of_image(image), known, self.cameras[image], options)
                self.poses[image] = found.poses[image]
            except InputError as error:
                self.reasons[image] = str(error)
            if tally.is_due:
                tally.tell(len(self.poses))
        return sum(image in self.poses for image in waiting)

    def grow(self, control: ControlPoints, factor: float = 1.0) -> None:
        """Places images until no more can be: on control points, and on what placed images intersect.

        Args:
            control: known points.
            factor: by which misses may be larger than usual.
        """
        options = replace(FRAME_OPTIONS, max_error=factor * FRAME_OPTIONS.max_error)
        while self.waiting():
            tie = self.points(factor * LARGEST_RESIDUAL)
            new = [name for name in tie.names if name not in set(control.names)]
            added = tie.select(new)
            known = ControlPoints(
                control.names + added.names,
                np.concatenate([control.coordinates, added.coordinates]),
                np.concatenate([control.covariances, added.covariances]),
            )
            if not self.place(known, LEAST_KNOWN if len(tie) else LEAST_POINTS, options):
                return

    def start_pair(self, seed: int = 0) -> None:
        """Places the pair of images that shares most points with a good parallax, base one.

        Raises:
            InputError: no pair of images can be oriented.
        """
        waiting = self.waiting()
        best: tuple[float, str, str, RelativeOrientation] | None = None
        for first, second in self._pairs(waiting)[:PAIRS_TRIED]:
            try:
                found, quality = self._oriented(first, second, seed)
            except InputError as error:
                self.reasons[first] = str(error)
                continue
            if best is None or quality > best[0]:
                best = quality, first, second, found
        if best is None:
            tried = [image for image in waiting if image in self.reasons]
            why = "".join(f"; {image}: {self.reasons[image]}" for image in tried[:SHOWN])
            raise InputError(
                f"no two of the {len(waiting)} images without pose share {LEAST_COMMON} points from "
                f"different places{why}; give poses, or more control points"
            )
        _, first, second, found = best
        self.poses[first] = RigidMotion(np.zeros(3), np.eye(3))
        self.poses[second] = found.pose

    def _pairs(self, images: list[str]) -> list[tuple[str, str]]:
        """Pairs of images with enough common points, those with most first."""
        seen = np.zeros((len(self.measures.image_names), len(self.measures.point_names)), dtype=np.float32)
        seen[self.measures.image, self.measures.point] = 1.0
        rows = index_of(self.measures.image_names, images, "image")
        common = np.triu(seen[rows] @ seen[rows].T, 1)
        order = np.argsort(-common, axis=None, kind="stable")[: 4 * PAIRS_TRIED]
        pairs = [np.unravel_index(k, common.shape) for k in order]
        return [(images[i], images[j]) for i, j in pairs if common[i, j] >= LEAST_COMMON]

    def _oriented(self, first: str, second: str, seed: int) -> tuple[RelativeOrientation, float]:
        """The relative orientation of a pair, and how good a start it is: points times parallax."""
        a, b = self.measures.of_image(first), self.measures.of_image(second)
        names = [name for name in a.point_names if name in set(b.point_names)]
        rays = []
        for part, image in ((a, first), (b, second)):
            row = np.empty(len(part.point_names), dtype=np.int64)
            row[part.point] = np.arange(len(part))
            chosen = row[index_of(part.point_names, names, "point")]
            rays.append(self.cameras[image].directions(part.xy[chosen]))
        sound = np.isfinite(rays[0]).all(axis=1) & np.isfinite(rays[1]).all(axis=1)
        found = relative_orientation(rays[0][sound], rays[1][sound], seed=seed)
        turned = rays[1][sound] @ found.pose.rotation.T
        sine = np.linalg.norm(np.cross(rays[0][sound], turned), axis=1)[found.is_used]
        return found, float(found.is_used.sum() * min(np.median(sine), 0.5))

    def transform(self, scale: float, motion: RigidMotion) -> None:
        """Moves all poses by a similarity."""
        for image, pose in self.poses.items():
            self.poses[image] = RigidMotion(
                motion.centre + scale * motion.rotation @ pose.centre, motion.rotation @ pose.rotation
            )


def similarity(
    source: FloatArray, target: FloatArray, with_scale: bool = True, axis: FloatArray | None = None
) -> tuple[float, RigidMotion]:
    """Scale and motion that take points (n, 3) closest to their homologues (n, 3) (Umeyama, 1991).

    Args:
        source: the points.
        target: where they are to go.
        with_scale: False for a motion alone, of scale 1.
        axis: (3,) direction about which alone they may turn; None for any.

    Raises:
        InputError: there are fewer than three points, or they are on a line.
    """
    if len(source) < 3:
        raise InputError(f"a frame takes three known points; there are {len(source)}")
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    spread = np.linalg.svd(b, compute_uv=False)
    if spread[1] <= 1e-6 * spread[0]:
        raise InputError(f"the {len(source)} known points are on a line: the rotation is undetermined")
    rotation = closest_rotation(b.T @ a) if axis is None else _about(axis, a, b)
    scale = float(np.sum((a @ rotation.T) * b) / np.sum(a * a)) if with_scale else 1.0
    return scale, RigidMotion(target.mean(axis=0) - scale * rotation @ source.mean(axis=0), rotation)


def _about(axis: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """(3, 3) turn about an axis that takes centred points (n, 3) closest to others (n, 3)."""
    along = float(np.sum(a * b) - (a @ axis) @ (b @ axis))
    return np.asarray(exponential(np.arctan2(float(np.cross(a, b).sum(axis=0) @ axis), along) * axis))


def place_images(
    measures: ImagePoints, control: ControlPoints, cameras: Mapping[str, Camera], given: Poses
) -> Growth:
    """Poses for the images that have none.

    Args:
        measures: all image points.
        control: known points.
        cameras: camera of each image.
        given: poses that are known.

    Raises:
        InputError: no image can be placed to begin with; or the control points cannot carry the block.
    """
    growth = Growth(measures, cameras, {image: given[image] for image in given.images})
    known = _measured(growth, control)
    growth.grow(known)
    if growth.waiting() and len(growth.poses) < 2:
        growth.poses.clear()
        growth.start_pair()
        growth.grow(ControlPoints.of([], np.zeros((0, 3))))
        _to_frame(growth, known)
        growth.grow(known)
    LOGGER.info("placed %d of %d images", len(growth.poses), len(measures.image_names))
    return growth


def place_the_last(growth: Growth, control: ControlPoints) -> None:
    """Places images that are left over in a block that bends, where most have been placed."""
    if len(growth.waiting()) < len(growth.poses):
        growth.grow(_measured(growth, control), LOOSER)


def place_loosely(growth: Growth, control: ControlPoints) -> None:
    """Places images however far their points are missed: in a block that does not fit, to see why."""
    for factor in (LOOSER, LOOSER**2):
        growth.grow(_measured(growth, control), factor)


def _measured(growth: Growth, control: ControlPoints) -> ControlPoints:
    """The control points that are in an image."""
    names = set(growth.measures.point_names)
    return control.select([name for name in control.names if name in names])


def _to_frame(growth: Growth, known: ControlPoints) -> None:
    """Brings a block grown in a frame of its own to the control points, if there are any."""
    if not len(known):
        return
    found = growth.points()
    if sum(name in set(known.names) for name in found.names) < LEAST_OF_A_FRAME:
        found = growth.points(np.inf)  # a block that has drifted: the adjustment will bend it back
    common = [name for name in found.names if name in set(known.names)]
    try:
        moved = similarity(found.select(common).coordinates, known.select(common).coordinates)
    except InputError as error:
        raise InputError(
            f"the images are placed by one another, and control points bring them to the world: {error}; "
            "give and measure three that are not on a line, or give poses"
        ) from None
    growth.transform(*moved)
